"""Claims about the correlation of a contact's force with its extent (Figure 6)."""

from collections.abc import Iterator

import numpy as np

from granforce import measures
from granforce.measures import statistics
from granforce.paper.claims.groups import (
    DETERMINED,
    LARGE,
    MIDDLE,
    SAMPLERS,
    SMALL,
    Ends,
    drawn,
    items,
    may_be_judged,
    span_text,
    within,
)
from granforce.paper.claims.verdicts import CORRELATION, FRACTION, Claim, at_each, over_all
from granforce.paper.tables import StudyTable
from granforce.types import Floats

PERMUTATIONS = 40


def correlation(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """corr(f_n, ΔF_n): significant at intermediate μ, weaker at small, vanishing at large μ."""
    rows = [row for row in drawn(table, sampler) if row["mu"] > 0]
    everywhere = items(rows, "correlation")
    scores = items(
        [row for row in rows if "correlation" in row],
        lambda row: row["correlation"] * np.sqrt(row["contacts"] - 1),
    )
    strong, none = ((0.1, np.inf), (0, np.inf)), ((-0.1, 0.1), (-0.2, 0.2))
    significant, chance = ((3, np.inf), (2, np.inf)), ((-2, 2), (-3, 3))
    for word, span, (good, fair), (limits, wider) in (
        ("is significant at intermediate", MIDDLE, strong, significant),
        ("vanishes at large", LARGE, none, chance),
    ):
        yield at_each(
            f"corr(f_n, ΔF_n) {word} μ",
            f"mean correlation, {span_text(span)}",
            within(everywhere, span),
            good=good,
            fair=fair,
            possible=CORRELATION,
        )
        yield at_each(
            f"corr(f_n, ΔF_n) {word} μ, against chance",
            "mean correlation in units of 1/√(N_c − 1), the standard deviation for shuffled f_n",
            within(scores, span),
            good=limits,
            fair=wider,
        )._replace(variant=", against chance")
    for word, span in (("small", SMALL), ("large", LARGE)):
        yield over_all(
            f"corr(f_n, ΔF_n) is weaker at {word} than at intermediate μ",
            f"mean over {span_text(span)} minus that over {span_text(MIDDLE)}",
            lambda keys, means, span=span: _mean_difference(keys, means, span),
            dict(sorted((within(everywhere, MIDDLE) | within(everywhere, span)).items())),
            good=(-np.inf, 0),
        )


def origin(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """The correlation comes from intervals alone: the position of f_n in them does not matter."""
    judged = may_be_judged(table, sampler)
    groups: dict[float, list[tuple[int, float]]] = {}
    for row, _, normal, least, extent in table.contacts(SAMPLERS[sampler]):
        if judged(row) and len(extent) > 1 and extent.mean() > DETERMINED:
            apart = beyond_place(normal, least, extent)
            if np.isfinite(apart):
                groups.setdefault(row["mu"], []).append((row["n"], apart))
    yield at_each(
        "corr(f_n, ΔF_n) at intermediate μ is of statistical origin: unchanged if the relative "
        "positions of f_n in its interval are shuffled among contacts",
        "the correlation minus its mean for shuffled positions",
        within({mu: groups[mu] for mu in sorted(groups)}, MIDDLE),
        good=(-0.1, 0.1),
        fair=(-0.2, 0.2),
    )


def beyond_place(normal: Floats, least: Floats, extent: Floats) -> float:
    """corr(f_n, ΔF_n) minus its mean over permutations of the positions of f_n in their intervals.

    normal, least, extent (N_c,): f_n, its least value, ΔF_n. A contact without an interval keeps
    its force. The permutations are always the same.
    """
    free = extent > DETERMINED
    place = (normal[free] - least[free]) / extent[free]
    rng = np.random.default_rng(0)
    drawn, others = normal.astype(float), []
    for _ in range(PERMUTATIONS):
        drawn[free] = least[free] + rng.permutation(place) * extent[free]
        others.append(measures.correlation(drawn, extent))
    return measures.correlation(normal, extent) - float(np.mean(others))


def _mean_difference(keys: Floats, means: Floats, span: Ends) -> float:
    """Mean over a range of μ minus that over intermediate μ; NaN if one is empty."""
    outer, inner = ((keys >= low) & (keys <= high) for low, high in (span, MIDDLE))
    return means[outer].mean() - means[inner].mean() if outer.any() and inner.any() else np.nan


def error_bars(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """The paper's error bars: the range over all other networks of the walk."""
    rows = [row for row in drawn(table, sampler) if np.isfinite(row.get("correlation", np.nan))]
    for word, span, test in (
        ("excludes 0 at intermediate", MIDDLE, lambda r: r["correlation_low"] > 0),
        (
            "includes 0 at large",
            LARGE,
            lambda r: r["correlation_low"] <= 0 <= r["correlation_high"],
        ),
    ):
        yield at_each(
            f"the paper's error bar of corr(f_n, ΔF_n) {word} μ",
            "fraction of packings whose error bar does",
            within(items(rows, lambda r, test=test: float(test(r))), span),
            good=(0.9, np.inf),
            fair=(0.5, np.inf),
            interval=statistics.proportion_interval,
            possible=FRACTION,
        )
