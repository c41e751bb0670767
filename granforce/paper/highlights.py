"""Findings, one sentence each, with numbers from the study.

A finding is omitted if the study lacks one of its numbers; what the numbers do not support is said
to be undecided, or left out.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from granforce.measures import statistics
from granforce.packing.compaction import LONGEST, LONGEST_SETTLED, SETTLED_FROM
from granforce.paper.claims import LATE_DRAG
from granforce.paper.claims.groups import MIDDLE, RANGES, SAMPLERS, SMALL
from granforce.paper.claims.table import PAPERS_PEAK
from granforce.paper.claims.verdicts import REPRODUCED
from granforce.paper.findings import DECADES, WORDS
from granforce.paper.formatting import between, listed, with_error
from granforce.paper.tables import StudyTable, packings_at_each
from granforce.perturb.critical_force import REACHED, Protocol
from granforce.study import kinds
from granforce.types import Rows

# Friction at which packings are compared with those of the largest friction.
USUAL = 0.1
FEWEST = 5  # packings of a mean
STATES = ("nearest", "gauss_seidel", "uniform")
MID = "intermediate"
PREPARED = "if packings are made with the default options"


class Highlight(NamedTuple):
    """A finding: its sentence, the figure that shows it and the part of the method behind it."""

    sentence: str
    figure: str  # name in data/figures; empty if only the table shows it
    method: str  # anchor in the method
    caveat: str = ""  # further sentences, for where there is room


class _Numbers:
    """The numbers quoted in sentences; KeyError for those missing from the study."""

    def __init__(self, table: StudyTable, claims: Rows, findings: Rows) -> None:
        self.table = table
        self.claims = {claim["id"]: claim for claim in claims}
        self._findings = {(row["id"], row["span"]): row for row in findings}

    def row(self, id: str, span: str = "") -> dict[str, Any]:
        """A finding, perhaps in a range of μ; its interval can be quoted."""
        row = self._findings[id, span]
        if not np.isfinite([row["value"], row["low"], row["high"]]).all():
            raise KeyError(id)
        return row

    def ranges(self, id: str) -> list[dict[str, Any]]:
        """A finding at small, intermediate and large μ."""
        return [self.row(id, word) for word, _ in RANGES]

    def packings(self, part: str) -> str:
        """How many packings a part has at each μ."""
        return packings_at_each(self.table.part(part))

    def mean(self, part: str, name: str, mu: float) -> str:
        """Mean ± standard error over FEWEST packings or more at one μ."""
        values = statistics.grouped(self.table.part(part), name)[mu]
        if len(values) < FEWEST:
            raise KeyError(name)
        return with_error(values)


def _quoted(row: dict[str, Any]) -> str:
    return between(row["value"], row["low"], row["high"])


def _maximum(of: _Numbers) -> Highlight:
    place = of.row("exact-peak")
    turns = of.claims["turns"]["by"]["exact"]["verdict"] == REPRODUCED
    within = MIDDLE[0] <= place["low"] and place["high"] <= MIDDLE[1]
    middle = "at intermediate friction"
    if not turns:
        first = f"Whether the exact intervals are relatively longest {middle} is undecided"
    elif within:
        first = f"The exact intervals are relatively longest {middle}"
    else:
        first = "The exact intervals are relatively longest at one friction coefficient"
    step = (
        f"Packings at μ < {SETTLED_FROM:g} are compressed with a longer time step ({LONGEST:g}) "
        f"than others ({LONGEST_SETTLED:g}). With {LONGEST:g} throughout, this maximum may be at "
        "larger μ ([limits](#limits))."
        if place["low"] <= SETTLED_FROM <= place["high"]
        else ""
    )
    return Highlight(
        f"{first}: exact η3 is largest at μ = {_quoted(place)}. The paper's sampled η "
        f"peaks near {PAPERS_PEAK:g}.",
        "samplers",
        "exact-intervals",
        step,
    )


def _free_forces(of: _Numbers) -> Highlight:
    """How many dimensions S loses, in both preparations."""
    most = max(of.table.part(SAMPLERS["exact"])["mu"], default=0.0)
    dimensions = statistics.grouped(of.table.part(SAMPLERS["exact"]), "dimension")
    late = of.mean(f"{LATE_DRAG}_exact", "dimension", most)
    if 2 * dimensions[most].mean() > dimensions[USUAL].mean():
        raise KeyError("dimension")
    return Highlight(
        f"S loses most of its dimensions as friction grows: for {of.table.plan['n']} disks, it has "
        f"{of.mean('exact', 'dimension', USUAL)} at μ = {USUAL:g}, but at μ = {most:g} only "
        f"{of.mean('exact', 'dimension', most)} {PREPARED}, and {late} if drag sets in later.",
        "",
        "ensemble",
    )


def _coverage(of: _Numbers) -> Highlight:
    ratios = {name: of.row(f"coverage-{name}".replace("_", "-"), MID) for name in STATES}
    if any(row["high"] >= 1 for row in ratios.values()):
        raise KeyError("coverage")
    quoted = listed([f"{_quoted(row)} for {WORDS[name]}" for name, row in ratios.items()])
    return Highlight(
        f"At intermediate friction, {of.table.plan['states']} networks show only part of the "
        f"intervals: their η3 divided by the exact η3 is, averaged over these μ, {quoted}.",
        "samplers",
        "exact-intervals",
        "The paper says that η3 does not depend on the sampling provided that this explores the "
        "solution set. These networks do not.",
    )


def _strong(of: _Numbers) -> Highlight:
    absolute, relative = of.row("extent-correlation", MID), of.row("relative-correlation", MID)
    first = (
        "Strong contacts have longer intervals than weak ones"
        if absolute["low"] > 0
        else "Whether strong contacts have longer intervals is undecided"
    )
    second = (
        "but shorter ones relative to their force"
        if relative["high"] < 0
        else "and whether they are shorter relative to the force is undecided"
    )
    return Highlight(
        f"{first}, {second}: at intermediate μ, the force f_n with which a contact came to rest "
        f"has a correlation of {_quoted(absolute)} with the exact ΔF_n, and a rank correlation of "
        f"{_quoted(relative)} with ΔF_n/f_n.",
        "figure6_exact",
        "measures",
    )


def _critical(of: _Numbers) -> Highlight:
    small, middle, large = of.ranges("part-of-load")
    if middle["high"] >= 1:
        raise KeyError("part-of-load")
    return Highlight(
        "At intermediate friction, a packing moves before the push reaches its limit load: the "
        f"mean critical force is {_quoted(middle)} of the mean limit load at intermediate μ, "
        f"{_quoted(small)} at small μ, and {_quoted(large)} at large μ {PREPARED}.{_error(of)}",
        "figure2_limit",
        "local-perturbation",
    )


def _error(of: _Numbers) -> str:
    """Whether F_crit is the limit load at small μ; or that it is of an older protocol."""
    rows, now = of.table.part("response"), kinds.PERTURBATION.version
    versions = sorted(rows["version"].unique())
    if versions != [now]:
        words = listed([f"{version:g}" for version in versions])
        return (
            f" These critical forces are from version {words} of the protocol, whose error exceeds "
            f"that of the present version {now}, {Protocol().precision:g} ⟨f_n⟩."
        )
    rows = rows[rows["mu"].between(*SMALL)]
    apart = (rows["limit_load"] - rows["critical_force"]).mean()
    least = REACHED * Protocol().precision
    word = "so the two are equal within it" if apart <= least else "so F_crit is smaller on average"
    return (
        f" At small μ, the mean difference is {apart:.2g} ⟨f_n⟩, and the error of F_crit near "
        f"the limit load is {least:g} ⟨f_n⟩, {word}."
    )


def _proportional(of: _Numbers) -> Highlight:
    """Where η ∝ μ, and whether μ or the preparation ends it."""
    (least, most), _, (above, end) = DECADES
    slopes, opened = (
        [of.row(f"{part}-slope-{low:g}") for low, _ in DECADES] for part in ("exact", "opened")
    )
    if not slopes[0]["low"] <= 1 <= slopes[0]["high"] or slopes[-1]["high"] >= 1:
        raise KeyError("slope")
    itself = "Friction itself ends" if opened[-1]["high"] < 1 else "The preparation decides on"
    sooner = slopes[1]["high"] < opened[1]["low"]
    return Highlight(
        "Indeterminacy is proportional to friction only below about 10⁻⁴: the slope of log exact "
        f"η3 against log μ is {_quoted(slopes[0])} from μ = {least:g} to {most:g}, but "
        f"{_quoted(slopes[-1])} from {above:g} to {end:g}.",
        "opened",
        "exact-intervals",
        f"{itself} the proportionality: in packings made without friction, whose Coulomb condition "
        f"alone has these μ, the slopes are {_quoted(opened[0])} and {_quoted(opened[-1])}."
        + (
            f" It may end at smaller μ if packings are made with friction: from {most:g} to "
            f"{above:g} the slopes are {_quoted(slopes[1])} for these, and {_quoted(opened[1])} for"
            " those made without."
        )
        * sooner,
    )


def _wider(of: _Numbers) -> Highlight:
    middle, small = of.row("walk-ratio", MID), of.row("walk-ratio", "small")
    if min(middle["low"], small["low"]) <= 1:
        raise KeyError("walk-ratio")
    return Highlight(
        f"The nearest-network walk does not sample S uniformly: its networks are "
        f"{_quoted(middle)} times as far from the centre of S as {WORDS['uniform']} at "
        f"intermediate μ, and {_quoted(small)} times as far at small μ.",
        "distances",
        "uniform-sampling",
    )


def _shear(of: _Numbers) -> Highlight:
    if of.row("own-shear-part", MID)["high"] >= 1:
        raise KeyError("own-shear-part")
    return Highlight(
        "A packing can carry more shear stress than compaction leaves in it: at intermediate μ "
        f"({of.packings('stress')} packings at each), the ratio of shear stress to pressure is "
        f"{_quoted(of.row('own-shear', MID))} after compaction, and can reach "
        f"{_quoted(of.row('largest-shear', MID))}.",
        "stresses",
        "stresses",
    )


def _volume(of: _Numbers) -> Highlight:
    small, middle, large = of.ranges("volume-width")
    if small["high"] >= middle["low"] or middle["high"] >= large["low"]:
        raise KeyError("volume-width")
    return Highlight(
        "S is narrower at smaller friction, although it has more dimensions: in "
        f"{of.packings('volume')} packings at each μ, its width is {_quoted(small)} ⟨f_n⟩ at "
        f"small and {_quoted(middle)} ⟨f_n⟩ at intermediate μ, and {_quoted(large)} ⟨f_n⟩ at large "
        f"μ {PREPARED}.",
        "volumes",
        "volume",
    )


def _size(of: _Numbers) -> Highlight:
    slope = of.row(f"exact-size-{USUAL:g}")
    words = "rises" if slope["low"] > 0 else "falls" if slope["high"] < 0 else ""
    first = (
        f"Exact η3 {words} with the number of disks N"
        if words
        else "The data are too few to tell whether exact η3 depends on the number of disks N"
    )
    return Highlight(
        f"{first}: at μ = {USUAL:g}, the slope of log η3 against log N is {_quoted(slope)}.",
        "sizes",
        "exact-intervals",
    )


SENTENCES: tuple[Callable[[_Numbers], Highlight], ...] = (
    *(_maximum, _coverage, _strong, _critical, _proportional, _free_forces, _wider),
    *(_shear, _volume, _size),
)


def highlights(table: StudyTable, claims: Rows, findings: Rows) -> list[Highlight]:
    """The findings for which the study has all numbers."""
    numbers, complete = _Numbers(table, claims, findings), []
    for sentence in SENTENCES:
        try:
            complete.append(sentence(numbers))
        except KeyError:
            continue
    return complete
