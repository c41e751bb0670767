"""The paper's claims and the study's findings, as tables."""

import html
import re
from collections.abc import Iterable
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from ....results import study_data

VERDICTS = {
    "reproduced": "✓",
    "differs": "≈",
    "not reproduced": "✗",
    "undecided": "?",
    "too few data": "…",
    "not measured": "…",
}
DECIDED = {"reproduced", "differs", "not reproduced"}  # the others may change with more data
# Columns: the sampler whose numbers a claim is judged by, and heading.
SAMPLERS = {
    "gauss_seidel": "the paper’s walk, to 10⁻³",
    "nearest": "nearest-network walk",
    "uniform": "uniform in S",
    "exact": "exact",
    "": "packings alone",
}
PAPER = "Shaebani, Unger, Kertész, PRE 79, 052302 (2009)"
HEAD = "<tr><th>claim</th>{}</tr>"
TABLE = "<div style='overflow-x:auto'><table class='claims'>{}</table></div>"


def claims(about: str, heading: str, opened: bool = False) -> str:
    """The paper's claims about one of `study_data.ABOUT`, a column per sampler, as HTML."""
    chosen = study_data.claims(about)
    if not chosen:
        return ""
    by_statement: dict[str, dict[str, dict[str, Any]]] = {}
    for claim in chosen:
        by_statement.setdefault(claim["statement"], {})[claim["sampler"]] = claim
    used = [name for name in SAMPLERS if any(name in one for one in by_statement.values())]
    rows = [HEAD.format("".join(f"<th>{SAMPLERS[name]}</th>" for name in used))]
    for statement, one in by_statement.items():
        cells = "".join(f"<td>{_cell(one[name]) if name in one else ''}</td>" for name in used)
        rows.append(f"<tr><td>{typeset(statement)}</td>{cells}</tr>")
    return (
        f"<details{' open' if opened else ''}><summary>{heading}: {_counted(chosen)}</summary>"
        f"{TABLE.format(''.join(rows))}</details>"
    )


def summary(about: Iterable[str]) -> str:
    """How many claims about some of `study_data.ABOUT` are reproduced, and how to read the tables.

    Methods without a verdict do not count.
    """
    count = _counted(chain.from_iterable(map(study_data.claims, about)))
    marks = ", ".join(f"{mark} {words}" for words, mark in list(VERDICTS.items())[:-1])
    return (
        f"<b>This study reproduces {count.by_all} of the paper's {sum(count)} claims by every "
        f"method that reached a verdict, and {count.by_some} by some methods only.</b> "
        f"{count.by_none} differ or are not reproduced, and {count.undecided} are undecided "
        f"({PAPER}). Each cell: verdict, value, 95 % interval over "
        f"packings; hover over it for the criterion. {marks}."
    )


class Count(NamedTuple):
    """Numbers of claims by how many of the methods with a verdict reproduce them."""

    by_all: int
    by_some: int
    by_none: int
    undecided: int

    def __str__(self) -> str:
        names = "reproduced", "by some methods only", "not reproduced", "undecided"
        return ", ".join(f"{n} {name}" for n, name in zip(self, names, strict=True) if n)


def _counted(claims: Iterable[dict[str, Any]]) -> Count:
    verdicts: dict[str, set[str]] = {}
    for claim in claims:
        decided = {claim["verdict"]} & DECIDED
        verdicts.setdefault(claim["statement"], set()).update(decided)
    found = list(verdicts.values())
    by_all, undecided = found.count({"reproduced"}), found.count(set())
    by_some = sum("reproduced" in one for one in found) - by_all
    return Count(by_all, by_some, len(found) - by_all - by_some - undecided, undecided)


def _cell(claim: dict[str, Any]) -> str:
    hover = f"{claim['verdict']}: {claim['measured']}; criterion {claim['criterion']}"
    if claim["why"]:
        hover += f"; {claim['why']}"
    words = VERDICTS.get(claim["verdict"], claim["verdict"])
    if np.isfinite(claim["value"]):
        words += f" {_number(claim['value'])}"
    if np.isfinite([claim["low"], claim["high"]]).all() and claim["verdict"] != "too few data":
        words += f" <small>({_number(claim['low'])} … {_number(claim['high'])})</small>"
    title = html.escape(plain(hover), quote=True)
    return f'<span title="{title}" aria-label="{title}">{words}</span>'


def _number(value: float) -> str:
    return f"{value:.3g}".replace("-", "−")


def plain(text: str) -> str:
    """A text with its symbols, without HTML."""
    return text.replace("F_n", "Fₙ").replace("f_n", "fₙ").replace("F_orig", "fₙ as packed")


def typeset(text: str) -> str:
    """A claim with its symbols as HTML: F_n with its index below, η1 as η₁."""
    text = re.sub(r"([A-Za-z])_([a-z]+)", r"\1<sub>\2</sub>", html.escape(text))
    return re.sub(r"η([123])", r"η<sub>\1</sub>", text)
