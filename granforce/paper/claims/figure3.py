"""Claims about the positions of states (Figure 3): distances between them, and from the centre."""

from collections.abc import Iterator

import numpy as np

from granforce.measures import statistics
from granforce.paper.claims.groups import (
    DETERMINED,
    LEAST_DYNAMIC,
    SAMPLERS,
    Groups,
    drawn,
    dynamic,
    items,
    may_be_judged,
    positive_friction,
    within,
)
from granforce.paper.claims.verdicts import CORRELATION, POSITIVE, PRL, Claim, at_each, turns
from granforce.paper.tables import StudyTable


def pairs(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """Distances of pairs of states are sharply peaked."""
    yield at_each(
        "distances between pairs of networks are sharply peaked",
        f"standard deviation of the distances over their mean, μ ≥ {LEAST_DYNAMIC:g}",
        items(dynamic(drawn(table, sampler)), "pair_spread"),
        good=(-np.inf, 0.2),
        fair=(-np.inf, 0.35),
        possible=POSITIVE,
    )


def relative(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """Weak contacts can change most relative to their force, and most at intermediate μ."""
    ratios, ranks = relative_extents(table, sampler)
    yield turns("ΔF_n/F_orig, the relative extent of a contact, is not monotonic in μ", ratios)
    yield at_each(
        "weak contacts have the largest relative extents ΔF_n/F_orig",
        f"rank correlation of ΔF_n/F_orig with F_orig over contacts, μ ≥ {LEAST_DYNAMIC:g}",
        within(ranks, (LEAST_DYNAMIC, np.inf)),
        good=(-np.inf, -0.3),
        fair=(-np.inf, 0),
        possible=CORRELATION,
    )


def relative_extents(table: StudyTable, sampler: str) -> tuple[Groups, Groups]:
    """Median ΔF_n/F_orig over contacts, and its rank correlation with F_orig, by μ > 0."""
    judged = may_be_judged(table, sampler)
    ratios: Groups = {}
    ranks: Groups = {}
    for row, _, normal, _, extent in table.contacts(SAMPLERS[sampler]):
        carries = normal > DETERMINED
        if judged(row) and row["mu"] > 0 and carries.sum() > 2 and extent.mean() > DETERMINED:
            ratio = extent[carries] / normal[carries]
            ratios.setdefault(row["mu"], []).append((row["n"], float(np.median(ratio))))
            rank = statistics.rank_correlation(normal[carries], ratio)
            ranks.setdefault(row["mu"], []).append((row["n"], rank))
    return dict(sorted(ratios.items())), dict(sorted(ranks.items()))


def centre(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """The original network lies closer to the centre of S than sampled states."""
    name = "original_ratio" if sampler == "uniform" else "centre_ratio"
    rows = [
        row | {"centre_ratio": row["original_distance"] / row["mean_distance"]}
        for row in drawn(table, sampler)
        if row["dimension"] > 0 and row.get("mean_distance", 0) > 0
    ]
    yield at_each(
        "the original network lies closer to the centre than sampled ones",
        "distance of the original network from the centre over the mean of the others",
        positive_friction(items(rows, name)),
        good=(-np.inf, 1),
        source=PRL,
        possible=POSITIVE,
    )
