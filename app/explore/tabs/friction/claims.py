"""The paper's claims and the study's findings, as tables."""

import html
import re
from typing import Any

import numpy as np

from granforce.paper.claims import outcomes
from granforce.types import Rows

from ....results import study_data

VERDICTS = {
    "reproduced": "✓",
    "differs": "≈",
    "not reproduced": "✗",
    "undecided": "?",
    "too few data": "…",
    "not measured": "…",
}
# Columns: the sampler whose numbers a claim is judged by, and heading.
SAMPLERS = {
    "gauss_seidel": "the paper’s walk, to 10⁻³",
    "nearest": "nearest-network walk",
    "uniform": "uniform in S",
    "exact": "exact",
    "": "packings alone",
}
# Outcomes of claims, with the words after their number.
OUTCOMES = {
    "reproduced": "reproduced",
    "depend on the sampler": "by some samplers only",
    "differ": "contradicted",
    "open": "open",
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


def summary() -> str:
    """The numbers of the paper's claims by outcome, and how to read the tables."""
    marks = ", ".join(f"{mark} {words}" for words, mark in list(VERDICTS.items())[:-1])
    return (
        f"<b>{outcomes.score(study_data.claims())}</b> The paper is {PAPER}. Each cell: verdict, "
        "value, 95 % interval over packings; hover over it for the criterion. "
        f"{marks}."
    )


def _counted(claims: Rows) -> str:
    count = outcomes.counted(claims)
    return ", ".join(f"{count[name]} {words}" for name, words in OUTCOMES.items() if count[name])


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
