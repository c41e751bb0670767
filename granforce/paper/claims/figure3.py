"""Claims about the positions of states (Figure 3): distances between them, and from the centre."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from granforce.measures import statistics
from granforce.paper.claims.groups import (
    DETERMINED,
    LEAST_DYNAMIC,
    Groups,
    drawn,
    dynamic,
    each,
    free,
    items,
    over_contacts,
    positive,
    positive_friction,
    within,
)
from granforce.paper.claims.verdicts import CORRELATION, POSITIVE, PRL, Claim, at_each, turns
from granforce.paper.tables import StudyTable


def pairs(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """Distances of pairs of states are sharply peaked."""
    yield at_each(
        "pair-distances",
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
    statement = "ΔF_n/F_orig, the relative extent of a contact, is not monotonic in μ"
    yield turns("relative-turns", statement, ratios)
    yield at_each(
        "relative-weak",
        "weak contacts have the largest relative extents ΔF_n/F_orig",
        f"rank correlation of ΔF_n/F_orig with F_orig over contacts, μ ≥ {LEAST_DYNAMIC:g}",
        within(ranks, (LEAST_DYNAMIC, np.inf)),
        good=(-np.inf, -0.3),
        fair=(-np.inf, 0),
        possible=CORRELATION,
    )


def relative_extents(table: StudyTable, sampler: str) -> tuple[Groups, Groups]:
    """Median ΔF_n/F_orig over contacts, and its rank correlation with F_orig, by μ > 0."""
    both = positive_friction(over_contacts(table, sampler, _relative))
    return each(both, lambda pair: pair[0]), each(both, lambda pair: pair[1])


def _relative(contacts: pd.DataFrame) -> tuple[float, float]:
    """Median ΔF_n/F_orig, and its rank correlation with F_orig; NaN without indeterminacy."""
    carrying = contacts[contacts["normal"] > DETERMINED]
    if len(carrying) < 3 or not free(contacts):
        return np.nan, np.nan
    normal = carrying["normal"].to_numpy()
    ratio = carrying["extent"].to_numpy() / normal
    return float(np.median(ratio)), statistics.rank_correlation(normal, ratio)


def centre(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """The original network lies closer to the centre of S than sampled states."""
    rows = positive(drawn(table, sampler), "dimension", "mean_distance")
    ratio = rows["original_distance"] / rows["mean_distance"]
    rows = rows.assign(ratio=rows["original_ratio"] if sampler == "uniform" else ratio)
    yield at_each(
        "centre",
        "the original network lies closer to the centre than sampled ones",
        "distance of the original network from the centre over the mean of the others",
        positive_friction(items(rows, "ratio")),
        good=(-np.inf, 1),
        source=PRL,
        possible=POSITIVE,
    )
