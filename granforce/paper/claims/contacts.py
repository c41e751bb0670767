"""The numbers of claims that come from samples of contacts: ΔF_n and where it is large.

Each function takes a `tables.StudyTable` and a sampler, and yields the cases of a claim.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pandas as pd

from granforce.measures import statistics
from granforce.paper.claims.groups import (
    DETERMINED,
    LEAST_DYNAMIC,
    MIDDLE,
    RANGES,
    Ends,
    Groups,
    each,
    free,
    over_contacts,
    positive_friction,
    sampled,
    within,
)
from granforce.paper.claims.numbers import beside_middle
from granforce.paper.claims.verdicts import Case, at_each, over_all, peak, turning
from granforce.paper.tables import StudyTable
from granforce.types import Floats, Mask

# Beyond this quantile a distribution has a tail, as in Figure 4.
TAIL = 0.75
PERMUTATIONS = 40


def relative_turns(table: StudyTable, sampler: str) -> Iterator[Case]:
    """The rise and fall of the median ΔF_n/F_orig."""
    medians = relative_extents(table, sampler, lambda normal, ratio: float(np.median(ratio)))
    yield from turning("", medians)


def relative_weak(table: StudyTable, sampler: str) -> Iterator[Case]:
    """Rank correlation of ΔF_n/F_orig with F_orig."""
    ranks = relative_extents(table, sampler, statistics.rank_correlation)
    yield from at_each(within(ranks, (LEAST_DYNAMIC, np.inf)))


def relative_extents(
    table: StudyTable, sampler: str, measure: Callable[[Floats, Floats], float]
) -> Groups:
    """measure(F_orig, ΔF_n/F_orig) over contacts, by μ > 0, of packings with indeterminacy."""

    def measured(contacts: pd.DataFrame) -> float:
        normal, extent = contacts["normal"].to_numpy(), contacts["extent"].to_numpy()
        carrying = normal > DETERMINED
        if carrying.sum() < 3 or not free(contacts):
            return np.nan
        return measure(normal[carrying], extent[carrying] / normal[carrying])

    return positive_friction(over_contacts(table, sampler, measured))


def shape(table: StudyTable, sampler: str) -> Iterator[Case]:
    """Departure of P(ΔF_n) from a falling density at each μ."""
    everywhere = sampled(table, sampler)
    for word, span in RANGES:
        yield from at_each(within(everywhere, span), interval=departure, span=word)


def departure(values: Sequence[Floats], level: float) -> tuple[float, float, float]:
    """Departure of all packings' values from a falling density, with its interval.

    The interval extends down to 0 if chance could produce the departure from as many values.
    """
    value, low, high = statistics.jackknife(
        lambda groups: statistics.departure(np.concatenate(groups)), values, level
    )
    if value <= statistics.chance_departure(statistics.effective_number(values), level):
        low = min(low, 0.0)
    return value, max(low, 0.0), high


def tails(table: StudyTable, sampler: str) -> Iterator[Case]:
    """The exponent b of the tail of P(ΔF_n) at each μ."""
    everywhere = sampled(table, sampler)
    for word, span in RANGES:
        yield from at_each(within(everywhere, span), interval=exponent, span=word)


def exponent(values: Sequence[Floats], level: float) -> tuple[float, float, float]:
    """The exponent b beyond the quantile TAIL with its interval, computed for log b."""

    def log_exponent(groups: Sequence[Floats]) -> float:
        return np.log(statistics.tail_exponent(np.concatenate(groups), TAIL))

    return tuple(np.exp(statistics.jackknife(log_exponent, values, level)).tolist())


def width(table: StudyTable, sampler: str) -> Iterator[Case]:
    """The μ at which the standard deviation of ΔF_n is largest."""
    groups = each(positive_friction(sampled(table, sampler)), np.std)
    yield from over_all("", peak, groups, least=3)


def elongation(table: StudyTable, sampler: str) -> Iterator[Case]:
    """std/mean of ΔF_n at small and at large μ over that at intermediate μ."""
    ratio = each(sampled(table, sampler), lambda values: values.std() / values.mean())
    yield from beside_middle(ratio, np.divide)


def _marked(
    table: StudyTable, sampler: str, measure: Callable[[Mask, Mask], float], span: Ends
) -> Groups:
    """{μ: [(disks, measure(strong, loose))]}, masks (N_c,) of f_n > 2⟨f_n⟩, ΔF_n > ⟨ΔF_n⟩."""

    def measured(contacts: pd.DataFrame) -> float:
        normal, extent = contacts["normal"].to_numpy(), contacts["extent"].to_numpy()
        strong, loose = normal > 2.0, extent > extent.mean()
        return measure(strong, loose) if strong.any() and loose.any() else np.nan

    return over_contacts(table, sampler, measured, span=span)


def counts(table: StudyTable, sampler: str) -> Iterator[Case]:
    """Number of strong contacts over that of undetermined ones at μ = 0.1."""

    def ratio(strong: Mask, loose: Mask) -> float:
        return strong.sum() / loose.sum()

    yield from at_each(_marked(table, sampler, ratio, (0.1, 0.1)))


def patterns(table: StudyTable, sampler: str) -> Iterator[Case]:
    """How far strong contacts are undetermined at μ = 10: 0 as all contacts, 1 all of them."""

    def overlap(strong: Mask, loose: Mask) -> float:
        return (loose[strong].mean() - loose.mean()) / (1 - loose.mean())

    yield from at_each(_marked(table, sampler, overlap, (10, 10)))


def origin(table: StudyTable, sampler: str) -> Iterator[Case]:
    """corr(f_n, ΔF_n) minus its mean for shuffled positions, at intermediate μ."""
    yield from at_each(over_contacts(table, sampler, beyond_place, span=MIDDLE))


def beyond_place(contacts: pd.DataFrame) -> float:
    """corr(f_n, ΔF_n) minus its mean over permutations of the positions of f_n in their intervals.

    A contact without an interval keeps its force; NaN if none has one. The permutations are always
    the same.
    """
    if len(contacts) < 2 or not free(contacts):
        return np.nan
    normal, least, extent = (contacts[name].to_numpy() for name in ("normal", "least", "extent"))
    loose = extent > DETERMINED
    place = np.tile((normal[loose] - least[loose]) / extent[loose], (PERMUTATIONS, 1))
    drawn = np.tile(normal.astype(float), (PERMUTATIONS, 1))
    shuffled = np.random.default_rng(0).permuted(place, axis=1)
    drawn[:, loose] = least[loose] + shuffled * extent[loose]
    away = extent - extent.mean()
    forces = np.vstack([normal, drawn])
    forces -= forces.mean(axis=1, keepdims=True)
    own, *others = forces @ away / np.linalg.norm(forces, axis=1) / np.linalg.norm(away)
    return float(own - np.mean(others))
