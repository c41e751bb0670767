"""The study's numbers in documents, written between two marks, so that none is copied by hand.

A document contains <!-- study: NAME -->, the generated text, and <!-- end -->. Names: "headlines"
(the first findings, one sentence each), "highlights" (all of them, with figures), "claims" (each
claim of the paper with its verdict, and the numbers behind it), "figures" (those of the paper),
"friction" (some measures at some μ), "sweeps" (the residual of the paper's walk), "preparation"
(how results depend on the packing), "resting" (how h and η3 depend on when drag sets in),
"certificates" (largest gap of the exact bounds, convergence of uniform samples). `csv_tables` has
all numbers.
"""

import functools
from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from granforce.measures import statistics
from granforce.paper import csv_tables
from granforce.paper import plan as plans
from granforce.paper.claims.groups import SAMPLERS, WHOLE_WALK
from granforce.paper.claims.table import AFTER
from granforce.paper.claims.verdicts import SYMBOLS
from granforce.paper.drawings import CAPTIONS, POINTS
from granforce.paper.formatting import between, concise, listed
from granforce.paper.highlights import Highlight, highlights
from granforce.paper.resting import resting
from granforce.paper.tables import StudyTable
from granforce.records import InputError
from granforce.system import markdown
from granforce.types import Rows

KIND = "study"

FIGURES = "../../../data/figures"  # relative to the results page
HEADLINES = 3  # highlights in the README
LISTED = 3  # cases of a claim that are listed with their numbers; of more, the one that decides
UNBROKEN = "\u00a0…\u00a0"  # of a range, in narrow columns
# μ in the tables of pages; csv_tables have all.
_FRICTIONS = (0.001, 0.01, 0.1, 0.2, 0.5, 1, 10)
_PREPARED_FRICTIONS = (1, 10)
_SWEPT_FRICTIONS = (0.001, 0.1, 10)
# Heads of columns, and the quantities of csv_tables.
_MEASURES = {
    "z": "coordination z",
    "h": "dimension h",
    "exact η3": "exact η3",
    "η2, nearest": "η2, nearest-network walk",
    "η2, paper's": "η2, paper's walk",
    "η2, uniform": "η2, uniform networks",
    "F_crit, ⟨f_n⟩": "critical force, ⟨f_n⟩",
    "F_crit/limit load": "critical force over limit load",
    "width of S, ⟨f_n⟩": "width of S, ⟨f_n⟩",
}


def renew(paths: Sequence[Path], table: StudyTable, claims: Rows, findings: Rows) -> None:
    """Write the study's tables, judged claims and findings into files with marks.

    claims: as `claims.judge` returns them; findings: dicts of `findings.Finding`.
    """
    chosen = functools.cache(lambda: highlights(table, claims, findings))
    means = functools.cache(lambda: csv_tables.by_friction(table))
    known: dict[str, Callable[[], str]] = {
        "headlines": lambda: headlines(chosen()),
        "highlights": lambda: highlight_text(chosen()),
        "claims": lambda: claim_table(claims),
        "figures": paper_figures,
        "friction": lambda: at_friction(means(), _MEASURES, _FRICTIONS),
        "sweeps": lambda: sweeps(table, means()),
        "preparation": lambda: preparation(table),
        "resting": lambda: resting(table),
        "certificates": lambda: certificates(table),
    }

    def text_of(path: Path, name: str) -> str:
        if name not in known:
            raise InputError(f"{path}: unknown table {name!r}; choose one of {', '.join(known)}")
        return markdown.typeset(known[name]())

    markdown.renew(paths, KIND, text_of)


def at_friction(rows: pd.DataFrame, columns: dict[str, str], frictions: Sequence[float]) -> str:
    """Some quantities {head: name} at some μ as a table, of rows of `csv_tables.by_friction`."""
    cells = {(row.quantity, row.mu): _mean(row) for row in rows.itertuples()}
    known = {head: name for head, name in columns.items() if name in set(rows["quantity"])}
    lines = [
        [f"{mu:g}", *(cells.get((name, mu), "") for name in known.values())]
        for mu in frictions
        if mu in set(rows["mu"])
    ]
    return markdown.table(["μ", *known], lines)


def _mean(row: Any) -> str:
    return concise(row.mean, row.standard_error)


def sweeps(table: StudyTable, means: pd.DataFrame) -> str:
    """The paper's walk by its final residual: sentences and a table of means at each μ."""
    ends = [residual for part, residual in plans.SWEEPS.items() if len(table.part(part))]
    columns = {
        f"{word} {_power(residual)}": f"{quantity}, paper's walk to {residual:g}"
        for word, quantity in (("sweeps to", "sweeps per network"), ("η2,", "η2"))
        for residual in ends
    }
    columns = {
        head: name + " over nearest-network walk" * name.startswith("η2")
        for head, name in columns.items()
    }
    return f"{_sweep_notes(table)}\n{at_friction(means, columns, _SWEPT_FRICTIONS)}" if ends else ""


def _sweep_notes(table: StudyTable) -> str:
    """At how many packings each residual was measured, and which walks are incomplete."""
    swept = {part: table.part(part) for part in plans.SWEEPS if len(table.part(part))}
    most = [
        f"{rows.groupby('mu').size().max()} to {_power(plans.SWEEPS[part])}"
        for part, rows in swept.items()
    ]
    text = f"At each μ, there are up to {listed(most)} packings. Verdicts use the first."
    rows = table.part(*swept)
    where = sorted(rows["mu"][rows["reached_part"] < 1].unique())
    if where:
        text += (
            " Some walks have fewer networks than requested, at μ = "
            f"{listed([f'{mu:g}' for mu in where])}. A walk is judged only if it has at least "
            f"{100 * WHOLE_WALK:g} % of them."
        )
    return text + "\n"


def _power(residual: float) -> str:
    return f"10{str(round(np.log10(residual))).translate(markdown.RAISED)}"


def preparation(table: StudyTable) -> str:
    """Dependence on the preparation at large μ: a table, and a sentence.

    The first line has means with the default options. The others have mean differences from them in
    the same seeds, bold if they are significant although there are so many.
    """
    rows = csv_tables.by_preparation(table)
    if not len(rows):
        return ""
    level, tests = 1 - statistics.LEVEL, int(rows["p"].notna().sum())
    columns = [(name, mu) for name in ("h", "exact η3") for mu in _PREPARED_FRICTIONS]
    cells = {
        (row.options, row.quantity, row.mu): _difference(row, level / max(1, tests))
        for row in rows.itertuples()
    }
    lines = [
        [options, *(cells.get((options, *column), "") for column in columns)]
        for options in rows["options"].unique()
    ]
    heads = ["options", *(f"{name}, μ = {mu:g}" for name, mu in columns)]
    return (
        f"{markdown.table(heads, lines)}\nEach difference is the mean over up to "
        f"{rows['packings'].max()} pairs of packings. It is bold if Student's t is significant at "
        f"the level {level:.2g}, corrected for all {tests} differences (Bonferroni).\n"
    )


def _difference(row: Any, level: float) -> str:
    """A mean, or a difference with its sign, bold if it is significant."""
    if row.options == csv_tables.DEFAULT:
        return _mean(row)
    text = f"{'+' if row.mean > 0 else ''}{_mean(row)}"
    return f"**{text}**" if row.p < level else text


def headlines(chosen: Sequence[Highlight]) -> str:
    """The first highlights as a list."""
    return "".join(f"- {_with_bold_message(one.sentence)}\n" for one in chosen[:HEADLINES])


def _with_bold_message(sentence: str) -> str:
    """A highlight with its message, the words before the first colon, in bold."""
    message, colon, numbers = sentence.partition(": ")
    return f"**{message}**{colon}{numbers}" if colon else sentence


def highlight_text(chosen: Sequence[Highlight]) -> str:
    """All highlights, numbered, with caveats, links to methods, and figures."""
    text, shown = "", set()
    for k, one in enumerate(chosen, 1):
        words = f"{one.sentence} {one.caveat}".strip()
        text += f"**{k}.** {_with_bold_message(words)} [Method](method.md#{one.method})\n\n"
        if one.figure and one.figure not in shown:
            text += _figure(one.figure) + "\n"
            shown.add(one.figure)
    return text


def paper_figures() -> str:
    """Figures 1 to 6 with their captions."""
    return "\n".join(_figure(f"figure{k}", f"Figure {k}. ") for k in range(1, 7))


def _figure(name: str, head: str = "") -> str:
    """A figure with its caption, without what the page says of all figures."""
    caption = CAPTIONS[name].format(walk="paper's walk").replace(f"; {POINTS}", "")
    escaped = caption.replace("|", "\\|").replace("*", "\\*")
    return f"![{name}]({FIGURES}/{name}.png)\n\n*{head}{escaped}*\n"


def _number(finding: dict[str, Any]) -> str:
    """The value of a finding or claim with its interval, if it has one."""
    if not np.isfinite(finding["value"]):
        return ""
    return between(finding["value"], finding["low"], finding["high"], "({} … {})", range(3, 7))


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
        networks = ", exact intervals" * (claim["sampler"] == "exact")
        notes = preparation_note(claim)
        words = (
            f"`{claim['id']}`<br>{claim['place']}",
            f"{claim['text']}<br><small>{claim['number']}{networks}</small>",
            claim["range"].replace("; ", "<br>") + " †" * (claim["chosen"] == AFTER),
            "<br>".join(case_texts(claim["by"][claim["sampler"]]["cases"])),
            f"{SYMBOLS[claim['verdict']]}\u00a0{claim['verdict']}"
            + (f"<br>{notes}" if notes else ""),
        )
        lines.append([text.replace(" … ", UNBROKEN) for text in words])
    return markdown.table(heads, lines)


def case_texts(cases: Rows) -> list[str]:
    """The verdict of each case, with its number; of many cases, with the one that decides."""
    if len(cases) <= LISTED:
        return [
            f"{case['label']} {SYMBOLS[case['verdict']]} {_number(case)}".strip() for case in cases
        ]
    texts = []
    labels = [case["label"].removeprefix("μ = ") for case in cases]
    for verdict, symbol in SYMBOLS.items():
        for span in dict.fromkeys(case["span"] for case in cases):
            alike = [k for k, c in enumerate(cases) if (c["verdict"], c["span"]) == (verdict, span)]
            if alike:
                farthest = max(alike, key=lambda k: cases[k]["beyond"])
                number = _number(cases[farthest])
                number += f" at {labels[farthest]}" if len(alike) > 1 else ""
                texts.append(f"{symbol} μ = {_runs(labels, alike)}: {number}")
    return texts


def _runs(labels: Sequence[str], chosen: Sequence[int]) -> str:
    """Labels in order, those of three neighbours or more as a range."""
    words: list[str] = []
    for _, run in groupby(enumerate(chosen), key=lambda pair: pair[1] - pair[0]):
        names = [labels[k] for _, k in run]
        words += names if len(names) < 3 else [f"{names[0]} … {names[-1]}"]
    return ", ".join(words)


def preparation_note(claim: dict[str, Any]) -> str:
    """In which preparations a claim about large friction was judged, as HTML."""
    if claim["one_preparation"]:
        return "<small>default preparation only</small>"
    late = claim["late"]
    if late in ("", claim["verdict"]):
        return "<small>both preparations</small>" if late else ""
    if late == claim["same_networks"]:
        return f"<small>nearest-network walk: {late}</small>"
    return f"<small>late drag: {late}</small>"
