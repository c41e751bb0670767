"""The study's tables in documents, written between two marks, so that no number is copied by hand.

A document contains <!-- study: NAME -->, the generated text, and <!-- end -->. Names: "measures" (η
against μ), "walks" (the paper's walk against μ), "others" and "further" (other measures at each μ),
"highlights" (findings, one sentence each), "headlines" (the first few of them), "claims" (each
claim of the paper with its verdict, and the numbers behind it), "ranges" (why a claim has its
range), "figures" (the paper's, with captions), "findings" (numbers beyond the claims), "sweeps"
(the residual of the paper's walk, and its excess over S), "preparation" (how results depend on the
packing), "resting" (how h and η3 depend on when drag sets in), "counts" (number of packings of each
kind of result), "certificates" (largest gap of the exact bounds, convergence of uniform samples).
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from granforce.measures import statistics
from granforce.paper import plan as plans
from granforce.paper.claims.groups import (
    RANGES,
    SAMPLERS,
    WHOLE_WALK,
    drawn,
    excesses,
    outside,
    positive,
    skipped,
)
from granforce.paper.claims.verdicts import DEPENDS, SYMBOLS
from granforce.paper.drawings import CAPTIONS, paper_sampler
from granforce.paper.formatting import (
    NOTHING,
    between,
    listed,
    with_error,
)
from granforce.paper.highlights import highlights
from granforce.paper.resting import resting
from granforce.paper.tables import StudyTable
from granforce.records import InputError
from granforce.system import markdown
from granforce.types import Floats, Rows

KIND = "study"

_SWEPT_EXTENT = "paper's walk 0.15 η3"
_OUTSIDE = "outside S"
_NEAR, _FAR = 0.001, 0.1  # in extents of S: from the second on, the main table gives the excess
FIGURES = "../../../data/figures"  # relative to the results page
SHOWN = (1, 2, 4, 5, 6)  # figures among the claims; the third is on the first page
TABLE = "results-in-detail.md#dependence-on-friction"  # of z, h and η
HEADLINES = 3  # highlights in the README
LISTED = 3  # cases of a claim that are listed with their numbers; of more, the one that decides
UNBROKEN = "\u00a0…\u00a0"  # of a range, in narrow columns
_HEADS = {
    "gauss_seidel": "paper's walk, to 10⁻³",
    "gauss_seidel_1e-4": "paper's walk, to 10⁻⁴",
    "gauss_seidel_1e-6": "paper's walk, to 10⁻⁶",
    "nearest": "nearest-network walk",
    "uniform": "uniform",
    "exact": "exact",
    "": "packings alone",
}
# What the parts contain whose names begin like this; see `plan`.
_CONTENTS = {
    "exact": "exact intervals",
    "walk": "nearest-network walks",
    "uniform": "uniform networks",
    "response": "critical forces and first motions",
    "response_long": "critical forces, four times as many implicit steps",
    "response_fine": "critical forces, load steps a quarter as long",
    "sweeps_": "the paper's walk",
    "prepared_": "walks and exact intervals, packings made with other options",
    "resting_": "exact intervals of small packings, drag setting in earlier or later",
    "opened": "walks and exact intervals, frictionless packings with a larger μ in the Coulomb "
    "condition",
    "widest_exact": "exact intervals, packings of smaller μ with the largest μ in the Coulomb "
    "condition",
    "stress": "stresses that the contacts can carry",
    "stress_uniform": "stresses of uniform networks",
    "frozen": "exact intervals inside a frozen boundary",
    "volume": "volume of S",
    "repeat_": "repeated and longer walks",
    "size": "nearest-network walks, other numbers of disks",
    "size_sweeps": "the paper's walk, other numbers of disks",
    "size_exact": "exact intervals, other numbers of disks",
    "tails": "uniform networks of large packings, for the distribution of f_n",
}
# Numbers that may depend on the preparation, the ending of their parts, and their names in rows.
_PREPARED = (
    ("h", "_exact", "dimension"),
    ("φ", "_exact", "packing_fraction"),
    ("exact η3", "_exact", "eta3"),
    ("η2 of the nearest-network walk", "", "eta2"),
)
# How packings are made, in words; see `plan.variations`.
_VARIANTS = {
    "": "default",
    "prepared_half_steps": "half Δt",
    "prepared_double_steps": "double Δt",
    "prepared_accuracy": "10 times the accuracy, 4 times the sweeps",
    "prepared_sweeps": "4 times the sweeps",
    "prepared_late_drag": "drag at 1/100 of the imbalance",
}


def renew(paths: Sequence[Path], table: StudyTable, claims: Rows, findings: Rows) -> None:
    """Write the study's tables, judged claims and findings into files with marks.

    claims: as `claims.judged` returns them; findings: dicts of `findings.Finding`.
    """
    known: dict[str, Callable[[], str]] = {
        "measures": lambda: measures(table),
        "walks": lambda: walks(table),
        "others": lambda: others(table),
        "further": lambda: further(table),
        "highlights": lambda: highlighted(table, claims, findings),
        "headlines": lambda: headlines(table, claims, findings),
        "claims": lambda: claim_table(claims),
        "ranges": lambda: range_table(claims),
        "figures": lambda: captioned(table),
        "sweeps": lambda: sweeps(table),
        "preparation": lambda: preparation(table),
        "resting": lambda: resting(table),
        "findings": lambda: finding_table(findings),
        "counts": lambda: counts(table),
        "certificates": lambda: certificates(table),
    }

    def text_of(path: Path, name: str) -> str:
        if name not in known:
            raise InputError(f"{path}: unknown table {name!r}; choose one of {', '.join(known)}")
        return markdown.typeset(known[name]())

    markdown.renew(paths, KIND, text_of)


def measures(table: StudyTable) -> str:
    """z, h and η against μ as a table, from the same packings in every column.

    The packings are those with exact intervals; a column with fewer of them states their number.
    """
    exact = table.part(SAMPLERS["exact"])
    columns = (
        ("z", exact, "coordination", 1.0, "{:.3f}"),
        ("h", exact, "dimension", 1.0, "{:.0f}"),
        ("exact 0.15 η3", exact, "eta3", 0.15, None),
        *(
            (f"{word} η2", _drawn_by(table, name), "eta2", 1.0, None)
            for name, word in (
                ("nearest", _HEADS["nearest"]),
                ("uniform", _HEADS["uniform"]),
                ("gauss_seidel", "paper's walk"),
            )
        ),
    )
    return _against_friction(table, columns)


def walks(table: StudyTable) -> str:
    """φ, and η of the paper's walk against μ, as a table; packings as in `measures`.

    The last column is the ratio of the two walks, packing by packing.
    """
    swept, nearest = (table.part(SAMPLERS[name]) for name in ("gauss_seidel", "nearest"))
    judged = _drawn_by(table, "gauss_seidel")
    columns = (
        ("φ", table.part(SAMPLERS["exact"]), "packing_fraction", 1.0, "{:.4f}"),
        ("paper's walk η1", judged, "eta1", 1.0, None),
        ("paper's walk η2", judged, "eta2", 1.0, None),
        (_SWEPT_EXTENT, judged, "eta3", 0.15, None),
        ("paper's walk/nearest-network walk η2", _over(swept, nearest, "eta2"), "ratio", 1.0, None),
    )
    return _against_friction(table, columns)


def _against_friction(table: StudyTable, columns: Sequence[tuple[Any, ...]]) -> str:
    """A table of columns (head, rows, name, factor, form), with a line for each μ."""
    exact = table.part(SAMPLERS["exact"])
    every = exact.groupby("mu")["seed"].unique()
    swept_part = SAMPLERS["gauss_seidel"]
    beyond, known = outside(table, swept_part), excesses(table, swept_part)
    lines = []
    for mu, seeds in every.items():
        line = [_Cell(f"{mu:g}"), _Cell(str(len(seeds)))]
        for head, rows, name, factor, form in columns:
            if mu in beyond and head.startswith("paper's walk"):
                line.append(_Cell(_OUTSIDE))
                continue
            chosen = rows[(rows["mu"] == mu) & rows["seed"].isin(seeds)]
            line.append(_cell(chosen, name, factor, form, len(seeds)))
            if head == _SWEPT_EXTENT and mu in known and known[mu][0] > _FAR * known[mu][1]:
                line[-1] = line[-1]._replace(note=f", excess {_excess(*known[mu])}")
        lines.append(line)
    return _counted(["μ", "packings", *(head for head, *_ in columns)], lines)


class _Cell(NamedTuple):
    """A mean over packings, as text."""

    text: str
    fewer: int | None = None  # the number of packings, if it is not the expected one
    note: str = ""

    def __str__(self) -> str:
        return self.text + (f" ({self.fewer})" if self.fewer else "") + self.note


def _counted(heads: list[str], lines: list[list[_Cell]]) -> str:
    """The table; a column of fewer packings, equally many in each line, says so in its head."""
    for k in range(2, len(heads)):
        fewer = {line[k].fewer for line in lines if line[k].text not in ("", _OUTSIDE)}
        if len(fewer) == 1 and None not in fewer:
            heads[k] += f" (n = {fewer.pop()})"
            for line in lines:
                line[k] = line[k]._replace(fewer=None)
    return markdown.table(heads, [list(map(str, line)) for line in lines])


def others(table: StudyTable) -> str:
    """Critical forces, decay of the first motion, and the width of S against μ, as a table.

    Means ± standard errors over packings; ratios are of the same packing.
    """
    answers = positive(table.part("response"), "limit_load")
    answers = answers.assign(part_of_load=answers["critical_force"] / answers["limit_load"])
    walk, uniform, exact = (table.part(SAMPLERS[name]) for name in ("nearest", "uniform", "exact"))
    columns = (
        ("nearest-network walk/exact η3", _over(walk, exact, "eta3"), "ratio"),
        ("uniform/exact η3", _over(uniform, exact, "eta3"), "ratio"),
        ("F_crit, ⟨f_n⟩", answers, "critical_force"),
        ("F_crit/limit load", answers, "part_of_load"),
        ("α", answers, "decay_exponent"),
        ("width of S, ⟨f_n⟩", table.part("volume"), "extent"),
    )
    return _measured_at_each(columns)


def further(table: StudyTable) -> str:
    """What `others` has no room for, as a table."""
    walk, uniform = (table.part(SAMPLERS[name]) for name in ("nearest", "uniform"))
    columns = (
        ("nearest-network walk/uniform η2", _over(walk, uniform, "eta2"), "ratio"),
        ("undetermined fraction, frozen boundary", table.part("frozen"), "undetermined_part"),
        ("largest shear stress/pressure", table.part("stress"), "friction"),
    )
    return _measured_at_each(columns)


def _measured_at_each(columns: Sequence[tuple[str, pd.DataFrame, str]]) -> str:
    """A table of columns (head, rows, name) with a line for each μ."""
    counts = [count for _, rows, _ in columns for count in rows.groupby("mu").size()]
    most = max(counts, default=0)
    lines = []
    for mu in sorted(set().union(*(rows["mu"] for _, rows, _ in columns))):
        of_mu = [rows[rows["mu"] == mu] for _, rows, _ in columns]
        cells = [
            _cell(rows, name, 1.0, None, most)
            for rows, (_, _, name) in zip(of_mu, columns, strict=True)
        ]
        if any(cell.text for cell in cells):
            lines.append([_Cell(f"{mu:g}"), _Cell(str(max(map(len, of_mu)))), *cells])
    return _counted(["μ", "packings", *(head for head, *_ in columns)], lines)


def _over(rows: pd.DataFrame, others: pd.DataFrame, name: str) -> pd.DataFrame:
    """Rows with the "ratio" of a number to that of another row of the same packing."""
    pairs = statistics.paired(rows.dropna(subset=[name]), others)
    pairs = pairs[pairs[f"{name}_other"] > NOTHING]
    return pairs.assign(ratio=pairs[name] / pairs[f"{name}_other"])


def sweeps(table: StudyTable) -> str:
    """The paper's walk by its final residual: a table with an intro.

    Sweeps per network; excess: how far the intervals of states exceed the exact ones, over the
    length of those, as means over packings; η2 over that of the nearest-network walk.
    """
    swept = [part for part in plans.SWEEPS if len(table.part(part))]
    if not swept:
        return _swept(table)
    columns: list[tuple[str, dict[float, str]]] = []
    for part in swept:
        columns.append((f"sweeps to {_power(plans.SWEEPS[part])}", _sweeps_of(table, part)))
    known = excesses(table, swept[0])
    excess = {mu: _excess(*pair) for mu, pair in known.items()}
    columns.append((f"excess, {_power(plans.SWEEPS[swept[0]])}", excess))
    if len(swept) > 1:  # for a single residual, other tables have η2
        for part in swept:
            columns.append((f"η2, {_power(plans.SWEEPS[part])}", _eta2_over_nearest(table, part)))
    frictions = sorted(table.part(*swept)["mu"].unique())
    lines = [[f"{mu:g}", *(cells.get(mu, "") for _, cells in columns)] for mu in frictions]
    return f"{_swept(table)}\n{markdown.table(['μ', *(head for head, _ in columns)], lines)}"


def _sweeps_of(table: StudyTable, part: str) -> dict[float, str]:
    """{μ: sweeps per network}."""
    every = positive(table.part(part), "mean_sweeps").groupby("mu")
    return {mu: str(_cell(rows, "mean_sweeps", 1.0, "{:.0f}", len(rows))) for mu, rows in every}


def _eta2_over_nearest(table: StudyTable, part: str) -> dict[float, str]:
    """{μ: η2 over that of the nearest-network walk in the same packings}."""
    beyond = outside(table, part)
    ratios = _over(table.part(part), table.part(SAMPLERS["nearest"]), "eta2").groupby("mu")
    cells = {mu: str(_cell(rows, "ratio", 1.0, None, len(rows))) for mu, rows in ratios}
    return cells | dict.fromkeys(beyond, _OUTSIDE)


def _swept(table: StudyTable) -> str:
    """Which residuals there are, and whether walks have all their states, in sentences."""
    swept = [part for part in plans.SWEEPS if len(table.part(part))]
    if not swept:
        return "No walk by sweeps is part of this study.\n"
    words = [_power(plans.SWEEPS[part]) for part in swept]
    text = f"Sweeps end at {listed(words)} ⟨f_n⟩; verdicts use the first. "
    rows = table.part(*plans.SWEEPS)
    if len(words) > 1:
        most = [table.part(part).groupby("mu").size().max() for part in swept]
        text += f"At each μ, there are up to {listed([str(count) for count in most])} packings. "
    if rows["reached_part"].min() >= 1:
        return (
            text + "Every walk has as many networks as requested; attempts that ended without one "
            "were repeated.\n"
        )
    where = sorted(rows["mu"][rows["reached_part"] < 1].unique())
    return (
        text + "Some walks have fewer networks than requested, at μ = "
        f"{listed([f'{mu:g}' for mu in where])}; "
        f"a walk is judged only if it has at least {100 * WHOLE_WALK:g} % of them.\n"
    )


def _power(residual: float) -> str:
    return f"10{str(round(np.log10(residual))).translate(markdown.RAISED)}"


def _excess(excess: float, length: float) -> str:
    """The excess of states over S relative to its extent; all of it if S is one point."""
    if length < NOTHING:
        return "all" if excess > NOTHING else "0"
    part = excess / length
    return f"{part:.2g}" if part >= _NEAR else f"< {_NEAR:g}"


def preparation(table: StudyTable) -> str:
    """Dependence on the preparation: a table of paired differences for each number, and a sentence.

    First the mean of the default options over all seeds of the variants; then, for each variant,
    the mean difference from the default in the same seeds, bold if it is significant although there
    are so many. z is left out, as it follows from h.
    """
    names = [part.removesuffix("_exact") for part in table.parts() if part.startswith("prepared_")]
    variants = list(dict.fromkeys(names))
    varied = table.part(*variants)[["mu", "seed"]].drop_duplicates()
    frictions = sorted(varied["mu"].unique())
    heads = ["options", *(f"μ = {mu:g}" for mu in frictions)]
    tests = len(_PREPARED) * len(variants) * len(frictions)
    text = ""
    for quantity, suffix, measure in _PREPARED:
        usual = table.part("exact" if suffix else "walk", n=table.plan["n"])
        usual = statistics.paired(usual, varied).dropna(subset=[measure])[usual.columns]
        means = statistics.grouped(usual, measure)
        lines = [
            [_VARIANTS[""], *(with_error(means[mu]) if mu in means else "" for mu in frictions)]
        ]
        for variant in variants:
            pairs = statistics.paired(table.part(variant + suffix), usual)
            pairs = pairs.assign(apart=pairs[measure] - pairs[f"{measure}_other"])
            apart = statistics.grouped(pairs, "apart")
            word = _VARIANTS.get(variant, variant.removeprefix("prepared_").replace("_", " "))
            cells = (_difference(apart[mu], tests) if mu in apart else "" for mu in frictions)
            lines.append([word, *cells])
        text += f"**{quantity}**\n\n{markdown.table(heads, lines)}\n"
    if not text:
        return text
    pairs_each = varied.groupby("mu").size()
    return (
        f"{text}Each difference is the mean over up to {pairs_each.max()} pairs of packings; it is "
        f"bold if Student's t is significant at the level 0.05, corrected for {tests} differences "
        "(Bonferroni).\n"
    )


def _difference(apart: Floats, tests: int) -> str:
    """The mean difference of some pairs with its error, bold if it is significant."""
    if len(apart) < 2:
        return ""
    text = f"{'+' if apart.mean() > 0 else ''}{with_error(apart)}"
    _, low, high = statistics.mean_interval(apart, 1 - (1 - statistics.LEVEL) / tests)
    scattered = high > low  # else there is no error to compare with
    return f"**{text}**" if scattered and (low > 0 or high < 0) else text


def headlines(table: StudyTable, claims: Rows, findings: Rows) -> str:
    """The first highlights as a list."""
    chosen = highlights(table, claims, findings)[:HEADLINES]
    return "".join(f"- {_led(one.sentence)}\n" for one in chosen)


def _led(sentence: str) -> str:
    """A highlight with its message, the words before the first colon, in bold."""
    message, colon, numbers = sentence.partition(": ")
    return f"**{message}**{colon}{numbers}" if colon else sentence


def highlighted(table: StudyTable, claims: Rows, findings: Rows) -> str:
    """All highlights as a numbered list, with caveats, and links to figures and methods."""
    return "".join(
        f"{k}. {_led(one.sentence)}{one.caveat and ' '}{one.caveat} "
        f"({_shown(one.figure)}, [method](method.md#{one.method}))\n"
        for k, one in enumerate(highlights(table, claims, findings), 1)
    )


def _shown(figure: str) -> str:
    """A link to a figure, or to the table if there is none."""
    return f"[figure]({FIGURES}/{figure}.png)" if figure else f"[table]({TABLE})"


def finding_table(findings: Rows) -> str:
    """Findings, topic by topic: those at three ranges of μ in one row, all others below."""
    topics: dict[str, list[dict[str, Any]]] = {}
    for finding in findings:
        topics.setdefault(finding["topic"], []).append(finding)
    return "\n".join(f"**{topic}**\n\n{_topic(rows)}" for topic, rows in topics.items())


def _topic(findings: Rows) -> str:
    """The findings of one topic in one or two tables."""
    ranged: dict[str, dict[str, str]] = {}
    others = []
    for finding in findings:
        statement, word, number = finding["statement"], finding["span"], _number(finding)
        if word:
            ranged.setdefault(statement.removesuffix(f", {word} μ"), {})[word] = number
        else:
            others.append([statement, number])
    words = [word for word, _ in RANGES]
    lines = [[name, *(numbers.get(word, "") for word in words)] for name, numbers in ranged.items()]
    first = markdown.table(["quantity", *(f"{word} μ" for word in words)], lines) if lines else ""
    second = markdown.table(["quantity", "value"], others) if others else ""
    return "\n".join(part for part in (first, second) if part)


def _number(finding: dict[str, Any]) -> str:
    """The value of a finding or claim with its interval, if it has one."""
    if not np.isfinite(finding["value"]):
        return ""
    return between(finding["value"], finding["low"], finding["high"], "({} … {})", range(3, 7))


def counts(table: StudyTable) -> str:
    """Numbers of disks, of μ and of packings at each μ of all parts, by content, as a table."""
    parts: dict[str, list[str]] = {}
    for part in table.parts():
        parts.setdefault(_content(part), []).append(part)
    lines = []
    for content, names in parts.items():
        rows = table.part(*names)
        made = rows.groupby(["part", "n", "mu", "packing_mu"], dropna=False)["seed"].nunique()
        frictions = rows[["mu", "packing_mu"]].drop_duplicates()
        lines.append([content, _span(rows["n"]), str(len(frictions)), _span(made)])
    return markdown.table(("content", "disks", "values of μ", "packings at each"), lines)


def _content(part: str) -> str:
    """What a part contains; the longest beginning of its name that is known."""
    begins = [name for name in _CONTENTS if part.startswith(name)]
    return _CONTENTS[max(begins, key=len)] if begins else part


def _span(numbers: Sequence[int]) -> str:
    low, high = min(numbers), max(numbers)
    return f"{low}" if low == high else f"{low} to {high}"


def _drawn_by(table: StudyTable, sampler: str) -> pd.DataFrame:
    """Rows of a sampler with drawn states, without those where S is known to be one point."""
    rows = drawn(table, sampler)
    return rows[~skipped(rows)]


def _cell(rows: pd.DataFrame, name: str, factor: float, form: str | None, expected: int) -> _Cell:
    """Mean ± standard error over rows, and their number if it is not the expected one."""
    values = factor * rows[name][np.isfinite(rows[name])].to_numpy()
    if not len(values):
        return _Cell("")
    mean = values.mean()
    text = form.format(mean) if form else with_error(values)
    return _Cell(text, None if len(values) == expected else len(values))


def certificates(table: StudyTable) -> str:
    """The largest gap of the exact bounds, and how well uniform samples converged, in sentences."""
    bounded = table.rows.dropna(subset=["max_gap"])
    if not len(bounded):
        return ""
    text = (
        f"In {len(bounded)} computations of exact intervals, each for all contacts of a packing, "
        f"the largest duality gap is {bounded['max_gap'].max():.3g} ⟨f_n⟩."
    )
    uniform = table.part(SAMPLERS["uniform"]).dropna(subset=["worst_r_hat"])
    if len(uniform):
        text += (
            f" Where S is more than one point, the {len(uniform)} uniform samples have "
            f"{table.plan['states']} networks each; over all their force components, the largest "
            f"split R̂ is {uniform['worst_r_hat'].max():.3f}, and the smallest bulk effective size "
            f"{uniform['least_bulk_size'].min():.0f}."
        )
    return text + "\n"


def claim_table(claims: Rows) -> str:
    """Each claim with its place in the paper, its number and range, and its verdict by case."""
    heads = ("id, place", "claim, and the number judged", "range", "cases", "verdict")
    lines = []
    for claim in claims:
        networks = f"; {_HEADS[claim['sampler']]}" if claim["sampler"] else ""
        words = (
            f"{claim['text']}<br><small>{claim['number']}{networks}</small>",
            claim["range"].replace("; ", "<br>"),
            "<br>".join(case_texts(claim["by"][claim["sampler"]]["cases"])),
            f"{SYMBOLS[claim['verdict']]}\u00a0{claim['verdict']}<br>{prepared(claim)}",
        )
        place = f"`{claim['id']}`<br>{claim['place']}"
        lines.append([place, *(text.replace(" … ", UNBROKEN) for text in words)])
    return markdown.table(heads, lines)


def case_texts(cases: Rows) -> list[str]:
    """The verdict of each case, with its number; of many cases, with the one that decides."""
    if len(cases) <= LISTED:
        return [
            f"{case['label']} {SYMBOLS[case['verdict']]} {_number(case)}".strip() for case in cases
        ]
    listed_cases = []
    for verdict, symbol in SYMBOLS.items():
        for span in dict.fromkeys(case["span"] for case in cases):
            alike = [c for c in cases if (c["verdict"], c["span"]) == (verdict, span)]
            if alike:
                farthest = max(alike, key=lambda case: case["beyond"])
                where = ", ".join(case["label"].removeprefix("μ = ") for case in alike)
                at = farthest["label"].removeprefix("μ = ")
                number = _number(farthest) + (f" at {at}" if len(alike) > 1 else "")
                listed_cases.append(f"{symbol} μ = {where}: {number}")
    return listed_cases


def prepared(claim: dict[str, Any]) -> str:
    """In which preparations a claim about large friction was judged, as HTML."""
    if claim["one_preparation"]:
        return "<small>default preparation only</small>"
    if claim["verdict"] == DEPENDS:
        return f"<small>late drag: {claim['late']}</small>"
    return "<small>both preparations</small>" if claim["late"] else ""


def range_table(claims: Rows) -> str:
    """Why each claim has its range, and whether it was chosen before results were known."""
    lines = [
        [f"`{claim['id']}`", claim["range"].replace("; ", "<br>"), claim["why"], claim["chosen"]]
        for claim in claims
    ]
    return markdown.table(("id", "range", "why this range", "chosen"), lines)


def captioned(table: StudyTable) -> str:
    """The figures of the paper with their captions."""
    walk = _HEADS[paper_sampler(table)]
    return "\n".join(
        f"![Figure {k}]({FIGURES}/figure{k}.png)\n\n*Figure {k}.* "
        f"{CAPTIONS[f'figure{k}'].format(walk=walk)}\n"
        for k in SHOWN
    )
