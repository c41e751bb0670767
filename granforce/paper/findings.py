"""Beyond the paper: dependence of its results on sampler, solver and definition.

Numbers with 95 % confidence intervals over packings, without a verdict; ratios are from the same
packing. They explain why a claim holds or fails. A number for a range of μ is the mean of the means
at its μ, so that its error has no part of the trend with μ; for other numbers see `_trend` and
`_finding`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from granforce.measures import statistics
from granforce.paper.claims.contacts import relative_extents
from granforce.paper.claims.groups import RANGES, items, positive, rows_of
from granforce.paper.claims.verdicts import peak, slope
from granforce.paper.tables import StudyTable

Values = Mapping[float, Any]  # {μ: a number of each packing}
WORDS = {
    "gauss_seidel": "the paper's walk",
    "nearest": "the nearest-network walk",
    "uniform": "uniform networks",
}
WALKS = ("nearest", "gauss_seidel")
LONGER = {"gauss_seidel": "repeat_sweeps_long", "nearest": "repeat_walk_long"}
# Below 10⁻⁴ η is proportional to μ; packings are made by contact dynamics from 10⁻³ on.
DECADES = ((1e-5, 1e-4), (1e-4, 1e-3), (1e-3, 1e-2))


class Finding(NamedTuple):
    """A number of ours with its interval, NaN if unknown."""

    id: str  # the same at all ranges of μ
    statement: str
    value: float
    low: float
    high: float
    span: str = ""  # word of RANGES, if it has one value for each
    topic: str = ""


def all_findings(table: StudyTable) -> list[Finding]:
    """All findings about a `tables.StudyTable`, without those that lack data."""
    return [
        finding._replace(topic=topic)
        for topic, families in TOPICS.items()
        for family in families
        for finding in family(table)
    ]


def sampled_part(table: StudyTable) -> Iterator[Finding]:
    """The fraction of the exact extent that sampled states see."""
    for sampler in (*WALKS, "uniform"):
        ratios = _ratios(rows_of(table, sampler), table.part("exact"), "eta3")
        yield from _by_range(f"coverage-{sampler}", ratios, f"η3 of {WORDS[sampler]} over exact η3")
    for sampler, part in LONGER.items():
        ratios = _ratios(table.part(part), rows_of(table, sampler), "eta3")
        if ratios:
            statement = f"η3 of {WORDS[sampler]} if four times as long, over that of the usual one"
            frictions = ", ".join(f"{mu:g}" for mu in ratios)
            interval = statistics.stratified_interval(ratios.values())
            yield _measured(f"longer-{sampler}", f"{statement}, μ = {frictions}", interval)


def measure(table: StudyTable) -> Iterator[Finding]:
    """The difference between the walks' measures and the uniform one."""
    for name, label in (("eta1", "η1"), ("eta2", "η2")):
        for sampler in WALKS:
            ratios = _ratios(rows_of(table, sampler), table.part("uniform"), name)
            statement = f"{label} of {WORDS[sampler]} over {label} of {WORDS['uniform']}"
            yield from _by_range(f"{name}-{sampler}", ratios, statement)
    rows = table.part("uniform").dropna(subset=["walk_ratio"])
    for name, label in (
        ("original_ratio", "the original network"),
        ("walk_ratio", WORDS["nearest"]),
    ):
        statement = f"distance of {label} from the centre over that of {WORDS['uniform']}"
        yield from _by_range(name, statistics.grouped(rows, name), statement)


def correlations(table: StudyTable) -> Iterator[Finding]:
    """Whether strong contacts have long intervals: in absolute terms, and relative to f_n."""
    lengths = items(rows_of(table, "exact"), "correlation")
    ranks = relative_extents(table, "exact", statistics.rank_correlation)
    for id, groups, statement in (
        ("extent-correlation", lengths, "correlation of f_n with the exact ΔF_n"),
        ("relative-correlation", ranks, "rank correlation of f_n with the exact ΔF_n/f_n"),
    ):
        values = {mu: [v for _, v in group] for mu, group in groups.items()}
        yield from _by_range(id, values, statement)


def exact_shape(table: StudyTable) -> Iterator[Finding]:
    """Maximum and small-μ slope of the exact and of the uniform indeterminacy."""
    for part, name, label in (("exact", "eta3", "exact η3"), ("uniform", "eta2", "uniform η2")):
        groups = {mu: v for mu, v in statistics.grouped(table.part(part), name).items() if mu > 0}
        if len(groups) > 2:
            yield _trend(f"{part}-peak", f"μ where {label} is largest", peak, groups)
        yield from _growth(f"{part}-slope", groups, label)


def opened(table: StudyTable) -> Iterator[Finding]:
    """Growth of η with the friction of the cones alone, in frictionless packings."""
    groups = statistics.grouped(table.part("opened_exact"), "eta3")
    yield from _growth("opened-slope", groups, "exact η3, packings made at μ = 0,")


def _growth(id: str, groups: Values, label: str) -> Iterator[Finding]:
    """Slopes in the decades around the crossover."""
    for low, high in DECADES:
        few = {mu: groups[mu] for mu in groups if low <= mu <= high}
        if len(few) > 1:
            ends = f"μ = {min(few):g} … {max(few):g}"
            statement = f"slope of log {label} against log μ, {ends}"
            yield _trend(f"{id}-{low:g}", statement, slope, few)


def size(table: StudyTable) -> Iterator[Finding]:
    """Whether exact η3 depends on N."""
    rows = table.part("size_exact", "exact")
    for mu in sorted(table.part("size_exact")["mu"].unique()):
        groups = statistics.grouped(rows[rows["mu"] == mu], "eta3", "n")
        if len(groups) > 1:
            statement = f"slope of log exact η3 against log N, μ = {mu:g}"
            yield _trend(f"exact-size-{mu:g}", statement, slope, groups)


def strength(table: StudyTable) -> Iterator[Finding]:
    """The critical force relative to the limit load, and its dependence on the protocol."""
    usual = table.part("response")
    rows = positive(usual, "limit_load")
    part_of_load = rows["critical_force"] / rows["limit_load"]
    values = statistics.grouped(rows.assign(part_of_load=part_of_load), "part_of_load")
    yield from _by_range("part-of-load", values, "⟨F_crit⟩ over ⟨limit load⟩")
    for part, word in (
        ("response_long", "with 600 implicit steps over that with 150"),
        ("response_fine", "with load steps a quarter as long over that with the usual ones"),
    ):
        for name, label in (("critical_force", "⟨F_crit⟩"), ("decay_exponent", "α")):
            ratios = _ratios(table.part(part), usual, name)
            yield from _by_range(f"{name}-{part}", ratios, f"{label} {word}")
    # Loads inside and outside the pressure differ by the scale of S: F/(1 − F ℓ/2PV), 2PV = Σ f ℓ.
    pairs = positive(statistics.paired(rows, table.part("walk")), "contacts_other")
    factor = 1 / (1 - pairs["critical_force"] / pairs["contacts_other"])
    statement = "⟨F_crit⟩ with the pair excluded from the pressure over that with it included"
    values = statistics.grouped(pairs.assign(factor=factor), "factor")
    yield from _by_range("excluded-pair", values, statement)


def shear(table: StudyTable) -> Iterator[Finding]:
    """The shear stress that the contacts can carry, and the fraction that networks have."""
    rows, uniform = table.part("stress"), table.part("stress_uniform")
    groups = statistics.grouped(rows, "friction")
    if len(groups) > 2:
        statement = "μ where the largest shear stress is largest"
        yield _trend("shear-peak", statement, peak, groups)
    statement = "shear stress over pressure"
    yield from _by_range("largest-shear", groups, f"largest {statement}")
    own = statistics.grouped(rows, "own_shear")
    yield from _by_range("own-shear", own, f"{statement} of the original network")
    for some, name, word in (
        (rows, "own_shear", "shear stress of the original network"),
        (uniform, "mean_shear", "mean shear stress of uniform networks"),
        (uniform, "largest_shear", "largest shear stress in uniform networks"),
    ):
        parts = _quotients(statistics.paired(some, rows), name, "friction_other")
        statement = f"{word}, as a fraction of the largest possible"
        yield from _by_range(f"{name}-part", parts, statement)


def volume(table: StudyTable) -> Iterator[Finding]:
    """The width of S; ln V is not comparable between μ."""
    rows = table.part("volume")
    groups = statistics.grouped(rows, "extent")
    if len(groups) > 2:
        yield _trend("volume-peak", "μ where S is widest", peak, groups)
    yield from _by_range("volume-width", groups, "width of S, in ⟨f_n⟩")
    walked = statistics.paired(positive(rows, "extent"), table.part("walk"))
    for name, label in (("eta1", "η1"), ("eta2", "η2")):
        parts = _quotients(walked, "extent", f"{name}_other")
        yield from _by_range(f"volume-{name}", parts, f"width of S over {label}")
    pairs = walked[["extent", "eta2_other"]].dropna().to_numpy()
    if len(pairs) > 2:
        yield _finding(
            "volume-rank",
            "rank correlation of the width of S with η2, over packings of all μ",
            lambda some: statistics.rank_correlation(*np.transpose(some)),
            [pairs],
        )


# Topic, which takes the place of a source, → its findings.
TOPICS = {
    "Samples of S": (sampled_part, measure),
    "Lengths of intervals": (correlations,),
    "Dependence of η on μ and N": (exact_shape, opened, size),
    "Local perturbation": (strength,),
    "Shear stress": (shear,),
    "Volume of S": (volume,),
}


def _ratios(rows: pd.DataFrame, others: pd.DataFrame, name: str) -> Values:
    """{μ: ratios of one number in the same packings}, for packings with rows of both."""
    rows = rows[(rows["dimension"] > 0) & (rows["reached_part"].fillna(1) > 0)]
    return _quotients(statistics.paired(rows, others), name, f"{name}_other")


def _quotients(pairs: pd.DataFrame, above: str, below: str) -> Values:
    """{μ: one number over another}, where both exist."""
    pairs = pairs[pairs[below] != 0]
    return statistics.grouped(pairs.assign(quotient=pairs[above] / pairs[below]), "quotient")


def _by_range(id: str, groups: Values, statement: str) -> Iterator[Finding]:
    """The mean of the means at the μ of each range."""
    for word, (low, high) in RANGES:
        values = [group for mu, group in groups.items() if low <= mu <= high]
        if values:
            interval = statistics.stratified_interval(values)
            yield _measured(id, f"{statement}, {word} μ", interval)._replace(span=word)


def _trend(id: str, statement: str, statistic: Callable[..., float], groups: Values) -> Finding:
    """A number of all means over packings: statistic(keys, means).

    Its interval comes from drawn means; it has none if there is a single packing at some μ.
    """
    keys, values = np.array(list(groups), dtype=float), list(map(np.array, groups.values()))
    value = float(statistic(keys, np.array([group.mean(axis=0) for group in values])))
    if min(map(len, values)) < 2:
        return _measured(id, statement, (value, np.nan, np.nan))
    with np.errstate(invalid="ignore"):
        numbers = np.array([statistic(keys, means) for means in statistics.drawn_means(values)])
    ends = statistics.percentile_interval(numbers[np.isfinite(numbers)])
    return _measured(id, statement, (value, *ends))


def _finding(
    id: str, statement: str, statistic: Callable[..., float], groups: Sequence[Any]
) -> Finding:
    """A number of single packings, which are resampled for its interval (bootstrap)."""
    return _measured(id, statement, statistics.bootstrap(statistic, list(groups)))


def _measured(id: str, statement: str, interval: tuple[float, float, float]) -> Finding:
    return Finding(id.replace("_", "-"), statement, *interval)
