"""Error bars of inferred forces by repeated measurement, for networks created by dynamics.

`infer` gives all of S equal weight before the measurement. Networks created by dynamics are
different: some of their contacts slide or carry no force, so that they lie on walls of S, which
contain hardly any of its volume, and only half as many of their forces as expected lie within one
standard error. So nothing is assumed about them here. The likeliest network is measured again, with
new errors,

    m' = f + σ ε,   ε normal,

and the likeliest network of m' is one draw (the parametric bootstrap: Efron, Tibshirani, An
Introduction to the Bootstrap, 1993). It lies on walls as often as nearest networks do. Unmeasured
components count as 0 with an error of `unmeasured` ⟨f_n⟩, in either measurement.
"""

from __future__ import annotations

import time

import numpy as np
import numpy.typing as npt

from granforce.experiment.infer import (
    Inference,
    checked_numbers,
    draws_of,
    inference_of,
    measured_rows,
)
from granforce.explore.mixing import Mixing
from granforce.fields import derived, record
from granforce.forces.ensemble import Ensemble
from granforce.forces.grain_pressures import GrainPressures, Rows
from granforce.forces.likeliest import checked, fitted, fitted_many, likeliest, spread_of
from granforce.numerics.lanes import LANES
from granforce.quantities import quantity
from granforce.records import random_seed, takes
from granforce.system import cancelling
from granforce.types import Cancel, Floats, Progress

# Standard error of unmeasured forces beforehand in a bounded S, in ⟨f_n⟩.
UNMEASURED = 2.0


@record
class Remeasured(Inference):
    """An Inference whose draws estimate the error of the likeliest network.

    For networks created by dynamics 68 % of the forces lie within one standard error of it.
    """

    __slots__ = ()
    shortfall = ""  # the draws are independent

    @property
    @derived(quantity("expected", label="mean", meaning="likeliest network itself"))
    def mean(self) -> Floats:
        """(N_c, 2) the likeliest network itself, to which the errors refer, force."""
        return self.forces

    @property
    @derived(
        quantity("standard_error", label="error", meaning="rms of draws less the likeliest network")
    )
    def error(self) -> Floats:
        """(N_c, 2) standard error of every force: root mean square of draws less the network."""
        return np.sqrt(np.mean((self.drawn.flat - self.forces) ** 2, axis=0))


@takes(Ensemble)
@cancelling.cancellable
def remeasured(
    ensemble: Ensemble,
    measured: npt.ArrayLike | None = None,
    sigma: npt.ArrayLike | None = None,
    *,
    pressures: GrainPressures | None = None,
    states: int = 200,
    seed: int = 0,
    unmeasured: float | None = None,
    chains: int = 4,
    workers: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Remeasured:
    """The network with the least Σ ((f − m)/σ)², with error bars from repeated measurement.

    Draws are independent of each other (their mixing is not diagnosed: NaN) and need no set-up: one
    contact program each, eight at a time.

    Parameters
    ----------
    ensemble, measured, sigma, pressures, seed, chains, progress, cancel
        As for `infer`.
    states : int, default 200
        Number of draws.
    unmeasured : float, optional
        As for `infer`, but 2 by default, and 1 in an unbounded S.
    workers : int, default 1
        Threads, which do not change the result.

    Returns
    -------
    Remeasured
        An Inference whose draws estimate its error.

    Raises
    ------
    InputError
        For inconsistent shapes and σ ≤ 0.
    NotJammedError
        If S is empty.
    """
    begin = time.perf_counter()
    numbers, seed = (states, chains, workers), random_seed(seed)
    unmeasured = spread_of(ensemble, unmeasured, UNMEASURED)
    numbers = checked_numbers(ensemble, numbers, least=1)
    m, s = checked(ensemble, measured, sigma)
    rows = measured_rows(ensemble, measured, pressures)
    best = likeliest(ensemble, m, s, unmeasured, rows)
    ready = time.perf_counter()
    width = np.where(np.isnan(m), unmeasured * ensemble.force_scale, s)
    repeated = _repeated(ensemble, best.forces, width, rows, *numbers, seed, progress)
    # The draws are independent, so mixing is not diagnosed.
    worth = Mixing(*np.full((3, *s.shape), np.nan))
    counts = {"turns": 0, "refused": 0, "dropped": 0, "held": 0}
    draws = draws_of(ensemble, repeated, worth, True, counts, 0.0, time.perf_counter() - ready)
    return inference_of(Remeasured, ensemble, best, rows, draws, begin)


def _repeated(
    ensemble: Ensemble,
    forces: Floats,
    s: Floats,
    rows: Rows,
    states: int,
    chains: int,
    workers: int,
    seed: int,
    progress: Progress | None,
) -> Floats:
    """Networks (chains, k, N_c, 2) from repeated measurements, at least `states` in all."""
    each = -(-states // chains)
    streams = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(chains))
    drawn = [rng.standard_normal((each, s.size + len(rows.values))) for rng in streams]
    errors, of_rows = np.split(np.concatenate(drawn), [s.size], axis=1)
    measurements = forces + s * errors.reshape(-1, *s.shape)
    sums = rows.matrix @ forces.ravel() + rows.sigma * of_rows
    width = 1 if len(rows.values) else LANES
    done, draws = 0, []

    def fit(first: int) -> Floats:
        if not len(rows.values):
            return fitted_many(ensemble, measurements[first : first + width], s)
        again = rows._replace(values=sums[first])
        return fitted(ensemble, measurements[first], s, rows=again)[None]

    with cancelling.threads(workers) as pool:
        for networks in pool.map(fit, range(0, len(measurements), width)):
            draws.append(networks)
            done += len(networks)
            if progress is not None:
                progress(done, len(measurements))
    return np.concatenate(draws).reshape(chains, each, *s.shape)
