"""Findings, one sentence each, with numbers from the study.

A finding is omitted if the study lacks one of its numbers; what the numbers do not support is said
to be undecided, or left out.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from granforce.measures import statistics
from granforce.paper.claims.groups import LEAST_DYNAMIC, MIDDLE, SAMPLERS
from granforce.paper.claims.verdicts import DIFFERS, FAILED, FEW, REPRODUCED
from granforce.paper.findings import WORDS
from granforce.paper.formatting import between, listed, with_error
from granforce.paper.tables import StudyTable
from granforce.types import Rows

PEAK = "μ where exact η3 is largest"
STRONG = "correlation of f_n with the exact ΔF_n, intermediate μ"
WEAK = "rank correlation of f_n with the exact ΔF_n/f_n, intermediate μ"
# Friction at which packings are compared with those of the largest friction.
USUAL = 0.1
STATES = ("nearest", "gauss_seidel", "uniform")


class Highlight(NamedTuple):
    """A finding: its sentence, the figure that shows it and the part of the method behind it."""

    sentence: str
    figure: str  # name in data/figures
    method: str  # anchor in the method


class _Numbers:
    """The numbers quoted in sentences; KeyError for those missing from the study."""

    def __init__(self, table: StudyTable, claims: Rows, findings: Rows) -> None:
        self.table = table
        self._judged = {(row["statement"], row["sampler"]): row for row in (*claims, *findings)}

    def row(self, statement: str, sampler: str = "") -> dict[str, Any]:
        """A claim or finding with a number and an interval that is not too wide to be quoted."""
        row = self._judged[statement, sampler]
        if not np.isfinite([row["value"], row["low"], row["high"]]).all() or row["verdict"] == FEW:
            raise KeyError(statement)
        return row

    def known(self, statements: dict[str, str]) -> dict[str, dict[str, Any]]:
        """{word: finding} of {word: statement}, without those that cannot be quoted."""
        return {word: row for word, text in statements.items() for row in self._quotable(text, "")}

    def claims(self, statement: str, samplers: Sequence[str]) -> dict[str, dict[str, Any]]:
        """{sampler: claim} of one statement, without those that cannot be quoted."""
        return {name: row for name in samplers for row in self._quotable(statement, name)}

    def _quotable(self, statement: str, sampler: str) -> list[dict[str, Any]]:
        """The claim or finding in a list, which is empty if it cannot be quoted."""
        try:
            return [self.row(statement, sampler)]
        except KeyError:
            return []

    def judged(self, statement: str, sampler: str = "") -> str:
        """The value of a claim or finding with its interval."""
        return _quoted(self.row(statement, sampler))

    def verdicts(self, statement: str, samplers: Sequence[str]) -> dict[str, str]:
        """{sampler: verdict} of a claim, for samplers of the study."""
        keys = [(statement, sampler) for sampler in samplers]
        return {key[1]: self._judged[key]["verdict"] for key in keys if key in self._judged}

    def mean(self, sampler: str, name: str, mu: float, factor: float = 1.0) -> str:
        """Mean ± standard error over packings at one μ."""
        values = factor * statistics.grouped(self.table.part(SAMPLERS[sampler]), name)[mu]
        return with_error(values)

    @property
    def frictions(self) -> list[float]:
        """All μ with exact intervals."""
        return sorted({row["mu"] for row in self.table.part(SAMPLERS["exact"])})

    @property
    def peak(self) -> float:
        """The μ of the table at which exact η3 is largest."""
        extents = statistics.grouped(self.table.part(SAMPLERS["exact"]), "eta3")
        return max(extents, key=lambda mu: extents[mu].mean())


def _quoted(row: dict[str, Any]) -> str:
    return between(row["value"], row["low"], row["high"])


def _maximum(of: _Numbers) -> Highlight:
    least, most, place = LEAST_DYNAMIC, of.frictions[-1], of.row(PEAK)
    turns = of.row("η3(μ) is not monotonic", "exact")["verdict"] == REPRODUCED
    within = MIDDLE[0] <= place["low"] and place["high"] <= MIDDLE[1]
    first = (
        f"The exact intervals are longest {'at intermediate friction, ' if within else ''}at "
        f"μ = {_quoted(place)}"
        if turns
        else "Whether the exact intervals are longest at intermediate friction is undecided"
    )
    return Highlight(
        f"{first}: 0.15 η3 is {of.mean('exact', 'eta3', of.peak, 0.15)} at μ = {of.peak:g}, "
        f"compared with {of.mean('exact', 'eta3', least, 0.15)} at μ = {least:g} and "
        f"{of.mean('exact', 'eta3', most, 0.15)} at μ = {most:g}. {_others_turn(of)}",
        "samplers",
        "exact-intervals",
    )


def _others_turn(of: _Numbers) -> str:
    """Whether η2 of sampled states has a maximum, too."""
    verdicts = of.verdicts("η2(μ) is not monotonic", STATES)
    names = {
        word: listed([WORDS[name] for name in verdicts if chosen(verdicts[name])])
        for word, chosen in (
            ("does", lambda verdict: verdict == REPRODUCED),
            ("does not", lambda verdict: verdict in (DIFFERS, FAILED)),
            ("undecided", lambda verdict: verdict not in (REPRODUCED, DIFFERS, FAILED)),
        )
        if any(map(chosen, verdicts.values()))
    }
    sentences = {
        "does": "η2 also rises and falls again for {}.",
        "does not": "η2 does not for {}.",
        "undecided": "Whether η2 has such a maximum for {} is undecided.",
    }
    return " ".join(sentences[word].format(known) for word, known in names.items())


def _free_forces(of: _Numbers) -> Highlight:
    most = of.frictions[-1]
    dimensions = statistics.grouped(of.table.part(SAMPLERS["exact"]), "dimension")
    if 2 * dimensions[most].mean() > dimensions[USUAL].mean():
        raise KeyError("dimension")
    return Highlight(
        f"S loses most of its dimensions as friction grows: for {of.table.plan['n']} disks it has "
        f"{of.mean('exact', 'dimension', USUAL)} at μ = {USUAL:g} and "
        f"{of.mean('exact', 'dimension', most)} at μ = {most:g}.{_prepared(of, most)}",
        "figure1_exact",
        "ensemble",
    )


def _prepared(of: _Numbers, mu: float) -> str:
    """The range of h over ways to prepare packings, in a sentence; empty if there is only one."""
    parts = [p for p in of.table.parts() if p.startswith("prepared_") and p.endswith("_exact")]
    groups = [statistics.grouped(of.table.part(part), "dimension") for part in parts]
    means = [group[mu].mean() for group in groups if mu in group]
    if not means:
        return ""
    few = min(len(group[mu]) for group in groups if mu in group)
    return (
        f" With other compaction options, the mean over {few} packings at μ = {mu:g} ranges from "
        f"{min(means):.2g} to {max(means):.2g}."
    )


def _coverage(of: _Numbers) -> Highlight:
    ratios = of.known(
        {WORDS[name]: f"η3 of {WORDS[name]} over exact η3, intermediate μ" for name in STATES}
    )
    covered = {word: row for word, row in ratios.items() if row["high"] < 1}
    if not covered:
        raise KeyError("coverage")
    quoted = listed([f"{_quoted(row)} for {word}" for word, row in covered.items()])
    return Highlight(
        f"{of.table.plan['states']} networks show only part of each interval: at intermediate μ, "
        f"the ratio of their η3 to the exact one is {quoted}.",
        "samplers",
        "exact-intervals",
    )


def _strong(of: _Numbers) -> Highlight:
    absolute, relative = of.row(STRONG), of.row(WEAK)
    first = (
        "Strong contacts have longer intervals than weak ones"
        if absolute["low"] > 0
        else "Whether strong contacts have longer intervals is undecided"
    )
    second = (
        "relative to their force, their intervals are shorter"
        if relative["high"] < 0
        else "whether they are shorter relative to the force is undecided"
    )
    return Highlight(
        f"{first}: at intermediate μ, the correlation of f_n with the exact ΔF_n is "
        f"{_quoted(absolute)}. {second[0].upper()}{second[1:]}: the rank correlation of f_n with "
        f"ΔF_n/f_n is {_quoted(relative)}.",
        "figure6_exact",
        "measures",
    )


def _wider(of: _Numbers) -> Highlight:
    base = f"distance of {WORDS['nearest']} from the centre over that of {WORDS['uniform']}"
    middle, small = of.row(f"{base}, intermediate μ"), of.row(f"{base}, small μ")
    if min(middle["low"], small["low"]) <= 1:
        raise KeyError(base)
    swept = of.known({"": f"η1 of {WORDS['gauss_seidel']} over η1 of {WORDS['uniform']}, {MID}"})
    papers = "".join(
        f" η1 of {WORDS['gauss_seidel']} is {_quoted(row)} times that of {WORDS['uniform']} at "
        "intermediate μ."
        for row in swept.values()
    )
    return Highlight(
        f"{_sentence(WORDS['nearest'])} is not uniform in S: its networks are {_quoted(middle)} "
        f"times as far from the centre as uniform ones at intermediate μ, and {_quoted(small)} "
        f"times as far at small μ.{papers}",
        "distances",
        "uniform-sampling",
    )


MID = "intermediate μ"


def _sentence(words: str) -> str:
    return words[0].upper() + words[1:]


def _alike(of: _Numbers) -> Highlight:
    claim = "η1 ≈ η2 ≈ 0.15 η3 up to a constant factor"
    verdicts, texts = set(), []
    for ratio in ("η1/η3", "η2/η3"):
        constant = of.claims(f"{claim}: {ratio} is constant", ("nearest", "gauss_seidel"))
        if not constant:
            raise KeyError(ratio)
        verdicts |= {row["verdict"] for row in constant.values()}
        values = listed(
            [
                f"{of.judged(f'{claim}: value of {ratio}', name)} for {WORDS[name]}"
                for name in constant
            ]
        )
        varies = listed([f"{row['value']:.2g}" for row in constant.values()])
        texts.append(f"{ratio} averages {values}, and varies by factors of {varies} with μ")
    if verdicts == {REPRODUCED}:
        first = "The three measures are proportional to each other"
    elif verdicts & {DIFFERS, FAILED}:
        first = "The three measures are not all proportional to each other"
    else:
        first = "Whether the three measures are proportional to each other is undecided"
    return Highlight(
        f"{first}: for μ ≥ {LEAST_DYNAMIC:g}, {'; '.join(texts)}. η2 ≈ √2 η1 follows from the "
        "definitions alone.",
        "figure1",
        "measures",
    )


def _critical(of: _Numbers) -> Highlight:
    claim = "⟨F_crit⟩ over ⟨limit load⟩, {} μ"
    small, middle, large = (of.row(claim.format(w)) for w in ("small", "intermediate", "large"))
    if middle["high"] >= 1:
        raise KeyError(claim)
    pushed = {row["contacts"] for row in of.table.responses()}
    longer = of.known(
        {
            "": "⟨F_crit⟩ with load steps of 0.4 of the remaining distance over that with 0.1 "
            "(other contacts), intermediate μ"
        }
    )
    steps = "".join(
        f" With load steps four times as long, F_crit is {_quoted(row)} times as large at "
        "intermediate μ."
        for row in longer.values()
    )
    return Highlight(
        "At intermediate friction, contacts give way below their limit loads: F_crit over the "
        f"limit load, averaged over {max(pushed):g} contacts of each packing, is {_quoted(small)} "
        f"at small, {_quoted(middle)} at intermediate and {_quoted(large)} at large μ.{steps}",
        "figure2_limit",
        "local-perturbation",
    )


def _stability(of: _Numbers) -> Highlight:
    claim = "F_crit rises with η"
    words = {"exact": "exact η3", **{name: f"η2 of {WORDS[name]}" for name in STATES}}
    rows = of.claims(claim, list(words))
    if not rows:
        raise KeyError(claim)
    texts = listed([f"{_quoted(row)} with {words[name]}" for name, row in rows.items()])
    verdicts = {row["verdict"] for row in rows.values()}
    if verdicts == {REPRODUCED}:
        first = "The critical force rises with indeterminacy"
    elif verdicts <= {DIFFERS, FAILED}:
        first = "The critical force does not follow indeterminacy closely"
    else:
        first = "The critical force is not shown to rise with every measure of indeterminacy"
    return Highlight(
        f"{first}: over all μ, its rank correlation is {texts}.", "figure2", "local-perturbation"
    )


def _shear(of: _Numbers) -> Highlight:
    base = "shear stress over pressure"
    part = of.row(f"{base} of the original network, over the largest of the packing, {MID}")
    if part["high"] >= 1:
        raise KeyError(base)
    return Highlight(
        "A packing can carry more shear stress than compaction leaves in it: at intermediate μ, "
        f"the ratio of shear stress to pressure is "
        f"{of.judged(f'{base} of the original network, {MID}')} after compaction, and can reach "
        f"{of.judged(f'largest {base}, {MID}')}.",
        "stresses",
        "stresses",
    )


def _volume(of: _Numbers) -> Highlight:
    name = "width of S per free dimension, V^(1/h)/√(2πe), in ⟨f_n⟩, {} μ"
    small, middle, large = (of.row(name.format(w)) for w in ("small", "intermediate", "large"))
    if small["high"] >= middle["low"] or middle["high"] >= large["low"]:
        raise KeyError(name)
    return Highlight(
        "S is narrower at smaller friction, although it has more dimensions: its width per free "
        f"dimension, from its volume, is {_quoted(large)} ⟨f_n⟩ at large, {_quoted(middle)} ⟨f_n⟩ "
        f"at intermediate and {_quoted(small)} ⟨f_n⟩ at small μ.",
        "volumes",
        "volume",
    )


def _size(of: _Numbers) -> Highlight:
    sizes = sorted({row["n"] for row in of.table.part("size_exact", "exact")})
    slope = of.row(f"slope of log exact η3 against log N, μ = {USUAL:g}")
    growth = (sizes[-1] / sizes[0]) ** slope["value"]
    words = "rises" if slope["low"] > 0 else "falls" if slope["high"] < 0 else ""
    first = (
        f"Exact η3 {words} with the number of disks N"
        if words
        else "Whether exact η3 depends on the number of disks N is undecided"
    )
    return Highlight(
        f"{first}: at μ = {USUAL:g}, the slope of log η3 against log N is {_quoted(slope)}, a "
        f"factor of {growth:.2g} from {sizes[0]} to {sizes[-1]} disks.",
        "sizes",
        "exact-intervals",
    )


SENTENCES: tuple[Callable[[_Numbers], Highlight], ...] = (
    *(_maximum, _free_forces, _coverage, _strong, _wider, _alike, _critical, _stability, _shear),
    *(_volume, _size),
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
