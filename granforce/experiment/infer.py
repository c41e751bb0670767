"""Inference: the admissible network behind forces that were measured with errors.

A measurement gives components m of forces with standard errors σ. The network in S with the least

    χ² = Σ ((f − m)/σ)²

over them, and over measured pressures of grains (`grain_pressures`), is the most likely one. S
weighted with exp(−χ²/2) is a normal distribution truncated by the walls of S: the distribution of
the forces given the measurement, balance and Coulomb's law. Draws from it give the standard error
of every force, including those that were not measured.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from granforce import notebook
from granforce.explore import billiard, uniform
from granforce.explore.mixing import Mixing, mixing
from granforce.explore.walls import Walls, walls
from granforce.fields import derived, record
from granforce.forces.ensemble import Ensemble
from granforce.forces.grain_pressures import GrainPressures, Rows, rows_of
from granforce.forces.likeliest import Likeliest, checked, likeliest, spread_of
from granforce.quantities import quantity
from granforce.records import InputError, random_seed, takes, whole, worker_count
from granforce.system import cancelling
from granforce.system.memory import check_memory
from granforce.types import Cancel, Floats, Integers, Progress

# Residuals beyond this many standard errors are reported.
SUSPECT = 3.0
# A quarter of an oscillation: without walls the next state is independent of the last.
_TIME = np.pi / 2
# Paths between stored states: 1000 states are then worth 300 to 900 independent ones.
_PATHS = 4
# Number of paths whose speeds are drawn together.
_AT_ONCE = 8
# States dropped at the start of each chain.
_DROPPED = 20


Kind = TypeVar("Kind", bound="Inference")


@record
class Draws(NamedTuple):
    """States of S drawn with the weight exp(−χ²/2), by chain, with diagnostics."""

    states: Annotated[Floats, "(chains, k, N_c, 2) admissible networks, force"]
    residual: Annotated[Floats, "(chains, k) in ⟨f_n⟩, by Ensemble.residual"]
    violation: Annotated[Floats, "(chains, k) in ⟨f_n⟩, by Ensemble.violation"]
    mixing: Annotated[Mixing, "R̂, bulk and tail effective sample size of each component"]
    reached: Annotated[bool, quantity("reached", note="all in S, and R̂ ≤ 1.1")]
    counts: Annotated[dict[str, Any], "turns, rejected paths, dropped states, held coordinates"]
    setup_seconds: Annotated[float, quantity("setup_seconds")]
    sampling_seconds: Annotated[float, quantity("sampling_seconds", note="of dropped states, too")]
    effective = uniform.UniformSample.effective  # type: ignore[misc]
    flat = uniform.UniformSample.flat  # type: ignore[misc]
    chain = uniform.UniformSample.chain  # type: ignore[misc]


@record
class Inference(NamedTuple):
    """The most likely network given a measurement, and its uncertainty.

    Degrees of freedom are the measured components less the directions in which the network can
    follow the measurement, fewer than S has dimensions if forces lie on their cones, as at f_n = 0.
    """

    forces: Annotated[Floats, quantity("inferred", label="forces")]
    chi_square: Annotated[float, quantity("chi_square", note="Σ ((f − m)/σ)²")]
    freedom: Annotated[int, quantity("freedom")]
    deviation: Annotated[Floats, quantity("deviation", unit="sigma", note="NaN if not measured")]
    pressure_deviation: Annotated[Floats, quantity("pressure_deviation", label="")]
    suspects: Annotated[Integers, quantity("suspect", label="", note="largest first")]
    suspect_grains: Annotated[Integers, quantity("suspect_grain", label="", note="largest first")]
    residual: Annotated[float, quantity("residual", "")]
    violation: Annotated[float, quantity("violation", "")]
    draws: Annotated[Draws | None, "None if none were requested"]
    seconds: Annotated[float, quantity("seconds", note="including draws")]

    @property
    def drawn(self) -> Draws:
        """The draws; AttributeError if none were requested."""
        if self.draws is None:
            raise AttributeError("no states were drawn: set `states`")
        return self.draws

    @property
    def shortfall(self) -> str:
        """Why the draws are not to be relied on, and what to do; empty if they are."""
        draws = self.draws
        if draws is None or (draws.reached and np.isnan(draws.mixing.worst_r_hat)):
            return ""
        why = uniform.unreliable(draws.mixing.worst_r_hat, draws.effective)
        return why and f"the error bars are unreliable: {why}; draw more states"

    @property
    @derived(quantity("expected", label="mean"))
    def mean(self) -> Floats:
        return self.drawn.flat.mean(axis=0)

    @property
    @derived(quantity("standard_error", label="error"))
    def error(self) -> Floats:
        return self.drawn.flat.std(axis=0)

    def _repr_html_(self) -> str:
        """The inference as displayed in notebooks."""
        lines = {
            "measured components": int(np.isfinite(self.deviation).sum()),
            "measured pressures": int(np.isfinite(self.pressure_deviation).sum()),
            "χ²": self.chi_square,
            "degrees of freedom": self.freedom,
            "contacts beyond 3 σ": len(self.suspects),
            "grains beyond 3 σ": len(self.suspect_grains),
        }
        if self.draws is not None:
            lines |= {"draws": len(self.draws.flat), "mean standard error": self.error.mean()}
            lines |= {"worst R̂": self.draws.mixing.worst_r_hat, "worth": self.draws.effective}
        return notebook.table("Inferred forces", lines)


@takes(Ensemble)
@cancelling.cancellable
def infer(
    ensemble: Ensemble,
    measured: npt.ArrayLike | None = None,
    sigma: npt.ArrayLike | None = None,
    *,
    pressures: GrainPressures | None = None,
    states: int = 0,
    seed: int = 0,
    unmeasured: float | None = None,
    chains: int = 4,
    workers: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Inference:
    """The admissible network with the least Σ ((f − m)/σ)², and draws around it.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    measured : (N_c, 2) array, optional
        m, force, of the contacts of S; NaN for components that were not measured.
    sigma : float, (2,) or (N_c, 2) array, optional
        Standard errors σ, force: one, two for f_n and f_t, or one for each component.
    pressures : GrainPressures, optional
        Measured pressures p_g = (1/2A_g) Σ f_n a of grains, which count in χ² likewise. Forces that
        are not in the packing may press on grains whose balance is left open: these have none.
    states : int, default 0
        Minimum number of draws from the normal distribution of the measurement truncated by S, for
        error bars.
    seed : int, default 0
        Seed of the draws.
    unmeasured : float, optional
        Unmeasured components count as 0 with a standard error of this many ⟨f_n⟩. The default in a
        bounded S, 1000, only selects the least of networks that fit equally well. In an unbounded S
        it is 1: where the measurement does not bound a force either, only this does, and its error
        bar depends on it.
    chains : int, default 4
        Independent chains of draws.
    workers : int, default 1
        Threads, which do not change the result.
    progress : callable, optional
        progress(done, total) counts draws.
    cancel : callable, optional
        Polled; returning True raises Cancelled.

    Returns
    -------
    Inference
        forces (N_c, 2), χ² and its degrees of freedom, and the draws, if there are any.

    Raises
    ------
    InputError
        For inconsistent shapes, σ ≤ 0, or without any measurement.
    NotJammedError
        If S is empty.
    """
    begin = time.perf_counter()
    numbers, seed = (states, chains, workers), random_seed(seed)
    unmeasured = spread_of(ensemble, unmeasured)
    numbers = checked_numbers(ensemble, numbers)
    m, s = checked(ensemble, measured, sigma)
    rows = measured_rows(ensemble, measured, pressures)
    best = likeliest(ensemble, m, s, unmeasured, rows)
    draws = None
    if numbers[0]:
        # In ⟨f_n⟩, so that χ² = Σ W (f − m)².
        m, s = m / ensemble.force_scale, s / ensemble.force_scale
        weight = np.where(np.isnan(m), unmeasured, s) ** -2.0
        draws = _draws(ensemble, weight, np.nan_to_num(m), rows, numbers, seed, progress)
    return inference_of(Inference, ensemble, best, rows, draws, begin)


def checked_numbers(
    ensemble: Ensemble, numbers: tuple[int, int, int], least: int = 0
) -> tuple[int, int, int]:
    """Numbers of draws (at least `least`), chains and workers; InputError if they are invalid."""
    draws, chains = whole(numbers[0], "states", least), whole(numbers[1], "chains", 1)
    workers, most = worker_count(numbers[2]), max(draws, chains)
    check_memory(16 * most * len(ensemble.index), f"{most} states")
    return draws, chains, workers


def measured_rows(ensemble: Ensemble, measured: Any, pressures: GrainPressures | None) -> Rows:
    """The Rows of pressures; InputError if neither forces nor pressures were measured."""
    if measured is None and pressures is None:
        raise InputError(
            "nothing was measured: give forces of contacts with their errors, or pressures="
            "gf.GrainPressures(grains, values, sigma)"
        )
    return rows_of(ensemble, pressures)


def inference_of(
    kind: type[Kind],
    ensemble: Ensemble,
    best: Likeliest,
    rows: Rows,
    draws: Draws | None,
    begin: float,
) -> Kind:
    """The Inference (or a subclass) with a likeliest network, draws, and elapsed time."""
    of_grains = np.full(len(ensemble.packing.r), np.nan)
    of_grains[rows.grains] = best.of_rows
    return kind(
        best.forces,
        best.chi_square,
        best.freedom,
        best.deviation,
        of_grains,
        ensemble.index[_beyond(np.nan_to_num(best.deviation).T)],
        _beyond(np.nan_to_num(of_grains[None])),
        ensemble.residual(best.forces),
        ensemble.violation(best.forces),
        draws,
        time.perf_counter() - begin,
    )


def _beyond(deviation: Floats) -> Integers:
    """Positions with a deviation (parts, k) beyond SUSPECT, the largest first."""
    far = np.abs(deviation).max(axis=0)
    beyond = np.flatnonzero(far > SUSPECT)
    return beyond[np.argsort(-far[beyond], kind="stable")]


def draws_of(
    ensemble: Ensemble,
    forces: Floats,
    worth: Mixing,
    mixed: bool,
    counts: dict[str, Any],
    *seconds: float,
) -> Draws:
    """The Draws of states (chains, k, N_c, 2), with their residual, violation and mixing."""
    residual, violation = ensemble.residual(forces), ensemble.violation(forces)
    good = bool(uniform.are_admissible(residual, violation) and mixed)
    return Draws(forces, residual, violation, worth, good, counts, *seconds)


def _draws(
    ensemble: Ensemble,
    weight: Floats,
    m: Floats,
    rows: Rows,
    numbers: tuple[int, int, int],
    seed: int,
    progress: Progress | None,
) -> Draws:
    begin, (states, chains, workers) = time.perf_counter(), numbers
    polytope = walls(ensemble, weight, m, rows)
    stores, advance = uniform.stores_for(polytope, chains, workers), partial(step, polytope)
    ready = time.perf_counter()
    ends = uniform.start_chains(polytope, chains, seed)
    ends, _, dropped = uniform.advance_all(stores, ends, partial(advance, count=_DROPPED))
    each = -(-states // chains)
    _, samples, done = uniform.draw_states(
        ensemble, polytope, stores, ends, advance, 0, each, progress
    )
    cancelling.check("inference")
    drawn = time.perf_counter()
    worth = mixing(samples, uniform.varying_components(ensemble, polytope))
    counts = uniform.add_counts({"turns": 0, "refused": 0}, dropped + done)
    counts |= {"dropped": _DROPPED * chains, "held": len(polytope.centre) - len(polytope.moving)}
    mixed = not polytope.dimension or worth.worst_r_hat <= uniform.MIXED
    return draws_of(ensemble, samples, worth, mixed, counts, ready - begin, drawn - ready)


def step(
    polytope: Walls,
    ends: Sequence[uniform.ChainState],
    rows: billiard.RowStore | None = None,
    *,
    count: int,
) -> uniform.Advance:
    """The next `count` states of some chains, in the format of `uniform.step`.

    Gibbs sampling alternates two steps. A normal error of variance 1 is added to every wall's 1 + B
    (f − f°), its companion; given the companions, f has a normal distribution of precision Bᵀ B + W
    around a point that one solve gives, truncated by the walls: a harmonic path of a quarter
    oscillation draws from it. Without a measurement this gives uniform states.
    """
    rows, times = rows or billiard.room_for_rows(polytope.count), np.array([_TIME])
    pulls = np.tile(polytope.pull, (len(ends), 1))
    ahead: list[Any] = []

    def advance(ends: list[uniform.ChainState], left: int) -> uniform.Advance:
        if not ahead:
            drawn = [_drawn(polytope, end.rng, min(_AT_ONCE, left)) for end in ends]
            ahead.extend(zip(*(zip(*one, strict=True) for one in drawn), strict=True))
        speeds, errors = zip(*ahead.pop(0), strict=True)
        shifts = [error + end.slacks for error, end in zip(errors, ends, strict=True)]
        middles = 1.0 + polytope.moved(np.stack(shifts) - 1.0, pulls)
        paths = [(w[None], times, m[None]) for w, m in zip(speeds, middles, strict=True)]
        return uniform.follow_paths(polytope, rows, ends, paths)

    return uniform.run_chains(polytope, ends, count, _PATHS, advance)


def _drawn(polytope: Walls, rng: np.random.Generator, count: int) -> tuple[Floats, Floats]:
    """Speeds (count, walls) with covariance K, and errors (count, walls) of companions."""
    push, error = (np.empty((count, polytope.count)) for _ in range(2))
    pull = np.empty((count, polytope.pulls.shape[1]))
    for path in range(count):
        push[path], error[path] = rng.standard_normal((2, polytope.count))
        pull[path] = rng.standard_normal(pull.shape[1])
    return polytope.moved(push, (polytope.pulls @ pull.T).T), error
