"""Findings, one sentence each, with numbers from the study.

A finding is omitted if the study lacks one of its numbers; what the numbers do not support is said
to be undecided, or left out.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from granforce.measures import statistics
from granforce.packing.compaction import LONGEST, LONGEST_SETTLED, SETTLED_FROM
from granforce.paper.claims.figure1 import PAPERS_PEAK
from granforce.paper.claims.groups import LEAST_DYNAMIC, MIDDLE, RANGES, SAMPLERS, SMALL
from granforce.paper.claims.verdicts import CONTRADICTED, FEW, REPRODUCED, STRONGLY
from granforce.paper.findings import WORDS
from granforce.paper.formatting import between, listed, with_error
from granforce.paper.tables import StudyTable, packings_at_each
from granforce.perturb.critical_force import REACHED, Protocol
from granforce.study import kinds
from granforce.types import Floats, Rows

# Friction at which packings are compared with those of the largest friction.
USUAL = 0.1
LATE_DRAG = "prepared_late_drag"
LATER = "drag replaces inertia only when the forces are a hundred times closer to balance"
FEWEST = 5  # packings of such a mean
PREPARATION = "results-in-detail.md#dependence-on-the-preparation"
STATES = ("nearest", "gauss_seidel", "uniform")
MID = "intermediate"


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
        rows = (*claims, *findings)
        self._judged = {(row["id"], row["sampler"] or row["span"]): row for row in rows}

    def row(self, id: str, case: str = "") -> dict[str, Any]:
        """A claim by a sampler or a finding in a range of μ; its interval can be quoted."""
        row = self._judged[id, case]
        if not np.isfinite([row["value"], row["low"], row["high"]]).all() or row["verdict"] == FEW:
            raise KeyError(id)
        return row

    def ranges(self, id: str) -> list[dict[str, Any]]:
        """A finding at small, intermediate and large μ."""
        return [self.row(id, word) for word, _ in RANGES]

    def claims(self, id: str, samplers: Sequence[str]) -> dict[str, dict[str, Any]]:
        """{sampler: claim}, without those that cannot be quoted."""
        return {name: row for name in samplers for row in self.quotable(id, name)}

    def quotable(self, id: str, case: str) -> list[dict[str, Any]]:
        """The claim or finding in a list, which is empty if it cannot be quoted."""
        try:
            return [self.row(id, case)]
        except KeyError:
            return []

    def verdicts(self, id: str, samplers: Sequence[str]) -> dict[str, str]:
        """{sampler: verdict} of a claim, for samplers of the study."""
        keys = [(id, sampler) for sampler in samplers]
        return {key[1]: self._judged[key]["verdict"] for key in keys if key in self._judged}

    def packings(self, part: str) -> str:
        """How many packings a part has at each μ."""
        return packings_at_each(self.table.part(part))

    def mean(self, sampler: str, name: str, mu: float, factor: float = 1.0) -> str:
        """Mean ± standard error over packings at one μ."""
        values = factor * statistics.grouped(self.table.part(SAMPLERS[sampler]), name)[mu]
        return with_error(values)

    @property
    def frictions(self) -> list[float]:
        """All μ with exact intervals."""
        return sorted(self.table.part(SAMPLERS["exact"])["mu"].unique())


def _quoted(row: dict[str, Any]) -> str:
    return between(row["value"], row["low"], row["high"])


def _maximum(of: _Numbers) -> Highlight:
    place = of.row("exact-peak")
    turns = of.row("eta3-turns", "exact")["verdict"] == REPRODUCED
    within = MIDDLE[0] <= place["low"] and place["high"] <= MIDDLE[1]
    middle = "at intermediate friction"
    if not turns:
        first = f"Whether the exact intervals are longest {middle} is undecided"
    elif within:
        first = f"The exact intervals are longest {middle}"
    else:
        first = "The exact intervals are longest at one friction coefficient"
    step = (
        f"Packings at μ < {SETTLED_FROM:g} are compressed with a longer time step ({LONGEST:g}) "
        f"than others ({LONGEST_SETTLED:g}); with {LONGEST:g} throughout, this maximum would be at "
        "larger μ ([limits](#limits))."
        if place["low"] <= SETTLED_FROM <= place["high"]
        else ""
    )
    lengths = of.claims("extent-peak", ["exact"]).values()
    also = "".join(f" and ⟨ΔF_n⟩/⟨f_n⟩ at {_quoted(row)}" for row in lengths)
    return Highlight(
        f"{first}: exact η3 is largest at μ = {_quoted(place)}{also}; the paper finds η1, "
        f"η2 and η3 to be largest near {PAPERS_PEAK:g}.",
        "samplers",
        "exact-intervals",
        step,
    )


def _rising_eta2(of: _Numbers) -> Highlight:
    """Whether η2 of sampled networks has a maximum, too."""
    verdicts = of.verdicts("eta2-turns", STATES)
    names = {
        word: listed([WORDS[name] for name in verdicts if chosen(verdicts[name])])
        for word, chosen in (
            ("does", lambda verdict: verdict == REPRODUCED),
            ("does not", lambda verdict: verdict in (CONTRADICTED, STRONGLY)),
            ("undecided", lambda verdict: verdict not in (REPRODUCED, CONTRADICTED, STRONGLY)),
        )
        if any(map(chosen, verdicts.values()))
    }
    if "does" not in names:
        raise KeyError("η2")
    rest = {
        "does not": "; for {} it does not",
        "undecided": "; for {} this is undecided",
    }
    others = "".join(rest[word].format(known) for word, known in names.items() if word in rest)
    return Highlight(
        f"With the default preparation, η2 also has a maximum: as μ grows, it rises and then falls "
        f"for {names['does']}{others}.",
        "samplers",
        "measures",
        _later_eta2(of),
    )


def _free_forces(of: _Numbers) -> Highlight:
    most = of.frictions[-1]
    dimensions = statistics.grouped(of.table.part(SAMPLERS["exact"]), "dimension")
    if 2 * dimensions[most].mean() > dimensions[USUAL].mean():
        raise KeyError("dimension")
    return Highlight(
        f"S loses most of its dimensions as friction grows: for {of.table.plan['n']} disks, it has "
        f"{of.mean('exact', 'dimension', USUAL)} at μ = {USUAL:g}, but only "
        f"{of.mean('exact', 'dimension', most)} at μ = {most:g}.",
        "",
        "ensemble",
        _later_drag(of, most),
    )


def _later_drag(of: _Numbers, mu: float) -> str:
    """How many dimensions S has if inertia acts for longer, if the study knows; else nothing."""
    pairs = _later(of, "exact", f"{LATE_DRAG}_exact", "dimension").get(mu)
    if pairs is None:
        return ""
    usual, late = pairs.T
    return (
        f"The number at μ = {mu:g} depends on how packings are brought to rest: for {len(late)} of "
        f"these packings, it is {with_error(usual)}, and {with_error(late)} if {LATER} "
        f"([table]({PREPARATION}))."
    )


def _later_eta2(of: _Numbers) -> str:
    """Largest and last mean η2 beyond intermediate μ if inertia acts for longer, if known."""
    known = {
        mu: pairs[:, 1]
        for mu, pairs in _later(of, "nearest", LATE_DRAG, "eta2").items()
        if mu > MIDDLE[1]
    }
    if not known:
        return ""
    usual = statistics.grouped(of.table.part(SAMPLERS["nearest"]), "eta2")
    most = max(usual.values(), key=np.mean)
    shown = sorted({max(known, key=lambda mu: known[mu].mean()), max(known)})
    quoted = listed([f"{with_error(known[mu])} at μ = {mu:g}" for mu in shown])
    _, least, _ = statistics.difference_interval(most, known[max(known)])
    return (
        f"If {LATER}, the fall is {'smaller' if least > 0 else 'not significant'}: η2 of "
        f"{WORDS['nearest']} is then {quoted}; by default its maximum is {with_error(most)}."
    )


def _later(of: _Numbers, sampler: str, part: str, name: str) -> dict[float, Floats]:
    """{μ: a number by default and with late drag, in the same packings}, for FEWEST or more."""
    pairs = statistics.paired(of.table.part(SAMPLERS[sampler]), of.table.part(part))
    names = [name, f"{name}_other"]
    known = pairs.dropna(subset=names).groupby("mu")[names]
    return {mu: group.to_numpy() for mu, group in known if len(group) >= FEWEST}


def _coverage(of: _Numbers) -> Highlight:
    ratios = {name: of.quotable(f"coverage-{name}".replace("_", "-"), MID) for name in STATES}
    covered = [(name, row) for name, rows in ratios.items() for row in rows if row["high"] < 1]
    if not covered:
        raise KeyError("coverage")
    quoted = listed([f"{_quoted(row)} for {WORDS[name]}" for name, row in covered])
    return Highlight(
        f"At intermediate friction, {of.table.plan['states']} networks show only part of the "
        f"intervals: their η3 divided by the exact η3 is, averaged over these μ, {quoted}.",
        "samplers",
        "exact-intervals",
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
        f"{first}, {second}: at intermediate μ, the force f_n of a contact in the original network "
        f"has a correlation of {_quoted(absolute)} with the exact ΔF_n, and a rank correlation of "
        f"{_quoted(relative)} with ΔF_n/f_n.",
        "figure6_exact",
        "measures",
    )


def _wider(of: _Numbers) -> Highlight:
    middle, small = of.row("walk-ratio", MID), of.row("walk-ratio", "small")
    if min(middle["low"], small["low"]) <= 1:
        raise KeyError("walk-ratio")
    return Highlight(
        f"{_sentence(WORDS['nearest'])} does not sample S uniformly: its networks are "
        f"{_quoted(middle)} times as far from the centre of S as {WORDS['uniform']} at "
        f"intermediate μ, and {_quoted(small)} times as far at small μ.",
        "distances",
        "uniform-sampling",
    )


def _sentence(words: str) -> str:
    return words[0].upper() + words[1:]


def _alike(of: _Numbers) -> Highlight:
    constant = {f"η{k}": of.row(f"eta{k}-eta3-constant", "nearest") for k in (1, 2)}
    does = [name for name, row in constant.items() if row["verdict"] == REPRODUCED]
    does_not = [
        name for name, row in constant.items() if row["verdict"] in (CONTRADICTED, STRONGLY)
    ]
    if len(does) == 2:
        first = "η1 and η2 are nearly proportional to η3"
    elif does and does_not:
        first = f"{does[0]} is nearly proportional to η3, but {does_not[0]} is not"
    elif does_not:
        first = "η1, η2 and η3 are not all proportional to each other"
    else:
        first = "it is undecided whether η1, η2 and η3 are proportional to each other"
    texts = listed(
        [f"{name}/η3 varies by a factor of {_quoted(row)}" for name, row in constant.items()]
    )
    return Highlight(
        f"For {WORDS['nearest']}, {first}: at μ ≥ {LEAST_DYNAMIC:g}, {texts}.",
        "figure1_exact",
        "measures",
    )


def _critical(of: _Numbers) -> Highlight:
    small, middle, large = of.ranges("part-of-load")
    if middle["high"] >= 1:
        raise KeyError("part-of-load")
    far = middle["high"] < small["low"] and large["high"] < small["low"]
    first = (
        "At intermediate and large friction, a packing moves before the push reaches its limit load"
        if far
        else "At intermediate friction, a packing moves before the push reaches its limit load"
    )
    return Highlight(
        f"{first}: the mean critical force is {_quoted(middle)} of the mean limit load at "
        f"intermediate μ ({_from_to(of)}) and {_quoted(large)} at large μ; at small μ, it is "
        f"{_quoted(small)}.{_error(of)}",
        "figure2_limit",
        "local-perturbation",
    )


def _from_to(of: _Numbers) -> str:
    """F_crit over the limit load at both ends of intermediate μ."""
    forces, loads = (
        statistics.grouped(of.table.part("response"), name)
        for name in ("critical_force", "limit_load")
    )
    ends = [mu for mu in sorted(forces) if MIDDLE[0] <= mu <= MIDDLE[1]]
    ratios = [f"{forces[mu].mean() / loads[mu].mean():.2f} at {mu:g}" for mu in (ends[0], ends[-1])]
    return " to ".join(ratios)


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
        f" There, the mean difference is {apart:.2g} ⟨f_n⟩, and the error of F_crit near the limit "
        f"load is {least:g} ⟨f_n⟩, {word}."
    )


def _stability(of: _Numbers) -> Highlight:
    words = {"exact": "the exact η3", **{name: f"η2 of {WORDS[name]}" for name in STATES}}
    rows = of.claims("critical-force-rises", list(words))
    rising = {name: row for name, row in rows.items() if row["low"] > 0}
    falling = {name: row for name, row in rows.items() if row["high"] < 0}
    others = [words[name] for name, row in rows.items() if row["low"] <= 0 <= row["high"]]
    if not rising:
        raise KeyError("critical-force-rises")
    named = listed([f"with {words[name]}" for name in rising])
    significant = (rising | falling).items()
    texts = listed([f"{_quoted(row)} with {words[name]}" for name, row in significant])
    rest = f"; with {listed(others)}, it is not significant" if others else ""
    judged = next(iter(rising.values()))["good"].replace("…", "to")
    closely = all(row["verdict"] == REPRODUCED for row in rising.values())
    first = (
        f"The critical force rises {named}"
        if closely
        else "The critical force rises with η only moderately, if at all"
    )
    return Highlight(
        f"{first}: over all μ > 0, its rank correlation is {texts}{rest}.",
        "figure2",
        "local-perturbation",
        "We call the claim that F_crit rises with η reproduced if the rank correlation is "
        f"{judged}.",
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
        f"small, {_quoted(middle)} ⟨f_n⟩ at intermediate and {_quoted(large)} ⟨f_n⟩ at large μ.",
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
    *(_maximum, _free_forces, _coverage, _strong, _critical, _rising_eta2, _wider, _alike),
    *(_stability, _shear, _volume, _size),
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
