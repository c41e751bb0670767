"""Data for claims: {μ: [(disks, value) of each packing]}, and the ranges of μ."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from granforce.measures import statistics
from granforce.paper.tables import StudyTable

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


def rows_of(table: StudyTable, sampler: str) -> pd.DataFrame:
    """Rows of a sampler that may be judged: those with enough states, in S or close to it."""
    rows = table.part(SAMPLERS[sampler])
    return rows[enough(rows) & ~rows["mu"].isin(outside(table, SAMPLERS[sampler]))]


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
    both = statistics.paired(table.part(part), table.part(SAMPLERS["exact"]))
    both = both.dropna(subset=["excess", "mean_length_other"])
    excess, length = (statistics.grouped(both, name) for name in ("excess", "mean_length_other"))
    return {mu: (float(excess[mu].mean()), float(length[mu].mean())) for mu in excess}


def enough(rows: pd.DataFrame) -> Any:
    """Which rows have a walk with enough states to be judged, or none."""
    return rows["reached_part"].fillna(1.0) >= WHOLE_WALK


def skipped(rows: pd.DataFrame) -> Any:
    """Which rows have states that are the only point of S, without any relaxation."""
    return rows["skipped_part"].fillna((rows["dimension"] == 0).astype(float)) > 0


def dynamic(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of packings made by contact dynamics."""
    return rows[rows["mu"] >= LEAST_DYNAMIC]


def positive(rows: pd.DataFrame, *names: str) -> pd.DataFrame:
    """Rows in which all these numbers are positive."""
    return rows[(rows[list(names)] > 0).all(axis=1)]


def items(rows: pd.DataFrame, *names: str, by: str = "mu") -> Groups:
    """{μ: [(disks, number)]} in order of μ, of rows that have it; an array for several names."""
    groups: Groups = {}
    known = rows[np.isfinite(rows[list(names)]).all(axis=1)]
    for key, group in known.groupby(by):
        values = group[names[0]] if len(names) == 1 else group[list(names)].to_numpy()
        groups[key] = list(zip(group["n"], values, strict=True))
    return groups


def over_contacts(
    table: StudyTable,
    sampler: str,
    measure: Callable[[pd.DataFrame], Any],
    span: Ends = (0.0, np.inf),
) -> Groups:
    """{μ: [(disks, measure(contacts))]} of packings that may be judged, without NaN.

    contacts: a table with the f_n, least f_n and ΔF_n (normal, least, extent) of each, in ⟨f_n⟩.
    """
    groups: Groups = {}
    rows = rows_of(table, sampler)
    judged = set(rows.index[rows["mu"].between(*span)])
    for row, contacts in table.contacts(SAMPLERS[sampler]):
        if row.Index in judged and len(contacts):
            value = measure(contacts)
            if np.all(np.isfinite(value)):
                groups.setdefault(row.mu, []).append((row.n, value))
    return dict(sorted(groups.items()))


def sampled(table: StudyTable, sampler: str) -> Groups:
    """{μ: [(disks, ΔF_n (N_c,) in ⟨f_n⟩)]} of packings with indeterminacy."""
    return over_contacts(
        table, sampler, lambda contacts: contacts["extent"].to_numpy() if free(contacts) else np.nan
    )


def free(contacts: pd.DataFrame) -> bool:
    """Whether the mean ΔF_n of contacts is more than rounding."""
    return bool(contacts["extent"].to_numpy().mean() > DETERMINED)


def each(groups: Groups, measure: Callable[..., Any]) -> Groups:
    """The groups with each packing's value replaced by a number."""
    return {key: [(n, measure(value)) for n, value in group] for key, group in groups.items()}


def within(groups: Groups, span: Ends) -> Groups:
    """The groups of a range of μ."""
    return {mu: group for mu, group in groups.items() if span[0] <= mu <= span[1]}


def positive_friction(groups: Groups) -> Groups:
    """The groups except that of μ = 0."""
    return {mu: group for mu, group in groups.items() if mu > 0}
