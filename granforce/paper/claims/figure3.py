"""Claims about where states lie (Figure 3): how far from each other, how far from the centre."""

from collections.abc import Iterator

import numpy as np

from granforce.paper.claims.groups import LEAST_DYNAMIC, drawn, dynamic, items, positive_friction
from granforce.paper.claims.verdicts import PRL, Claim, at_each
from granforce.paper.tables import Table


def pairs(table: Table, sampler: str) -> Iterator[Claim]:
    """Distances of pairs of states are sharply peaked."""
    yield at_each(
        "distances between pairs of states are sharply peaked",
        f"their standard deviation over their mean, μ ≥ {LEAST_DYNAMIC:g}",
        items(dynamic(drawn(table, sampler)), "pair_spread"),
        good=(-np.inf, 0.2),
        fair=(-np.inf, 0.35),
    )


def centre(table: Table, sampler: str) -> Iterator[Claim]:
    """The original network lies closer to the centre of S than sampled states."""
    name = "original_ratio" if sampler == "uniform" else "centre_ratio"
    rows = [
        row | {"centre_ratio": row["original_distance"] / row["mean_distance"]}
        for row in drawn(table, sampler)
        if row["dimension"] > 0 and row.get("mean_distance", 0) > 0
    ]
    yield at_each(
        "the original network lies closer to the centre than sampled states",
        "its distance over their mean distance",
        positive_friction(items(rows, name)),
        good=(-np.inf, 1),
        source=PRL,
    )
