"""Which measurement next: the contact whose force, once known, leaves the shortest intervals, or
the grain whose pressure leaves the smallest errors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce import measures, notebook
from granforce.explore.intervals import intervals
from granforce.explore.uniform import UniformSample, sample_uniform
from granforce.fields import derived, record
from granforce.forces.ensemble import Ensemble
from granforce.forces.grain_pressures import grain_pressures
from granforce.forces.nearest import some_network
from granforce.quantities import Field, quantity
from granforce.records import InputError, positive, takes, whole
from granforce.system import cancelling
from granforce.tolerances import INTERVAL_GAP, LARGEST_UNIT, TWINS
from granforce.types import Cancel, Floats, Integers, Mask, Progress


@record
class Informative(NamedTuple):
    """Contacts whose normal force is most worth measuring, the best first.

    Of contacts whose normal forces determine each other only one is listed.
    """

    contacts: Annotated[Integers, quantity("backbone")]
    expected: Annotated[Floats, quantity("part_expected", label="expected_reduction")]
    before: Annotated[
        float, quantity("mean_before", label="mean_interval_before", note="NaN if not certified")
    ]
    after: Annotated[
        Floats, quantity("mean_after", label="mean_interval_after", note="NaN also if not computed")
    ]
    twins: Annotated[
        tuple[tuple[int, ...], ...], "for each: contacts whose measurement gives the same"
    ]

    @property
    @derived(Field("contact", "", "fraction by which the mean interval of f_n shortens"))
    def reduction(self) -> Floats:
        """(k,) fraction by which the mean interval shortens with f_n of that contact known."""
        return 1 - self.after / self.before

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
    """The k contacts whose f_n, if known, would shorten the mean interval most.

    The mean is over all contacts, including the measured one, whose interval vanishes. If forces
    were normally distributed, a known f_n of contact c would leave √(1 − ρ²) of the standard
    deviation of another one, where ρ is their correlation over uniform states. The best contacts
    are then sorted by exact bounds, with f_n fixed at its mean over the states. Of contacts whose
    f_n determine each other, one is listed, with the numbers of the others.

    Parameters
    ----------
    ensemble : Ensemble
        S, bounded.
    k : int, default 10
        Number of contacts to list.
    states : int, default 400
        Number of uniform states.
    seed : int, default 0
        Seed of the states.
    check : int, default 10
        How many of the best contacts get exact bounds.
    sample : UniformSample, optional
        Of S, to use instead of new states.
    workers : int, default 1
        Threads.
    watch : callable, optional
        watch(Informative) is called before the first check, with the order by covariance.
    progress : callable, optional
        progress(done, total) counts computations of all bounds, in fractions: of the present ones,
        then of those with each checked contact known.
    cancel : callable, optional
        Polled; returning True raises Cancelled.

    Returns
    -------
    Informative
        The best contact first.

    Raises
    ------
    InputError
        If nothing is left to measure, and as `sample_uniform` does.
    """
    k, check = whole(k, "k", 1), whole(check, "check")
    if sample is None:
        sample = sample_uniform(ensemble, states, seed=seed, workers=workers)
        cancelling.check("uniform sample")  # cancelling leaves it shorter
    else:
        ensemble.refuse_foreign(sample.states, sample.residual, "the sample")
    normal, held = sample.flat[..., 0] / ensemble.force_scale, sample.flat.mean(axis=0)
    if not ensemble.admits(held):  # the states of a very thin S may be unbalanced
        held = some_network(ensemble, held)
    expected, alike = _expected(normal)
    if not expected.any():
        raise InputError("nothing to measure: balance determines every force")
    order = _without_twins(np.argsort(-expected, kind="stable"), expected, alike)
    order = order[: max(k, check)]
    before, after = np.nan, np.full(len(order), np.nan)
    best = order[:check]

    def ranked(rows: Integers, after: Floats) -> Informative:
        rows = rows[:k]
        named = tuple(
            tuple(int(ensemble.index[d]) for d in np.flatnonzero(alike[c]) if d != c) for c in rows
        )
        return Informative(ensemble.index[rows], expected[rows], before, after[:k], named)

    if watch is not None:
        watch(ranked(order, after.copy()))

    def extent(S: Ensemble, number: int) -> float:
        def tell(solved: float, total: float | None) -> None:
            if progress is not None and total:
                progress(number + solved / total, 1 + len(best))

        return _mean_extent(S, workers, tell)

    if len(best):
        before = extent(ensemble, 0)
    for done, c in enumerate(best):
        after[done] = extent(ensemble.with_normal(c, held), 1 + done)
    place = np.argsort(after, kind="stable")  # contacts that were not computed come last
    return ranked(order[place], after[place])


@record
class InformativeGrains(NamedTuple):
    """Grains whose pressure is most worth measuring, the best first."""

    grains: Annotated[Integers, "(k,) positions in packing.x"]
    expected: Annotated[Floats, "(k,) expected fraction by which errors of f_n fall"]


@takes(Ensemble)
def informative_grains(
    ensemble: Ensemble, states: npt.ArrayLike, sigma: float, k: int = 10
) -> InformativeGrains:
    """The k grains whose pressure, if measured next, would reduce the errors of f_n most.

    If forces were normally distributed, a pressure with variance v measured with error σ would
    leave √(1 − ρ² v/(v + σ²)) of the error of a force, where ρ is their correlation over states.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    states : (n, N_c, 2) array
        Networks given what is known: draws.flat of an inference, or flat of a uniform sample.
    sigma : float
        Standard error σ of a pressure, force/length.
    k : int, default 10
        Number of grains to list.

    Returns
    -------
    InformativeGrains
        The best grain first; grains whose balance is left open are not among them.

    Raises
    ------
    InputError
        For σ ≤ 0 and states of another shape.
    """
    networks = ensemble.networks(states)
    if networks.ndim != 3 or len(networks) < 2:
        raise InputError(f"states must have shape (n, N_c, 2), n at least 2, got {networks.shape}")
    if np.abs(networks).max(initial=0.0) > LARGEST_UNIT * ensemble.force_scale:
        raise InputError(f"forces of states are beyond {LARGEST_UNIT:g} ⟨f_n⟩; check the unit")
    pressures = np.nan_to_num(grain_pressures(ensemble, networks))
    noise, unit = positive(sigma, "sigma", most=LARGEST_UNIT), ensemble.force_scale
    pressures, normal = (values - values.mean(axis=0) for values in (pressures, networks[..., 0]))
    spread, variance = normal.std(axis=0), pressures.var(axis=0)
    covariance = pressures.T @ normal / len(normal)
    explained = covariance**2 / (variance + noise**2)[:, None]
    left = np.sqrt(np.maximum(spread**2 - explained, 0.0)).sum(axis=1)
    expected = 1 - left / max(spread.sum(), INTERVAL_GAP * unit)
    best = np.argsort(-expected, kind="stable")[: whole(k, "k", 1)]
    best = best[variance[best] > 0]
    return InformativeGrains(best, expected[best])


def _without_twins(order: Integers, expected: Floats, alike: Mask) -> Integers:
    """The contacts of this order from which something is expected, the first of all twins only."""
    determined = np.zeros(len(alike), dtype=bool)
    kept = []
    for c in order[expected[order] > 0].tolist():
        if not determined[c]:
            kept.append(c)
            determined |= alike[c]
    return np.array(kept)


def _expected(normal: Floats) -> tuple[Floats, Mask]:
    """Of f_n (states, N_c): the gain by each contact, and which contacts determine each other.

    Gain (N_c,): the fraction by which the mean deviation falls if f_n of this contact is known.
    """
    off = normal - normal.mean(axis=0)
    spread = off.std(axis=0)
    unit = np.divide(off, spread, out=np.zeros_like(off), where=spread > INTERVAL_GAP)
    correlation = np.clip(unit.T @ unit / len(unit), -1.0, 1.0)
    left = np.sqrt(1 - correlation**2)
    part = 1 - left @ spread / max(spread.sum(), INTERVAL_GAP)
    return np.where(spread > INTERVAL_GAP, part, 0.0), np.abs(correlation) > 1 - TWINS


def _mean_extent(ensemble: Ensemble, workers: int, progress: Progress) -> float:
    """Mean exact interval of f_n, in ⟨f_n⟩; NaN if a bound has no certificate."""
    bounds = intervals(ensemble, workers=workers, progress=progress)
    cancelling.check("exact bounds")
    if not bounds.converged:
        return np.nan
    extent = measures.normal_extent(bounds.low, bounds.high)
    return float(extent.mean() / ensemble.force_scale)
