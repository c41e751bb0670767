"""Claims about the correlation of a contact's force with its extent (Figure 6)."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from granforce import measures
from granforce.measures import statistics
from granforce.paper.claims.groups import (
    DETERMINED,
    LARGE,
    MIDDLE,
    SMALL,
    Ends,
    drawn,
    free,
    items,
    over_contacts,
    positive,
    span_text,
    within,
)
from granforce.paper.claims.verdicts import CORRELATION, FRACTION, Claim, at_each, over_all
from granforce.paper.tables import StudyTable
from granforce.types import Floats

PERMUTATIONS = 40


def correlation(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """corr(f_n, ΔF_n): significant at intermediate μ, weaker at small, vanishing at large μ."""
    rows = positive(drawn(table, sampler), "mu")
    everywhere = items(rows, "correlation")
    score = rows["correlation"] * np.sqrt(rows["contacts"] - 1)
    scores = items(rows.assign(score=score), "score")
    strong, none = ((0.1, np.inf), (0, np.inf)), ((-0.1, 0.1), (-0.2, 0.2))
    significant, chance = ((3, np.inf), (2, np.inf)), ((-2, 2), (-3, 3))
    for key, word, span, (good, fair), (limits, wider) in (
        ("significant", "is significant at intermediate", MIDDLE, strong, significant),
        ("vanishes", "vanishes at large", LARGE, none, chance),
    ):
        yield at_each(
            f"correlation-{key}",
            f"corr(f_n, ΔF_n) {word} μ",
            f"mean correlation, {span_text(span)}",
            within(everywhere, span),
            good=good,
            fair=fair,
            possible=CORRELATION,
        )
        yield at_each(
            f"correlation-{key}-chance",
            f"corr(f_n, ΔF_n) {word} μ",
            "mean correlation in units of 1/√(N_c − 1), the standard deviation for shuffled f_n",
            within(scores, span),
            good=limits,
            fair=wider,
            variant=", against chance",
        )
    for word, span in (("small", SMALL), ("large", LARGE)):
        yield over_all(
            f"correlation-weaker-{word}",
            f"corr(f_n, ΔF_n) is weaker at {word} than at intermediate μ",
            f"mean over {span_text(span)} minus that over {span_text(MIDDLE)}",
            lambda keys, means, span=span: _mean_difference(keys, means, span),
            dict(sorted((within(everywhere, MIDDLE) | within(everywhere, span)).items())),
            good=(-np.inf, 0),
        )


def origin(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """The correlation comes from intervals alone: the position of f_n in them does not matter."""
    groups = over_contacts(table, sampler, beyond_place)
    yield at_each(
        "origin",
        "corr(f_n, ΔF_n) at intermediate μ is of statistical origin: unchanged if the relative "
        "positions of f_n in its interval are shuffled among contacts",
        "the correlation minus its mean for shuffled positions",
        within(groups, MIDDLE),
        good=(-0.1, 0.1),
        fair=(-0.2, 0.2),
    )


def beyond_place(contacts: pd.DataFrame) -> float:
    """corr(f_n, ΔF_n) minus its mean over permutations of the positions of f_n in their intervals.

    A contact without an interval keeps its force; NaN if none has one. The permutations are always
    the same.
    """
    if len(contacts) < 2 or not free(contacts):
        return np.nan
    normal, least, extent = (contacts[name].to_numpy() for name in ("normal", "least", "extent"))
    loose = extent > DETERMINED
    place = (normal[loose] - least[loose]) / extent[loose]
    rng = np.random.default_rng(0)
    drawn, others = normal.astype(float), []
    for _ in range(PERMUTATIONS):
        drawn[loose] = least[loose] + rng.permutation(place) * extent[loose]
        others.append(measures.correlation(drawn, extent))
    return measures.correlation(normal, extent) - float(np.mean(others))


def _mean_difference(keys: Floats, means: Floats, span: Ends) -> float:
    """Mean over a range of μ minus that over intermediate μ; NaN if one is empty."""
    outer, inner = ((keys >= low) & (keys <= high) for low, high in (span, MIDDLE))
    return means[outer].mean() - means[inner].mean() if outer.any() and inner.any() else np.nan


def error_bars(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """The paper's error bars: the range over all other networks of the walk."""
    rows = drawn(table, sampler).dropna(subset=["correlation"])
    low, high = rows["correlation_low"], rows["correlation_high"]
    for key, word, span, test in (
        ("intermediate", "excludes 0 at intermediate", MIDDLE, low > 0),
        ("large", "includes 0 at large", LARGE, (low <= 0) & (high >= 0)),
    ):
        yield at_each(
            f"error-bar-{key}",
            f"the paper's error bar of corr(f_n, ΔF_n) {word} μ",
            "fraction of packings whose error bar does",
            within(items(rows.assign(does=test.astype(float)), "does"), span),
            good=(0.9, np.inf),
            fair=(0.5, np.inf),
            interval=statistics.proportion_interval,
            possible=FRACTION,
        )
