"""Which measurement next: the contact whose force would say most about all others."""

from __future__ import annotations

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
    """Contacts whose normal force is most worth measuring, the best first."""

    contacts: Integers  # (k,) their numbers in the packing
    expected: Floats  # (k,) fraction by which the mean error of f_n falls, from covariances
    before: float  # exact mean interval of f_n now, in ⟨f_n⟩; NaN if not certified
    after: Floats  # (k,) the same with f_n of that contact known; NaN also if not computed

    def _repr_html_(self) -> str:
        """The contacts as displayed in notebooks."""
        lines = {"mean interval of fₙ / ⟨fₙ⟩ now": self.before}
        for contact, after in zip(self.contacts, self.after, strict=True):
            lines[f"with fₙ of contact {contact} known"] = float(after)
        return notebook.table("Which measurement next", lines)


@takes(Ensemble, sample=UniformSample)
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
    """The k contacts whose f_n, if known, would shorten the mean interval most; an Informative.

    Based on `states` uniform states: if forces were normally distributed, a known f_n of contact c
    would leave √(1 − ρ²) of the standard deviation of another one, where ρ is their correlation.
    The best `check` contacts are then sorted by exact bounds, with f_n fixed at its mean over the
    states. sample: a UniformSample of S to use instead of new states. workers: threads;
    progress(done, total) counts the checked contacts. watch(Informative) is called before the first
    of them, with the order by covariance.

    Raises InputError if nothing is left to measure, and as `sample_uniform` does.
    """
    k, check = whole(k, "k", 1), whole(check, "check")
    if sample is None:
        sample = sample_uniform(ensemble, states, seed=seed, workers=workers)
    else:
        ensemble.refuse_foreign(sample.states, sample.residual, "the sample")
    normal, held = sample.flat[..., 0] / ensemble.force_scale, sample.flat.mean(axis=0)
    if not ensemble.admits(held):  # the states of a very thin S may be unbalanced
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
    place = np.argsort(after, kind="stable")  # contacts that were not computed come last
    order = order[place]
    return Informative(ensemble.index[order], expected[order], before, after[place])


def _expected(normal: Floats) -> Floats:
    """(N_c,) fraction by which the mean deviation of f_n (states, N_c) falls if one is known."""
    off = normal - normal.mean(axis=0)
    spread = off.std(axis=0)
    unit = np.divide(off, spread, out=np.zeros_like(off), where=spread > INTERVAL_GAP)
    correlation = np.clip(unit.T @ unit / len(unit), -1.0, 1.0)
    left = np.sqrt(1 - correlation**2)
    return np.where(spread > INTERVAL_GAP, 1 - left @ spread / max(spread.sum(), INTERVAL_GAP), 0.0)


def _mean_extent(ensemble: Ensemble, workers: int) -> float:
    """Mean exact interval of f_n, in ⟨f_n⟩; NaN if a bound has no certificate."""
    bounds = intervals(ensemble, workers=workers)
    cancelling.check("exact bounds")
    if not bounds.converged:
        return np.nan
    extent = measures.normal_extent(bounds.low, bounds.high)
    return float(extent.mean() / ensemble.force_scale)
