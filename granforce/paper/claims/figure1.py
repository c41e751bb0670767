"""Claims about η1, η2 and η3 against μ (Figure 1), about z, and about the number of disks."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from granforce.measures import statistics
from granforce.paper.claims.groups import (
    LEAST_DYNAMIC,
    SAMPLERS,
    SMALL,
    Ends,
    Groups,
    drawn,
    dynamic,
    enough,
    items,
    outside,
    positive,
    positive_friction,
)
from granforce.paper.claims.verdicts import (
    CORRELATION,
    POSITIVE,
    PRL,
    UNMEASURED,
    Claim,
    at_each,
    over_all,
    peak,
    slope,
    turns,
)
from granforce.paper.tables import StudyTable

PEAK = "μ at the top of a parabola in log μ"
PAPERS_PEAK = 0.1  # μ at which the paper finds the largest η
# How close z must come to its limits; its whole fall is 1.
NEAR, FAIR = 0.01, 0.03
_MEASURES = (("eta1", "η1"), ("eta2", "η2"), ("eta3", "η3"))


def agreement(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """η1 ≈ η2 ≈ 0.15 η3: constant ratios over all μ, and equal within one tolerance."""
    rows = dynamic(drawn(table, sampler))
    for above, below, word, equal, factor in (
        ("eta2", "eta1", "η2/η1", "η2 ≈ η1", 1.0),
        ("eta1", "eta3", "η1/η3", "η1 ≈ 0.15 η3", 0.15),
        ("eta2", "eta3", "η2/η3", "η2 ≈ 0.15 η3", 0.15),
    ):
        known = positive(rows, above, below)
        groups = items(known.assign(log_ratio=np.log(known[above] / known[below])), "log_ratio")
        yield over_all(
            f"{above}-{below}-constant",
            f"{word} is nearly constant",
            f"largest {word} over the smallest, μ ≥ {LEAST_DYNAMIC:g}",
            lambda _, logs: np.exp(np.ptp(logs)),
            groups,
            good=(1, 1.5),
            fair=(1, 2),
            least=3,
            possible=(1, np.inf),
        )
        yield over_all(
            f"{above}-{below}-ratio",
            equal,
            f"geometric mean of {word} over μ ≥ {LEAST_DYNAMIC:g}",
            lambda _, logs: np.exp(np.mean(logs)),
            groups,
            good=(0.8 * factor, 1.2 * factor),
            fair=(factor / 1.5, 1.5 * factor),
            possible=POSITIVE,
        )


def peaked(
    id: str, statement: str, groups: Groups, what: str = PEAK, good: Ends = (0.05, 0.2)
) -> Claim:
    """A claim of the paper that a quantity grouped by μ is largest near 0.1."""
    return over_all(
        id, statement, what, peak, groups, good=good, fair=(0.02, 0.5), least=3, possible=POSITIVE
    )


def maximum(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """η(μ) is largest near μ = 0.1."""
    rows = drawn(table, sampler)
    names = (("eta3", "η3"),) if sampler == "exact" else _MEASURES
    for name, label in names:
        groups = positive_friction(items(positive(rows, name), name))
        yield turns(f"{name}-turns", f"{label}(μ) is not monotonic", groups)
        yield peaked(f"{name}-peak", f"{label}(μ) is largest near μ = {PAPERS_PEAK:g}", groups)


def _measure_of(sampler: str) -> tuple[str, str]:
    return ("eta3", "η3") if sampler == "exact" else ("eta2", "η2")


def small_friction(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """η ∝ μ at small μ; not measured in a range in which a walk leaves S at any μ."""
    name, label = _measure_of(sampler)
    beyond = [mu for mu in outside(table, SAMPLERS[sampler]) if mu > 0]
    groups = positive_friction(items(positive(drawn(table, sampler), name), name))
    for low, high, key, word in (
        (LEAST_DYNAMIC, SMALL[1], "dynamic", "packings made by contact dynamics"),
        (0, LEAST_DYNAMIC / 10, "finished", "packings finished by linear programs"),
        (0, SMALL[1], "all", "all packings"),
    ):
        left = any(low <= mu <= high for mu in beyond)
        few = {} if left else {mu: groups[mu] for mu in groups if low <= mu <= high}
        span = f", μ = {min(few):g} … {max(few):g}" if few else ""
        claim = over_all(
            f"small-friction-{key}",
            "η ∝ μ as μ → 0",
            f"slope of log {label} against log μ{span}",
            slope,
            few,
            good=(0.9, 1.1),
            fair=(0.7, 1.3),
            source=PRL,
            variant=f": {word}",
        )
        yield claim._replace(verdict=UNMEASURED) if left else claim


def vanishing(table: StudyTable, sampler: str) -> list[Claim]:
    """η vanishes at μ = 0, where S is one point: as measured, not assumed."""
    name, label = _measure_of(sampler)
    rows = table.part(SAMPLERS[sampler])
    at_rest = rows[enough(rows) & (rows["mu"] == 0)]
    measured = at_rest if sampler == "exact" else at_rest[~skipped(at_rest)]
    claim = at_each(
        "vanishing",
        "η vanishes at μ = 0 within 10⁻⁷",
        f"mean {label} at μ = 0",
        items(measured.assign(size=measured[name].abs()), "size"),
        good=(-np.inf, 1e-7),
        source=PRL,
        possible=POSITIVE,
    )
    if 0 in outside(table, SAMPLERS[sampler]):
        why = "S is one point there, and sweeps do not reach it"
        return [claim._replace(verdict=UNMEASURED, why=why)]
    if len(at_rest) and not len(measured):
        why = "S is one point there: no state was relaxed or drawn"
        return [claim._replace(verdict=UNMEASURED, why=why)]
    return [claim]


def skipped(rows: pd.DataFrame) -> Any:
    """Which rows have states that are the only point of S, without any relaxation."""
    return rows["skipped_part"].fillna((rows["dimension"] == 0).astype(float)) > 0


def measure(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """η3, from largest and smallest forces, does not depend on the sampler."""
    pairs = statistics.paired(dynamic(drawn(table, sampler)), table.part("exact"))
    pairs = positive(pairs, "eta3", "eta3_other")
    yield at_each(
        "eta3-of-samples",
        "η3 does not depend on how networks are sampled",
        f"η3 of the networks over that of the exact intervals, μ ≥ {LEAST_DYNAMIC:g}",
        items(pairs.assign(part_seen=pairs["eta3"] / pairs["eta3_other"]), "part_seen"),
        good=(0.9, 1.1),
        fair=(0.75, 1.25),
        possible=POSITIVE,
    )


# Parts with repeated walks, and with longer ones.
_AGAIN = {"gauss_seidel": "repeat_sweeps", "nearest": "repeat_walk"}


def reproducible(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """η is the same for another walk, and for a longer one, in the same packing."""
    part, first = _AGAIN[sampler], drawn(table, sampler)
    longer = table.part(f"{part}_long")
    again = table.rows[table.rows["part"].str.startswith(f"{part}_")].drop(longer.index)
    again = statistics.paired(again[enough(again)], first)[first.columns]
    known = statistics.paired(first, again[["mu", "seed"]].drop_duplicates())
    packings = pd.concat([known, again]).groupby(["mu", "seed"], as_index=False)
    scatter = packings.agg(n=("n", "first"), part=("eta2", _scatter))
    yield at_each(
        "repeated-walks",
        "η is reproducible: other walks in the same packing give the same value",
        "standard deviation of η2 over walks, relative to its mean",
        items(scatter, "part"),
        good=(-np.inf, 0.05),
        fair=(-np.inf, 0.1),
        possible=POSITIVE,
    )
    pairs = statistics.paired(longer[enough(longer)], first)
    for name, label in (("eta2", "η2"), ("eta3", "η3")):
        ratios = pairs.assign(ratio=pairs[name] / pairs[f"{name}_other"])
        yield at_each(
            f"{name}-longer-walk",
            f"{label} does not depend on the length of the walk",
            f"{label} of a walk several times as long over that of the shorter one",
            items(ratios, "ratio"),
            good=(0.95, 1.05),
            fair=(0.9, 1.1),
            possible=POSITIVE,
        )


def _scatter(values: pd.Series) -> float:
    """Standard deviation over mean."""
    return values.to_numpy().std(ddof=1) / values.to_numpy().mean()


def causes(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """Opening cones increase η, vanishing contacts decrease it: each separately."""
    opened, wide = table.part("opened_exact"), table.part("widest_exact")
    widest = opened["mu"].max()
    if len(wide):
        ends = pd.concat([opened, table.part("exact")])
        wide = pd.concat([wide, ends[ends["mu"] == widest]])
        wide = wide.assign(made=wide["packing_mu"].fillna(wide["mu"]))
    for name, statement, what, rows, by, good, fair in (
        (
            "opened-cones",
            "η rises with the μ of the Coulomb condition, in the same packings",
            "the μ of the Coulomb condition, packings made without friction",
            opened,
            "mu",
            (0.95, 1),
            (0.8, 1),
        ),
        (
            "fewer-contacts",
            "η is smaller in packings with fewer contacts, at the same μ in the Coulomb condition",
            f"the μ of preparation, μ = {widest:g} in the Coulomb condition",
            wide,
            "made" if len(wide) else "mu",
            (-1, -0.95),
            (-1, -0.8),
        ),
    ):
        yield over_all(
            name,
            statement,
            f"rank correlation of mean exact η3 with {what}",
            statistics.rank_correlation,
            items(rows, "eta3", by=by),
            good=good,
            fair=fair,
            source=PRL,
            least=3,
            possible=CORRELATION,
        )


def coordination(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """z falls from 4 towards 3."""
    sources = (table.part("exact"), table.part("walk"), drawn(table, "gauss_seidel"))
    rows = next((rows for rows in sources if len(rows)), sources[0])
    groups = items(rows, "coordination")
    ends = ({mu: groups[mu]} for mu in (min(groups), max(groups))) if groups else ({}, {})
    for group, word, limit in zip(ends, ("smallest", "largest"), (4, 3), strict=True):
        statement = f"z → {limit} at the {word} μ"
        good, fair = ((limit - near, limit + near) for near in (NEAR, FAIR))
        yield at_each(f"z-{word}", statement, "mean z at that μ", group, good=good, fair=fair)
    yield over_all(
        "z-falls",
        "z falls with μ",
        "rank correlation of mean z with μ",
        statistics.rank_correlation,
        groups,
        good=(-1, -0.95),
        fair=(-1, -0.8),
        least=3,
        possible=CORRELATION,
    )


def size(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """η hardly depends on N."""
    name, label = _measure_of(sampler)
    part = {"exact": "size_exact", "nearest": "size", "gauss_seidel": "size_sweeps"}[sampler]
    sized = table.part(part)
    for mu in sorted(sized["mu"].unique()) or (0.1, 1):
        rows = pd.concat([sized, drawn(table, sampler)]) if len(sized) else sized
        groups = items(positive(rows[rows["mu"] == mu], name), name, by="n")
        span = f", N = {min(groups)} … {max(groups)}" if groups else ""
        yield over_all(
            f"size-{mu:g}",
            "η hardly depends on N",
            f"slope of log {label} against log N{span}",
            slope,
            groups,
            good=(-0.1, 0.1),
            fair=(-0.3, 0.3),
            variant=f" (μ = {mu:g})",
        )
