"""Which measurement next: where one more known force would tell most about all others."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from granforce import measures, notebook
from granforce.explore.intervals import intervals
from granforce.explore.uniform import UniformSample, sample_uniform
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import some_network
from granforce.records import InputError, takes, whole
from granforce.system import cancelling
from granforce.tolerances import INTERVAL_GAP
from granforce.types import Cancel, Floats, Integers, Progress


@notebook.brief
class Informative(NamedTuple):
    """Contacts whose normal force would be worth measuring, the best first."""

    contacts: Integers  # (k,) their numbers in the packing
    expected: Floats  # (k,) part by which the mean error of f_n falls, by covariance
    before: float  # exact mean interval of f_n as it is, in ⟨f_n⟩; NaN where not certified
    after: Floats  # (k,) the same once f_n of that contact is known; NaN likewise, or not computed

    def _repr_html_(self) -> str:
        """The contacts as notebooks show them."""
        lines = {"mean interval of fₙ / ⟨fₙ⟩ now": self.before}
        for contact, after in zip(self.contacts, self.after, strict=True):
            lines[f"with fₙ of contact {contact} known"] = float(after)
        return notebook.table("Which measurement next", lines)


@takes(Ensemble)
@cancelling.cancellable
def informative(
    ensemble: Ensemble,
    k: int = 10,
    *,
    states: int = 400,
    seed: int = 0,
    check: int = 10,
    sample: UniformSample | None = None,
    workers: int = 1,
    watch: Callable[..., object] | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Informative:
    """The k contacts whose f_n, once known, would shorten the mean interval most; an Informative.

    From `states` uniform states: were forces normally distributed, a known f_n of contact c would
    leave √(1 − ρ²) of the standard deviation of another one, ρ their correlation. The best `check`
    contacts are then put in order by exact bounds, with f_n held at its mean over the states.
    sample: a UniformSample of S to take in place of new states.
    workers: threads; progress(done, total) counts those. watch(Informative) is called before the
    first of them, with the order by covariance.

    Raises InputError where nothing is left to measure, and as `sample_uniform` does.
    """
    k, check = whole(k, "k", 1), whole(check, "check")
    if sample is None:
        sample = sample_uniform(ensemble, states, seed=seed, workers=workers)
    else:
        ensemble.refuse_foreign(sample.states, sample.residual, "the sample")
    normal, held = sample.flat[..., 0] / ensemble.force_scale, sample.flat.mean(axis=0)
    if not ensemble.admits(held):  # states of an S as thin as rounding may keep an unbalance
        held = some_network(ensemble, held)
    expected = _expected(normal)
    if not expected.any():
        raise InputError("nothing to measure: balance determines every force")
    order = np.argsort(-expected, kind="stable")[: min(k, int(np.sum(expected > 0)))]
    before, after = np.nan, np.full(len(order), np.nan)
    best = order[:check]
    if watch is not None:
        watch(Informative(ensemble.index[order], expected[order], before, after.copy()))
    if len(best):
        if progress is not None:
            progress(0, len(best))
        before = _mean_extent(ensemble, workers)
    for done, c in enumerate(best):
        after[done] = _mean_extent(ensemble.with_normal(c, held), workers)
        if progress is not None:
            progress(done + 1, len(best))
    place = np.argsort(after, kind="stable")  # those that were not computed come last
    order = order[place]
    return Informative(ensemble.index[order], expected[order], before, after[place])


def _expected(normal: Floats) -> Floats:
    """(N_c,) part by which the mean deviation of f_n (states, N_c) falls once one is known."""
    off = normal - normal.mean(axis=0)
    spread = off.std(axis=0)
    unit = np.divide(off, spread, out=np.zeros_like(off), where=spread > INTERVAL_GAP)
    correlation = np.clip(unit.T @ unit / len(unit), -1.0, 1.0)
    left = np.sqrt(1 - correlation**2)
    return np.where(spread > INTERVAL_GAP, 1 - left @ spread / max(spread.sum(), INTERVAL_GAP), 0.0)


def _mean_extent(ensemble: Ensemble, workers: int) -> float:
    """Mean exact interval of f_n, in ⟨f_n⟩; NaN where a bound has no certificate."""
    bounds = intervals(ensemble, workers=workers)
    cancelling.check("exact bounds")
    if not bounds.converged:
        return np.nan
    extent = measures.normal_extent(bounds.low, bounds.high)
    return float(extent.mean() / ensemble.force_scale)
