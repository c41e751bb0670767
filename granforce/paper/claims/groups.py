"""Data for claims: {μ: [(disks, value) of each packing]}, and the ranges of μ."""

from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from granforce.measures import statistics
from granforce.paper.tables import StudyTable
from granforce.types import Rows

Ends = tuple[float, float]  # of a range or of an interval
Groups = dict[float, list[tuple[int, Any]]]  # {μ: [(disks, value) of each packing]}

SAMPLERS = {  # parts of the table
    "gauss_seidel": "sweeps_1e-3",
    "gauss_seidel_1e-4": "sweeps_1e-4",
    "gauss_seidel_1e-6": "sweeps_1e-6",
    "nearest": "walk",
    "uniform": "uniform",
    "exact": "exact",
}
# Packings at smaller μ are finished by linear programs; those of the paper are all from dynamics.
LEAST_DYNAMIC = 0.001
SMALL, MIDDLE, LARGE = (LEAST_DYNAMIC, 0.01), (0.05, 0.3), (5, np.inf)  # ranges of μ, ends included
RANGES = (("small", SMALL), ("intermediate", MIDDLE), ("large", LARGE))
BARELY_RIGID = 0.5  # μ above which S has few dimensions
# Fraction of the requested states that a walk needs to be judged.
WHOLE_WALK = 0.3
DETERMINED = 1e-9  # ⟨f_n⟩: mean extents below this are rounding


def drawn(table: StudyTable, sampler: str) -> list[dict[str, Any]]:
    """Rows of a sampler that may be judged; see `may_be_judged`."""
    judged = may_be_judged(table, sampler)
    return [row for row in table.part(SAMPLERS[sampler]) if judged(row)]


def may_be_judged(table: StudyTable, sampler: str) -> Callable[[dict[str, Any]], bool]:
    """Whether a row has enough states, in S or close to it."""
    beyond = outside(table, SAMPLERS[sampler])
    return lambda row: enough(row) and row["mu"] not in beyond


def outside(table: StudyTable, part: str) -> list[float]:
    """The μ at which states exceed the exact intervals by more than the length of those.

    Sweeps that end early leave unbalanced networks; their differences are then not a property of S.
    """
    return [
        mu for mu, (excess, length) in excesses(table, part).items() if excess > length + DETERMINED
    ]


def excesses(table: StudyTable, part: str) -> dict[float, tuple[float, float]]:
    """{μ: (excess of the states' intervals over the exact ones, length of the exact ones)}.

    Means over components and over the packings that have both, in ⟨f_n⟩.
    """
    both = [
        {"mu": row["mu"], "excess": row["excess"], "length": exact["mean_length"]}
        for row, exact in statistics.paired(table.part(part), table.part(SAMPLERS["exact"]))
        if "excess" in row and "mean_length" in exact
    ]
    excess, length = (statistics.grouped(both, name) for name in ("excess", "length"))
    return {mu: (float(excess[mu].mean()), float(length[mu].mean())) for mu in excess}


def enough(row: dict[str, Any]) -> bool:
    """Whether a row's walk, if it has one, has enough states to be judged."""
    return row.get("reached_part", 1.0) >= WHOLE_WALK


def dynamic(rows: Rows) -> list[dict[str, Any]]:
    """Rows of packings made by contact dynamics."""
    return [row for row in rows if row["mu"] >= LEAST_DYNAMIC]


def items(
    rows: Rows, what: str | Callable[..., Any], by: str = "mu", positive: Collection[str] = ()
) -> Groups:
    """{μ: [(disks, value)]} in order of μ; what: a name, or a function of the row.

    Rows with an unknown value, or without a positive value of given names, are left out.
    """
    groups: dict[Any, Any] = {}
    for row in rows:
        if not all(row.get(name, 0) > 0 for name in positive):
            continue
        value = row.get(what, np.nan) if isinstance(what, str) else what(row)
        if np.all(np.isfinite(value)):
            groups.setdefault(row[by], []).append((row["n"], value))
    return {key: groups[key] for key in sorted(groups)}


def sampled(table: StudyTable, sampler: str) -> Groups:
    """{μ: [(disks, ΔF_n (N_c,) in ⟨f_n⟩)]} of packings with indeterminacy."""
    groups: dict[Any, Any] = {}
    judged = may_be_judged(table, sampler)
    for row, *_, extent in table.contacts(SAMPLERS[sampler]):
        if judged(row) and len(extent) and extent.mean() > DETERMINED:
            groups.setdefault(row["mu"], []).append((row["n"], extent))
    return {mu: groups[mu] for mu in sorted(groups)}


def each(groups: Groups, measure: Callable[..., Any]) -> Groups:
    """The groups with each packing's value replaced by a number."""
    return {key: [(n, measure(value)) for n, value in group] for key, group in groups.items()}


def within(groups: Groups, span: Ends) -> Groups:
    """The groups of a range of μ."""
    return {mu: group for mu, group in groups.items() if span[0] <= mu <= span[1]}


def positive_friction(groups: Groups) -> Groups:
    """The groups except that of μ = 0."""
    return {mu: group for mu, group in groups.items() if mu > 0}


def span_text(span: Ends) -> str:
    """A range of μ in words."""
    low, high = span
    if not np.isfinite(high):
        return f"μ ≥ {low:g}"
    return f"μ = {low:g} … {high:g}" if low > 0 else f"μ ≤ {high:g}"
