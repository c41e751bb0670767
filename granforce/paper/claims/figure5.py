"""Claims about the positions of strong and of undetermined contacts (Figure 5)."""

from collections.abc import Callable, Iterator

import numpy as np
import pandas as pd

from granforce.paper.claims.groups import (
    BARELY_RIGID,
    MIDDLE,
    Groups,
    items,
    over_contacts,
    positive,
    positive_friction,
    span_text,
    within,
)
from granforce.paper.claims.verdicts import FRACTION, POSITIVE, PRL, Claim, at_each
from granforce.paper.tables import StudyTable
from granforce.types import Mask

ENRICHMENT = "share of ΔF_n > ⟨ΔF_n⟩ among the contacts with f_n > 2⟨f_n⟩, over that among all"
FROZEN_SMALL = 0.05  # μ up to which contacts with frozen surroundings are judged as at small μ


def _marked(table: StudyTable, sampler: str, measure: Callable[[Mask, Mask], float]) -> Groups:
    """{μ: [(disks, measure(strong, loose))]}, masks (N_c,) of f_n > 2⟨f_n⟩, ΔF_n > ⟨ΔF_n⟩."""

    def measured(contacts: pd.DataFrame) -> float:
        normal, extent = contacts["normal"].to_numpy(), contacts["extent"].to_numpy()
        return measure(normal > 2.0, extent > extent.mean())

    return positive_friction(over_contacts(table, sampler, measured))


def counts(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """Strong forces and large extents are equally frequent at μ = 0.1."""
    groups = _marked(
        table, sampler, lambda strong, loose: strong.sum() / loose.sum() if loose.any() else np.nan
    )
    yield at_each(
        "equal-counts",
        "f_n > 2⟨f_n⟩ and ΔF_n > ⟨ΔF_n⟩ hold for about equally many contacts (μ = 0.1)",
        "number of contacts with f_n > 2⟨f_n⟩ over that with ΔF_n > ⟨ΔF_n⟩",
        within(groups, (0.1, 0.1)),
        good=(0.8, 1.25),
        fair=(0.5, 2),
        possible=POSITIVE,
    )


def enrichment(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """Strong contacts are less determined than others at intermediate μ."""
    groups = _marked(table, sampler, _enriched)
    yield at_each(
        "enrichment",
        "strong contacts are less determined at intermediate μ",
        f"{ENRICHMENT}, {span_text(MIDDLE)}",
        within(groups, MIDDLE),
        good=(1, np.inf),
        possible=POSITIVE,
    )


def patterns(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """Strong and undetermined contacts form different patterns at large μ."""
    groups = _marked(table, sampler, _enriched)
    yield at_each(
        "patterns",
        "strong contacts and those with long intervals form unrelated patterns at μ = 10",
        ENRICHMENT,
        within(groups, (10, 10)),
        good=(0.8, 1.25),
        fair=(0.5, 2),
        possible=POSITIVE,
    )


def _enriched(strong: Mask, loose: Mask) -> float:
    """Fraction of the strong contacts that are loose over that of all; NaN if there are none."""
    return loose[strong].mean() / loose.mean() if strong.any() and loose.any() else np.nan


def place(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """Indeterminacy is everywhere in a periodic packing."""
    rows = positive(table.part("exact"), "mu", "contacts")
    yield at_each(
        "everywhere",
        "with only the pressure prescribed, indeterminacy is everywhere",
        "undetermined fraction of the force-carrying contacts",
        items(rows, "undetermined_part"),
        good=(0.9, np.inf),
        fair=(0.5, np.inf),
        possible=FRACTION,
    )
    yield at_each(
        "one-cluster",
        "with only the pressure prescribed, undetermined contacts form one cluster",
        "number of clusters of undetermined contacts",
        items(positive(rows, "undetermined"), "clusters"),
        good=(-np.inf, 1.1),
        fair=(-np.inf, 2),
        possible=POSITIVE,
    )


def frozen(table: StudyTable, sampler: str) -> Iterator[Claim]:
    """In a frozen boundary indeterminacy is everywhere at small μ, and in clusters at large μ."""
    for key, claim, measured, what, span, good, fair in (
        (
            "everywhere",
            f"at μ ≤ {FROZEN_SMALL:g} contacts are undetermined everywhere",
            "undetermined fraction of the contacts inside",
            "undetermined_part",
            (0, FROZEN_SMALL),
            (0.75, np.inf),
            (0.5, np.inf),
        ),
        (
            "determined",
            f"at μ ≥ {BARELY_RIGID:g} most contacts are determined",
            "determined fraction of the contacts inside",
            "determined_part",
            (BARELY_RIGID, np.inf),
            (0.5, np.inf),
            (0.25, np.inf),
        ),
        (
            "clusters",
            f"at μ ≥ {BARELY_RIGID:g} undetermined contacts form small clusters",
            "fraction of the contacts inside that are in the largest cluster",
            "cluster_part",
            (BARELY_RIGID, np.inf),
            (-np.inf, 0.25),
            (-np.inf, 0.5),
        ),
    ):
        for part, usual in (("frozen", 400), ("frozen_large", 1600)):
            rows = positive(table.part(part), "contacts")
            rows = rows.assign(
                determined_part=1 - rows["undetermined_part"],
                cluster_part=rows["largest_cluster"] / rows["contacts"],
            )
            yield at_each(
                f"{part}-{key}",
                f"with frozen boundary forces, {claim}",
                f"{measured}, {span_text(span)}",
                within(items(rows, what), span),
                good=good,
                fair=fair,
                source=PRL,
                possible=FRACTION,
                variant=f" (N = {rows['n'].iloc[0] if len(rows) else usual})",
            )
