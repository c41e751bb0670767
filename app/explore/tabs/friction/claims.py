"""The paper's claims and the study's findings, as tables."""

import html
import re
from typing import Any

import numpy as np

from granforce.paper.claims import TOPICS, outcomes
from granforce.paper.claims.verdicts import FEW, REPRODUCED, STRONGLY
from granforce.paper.documents import UNBROKEN
from granforce.types import Rows

from ....results import study_data

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
TABLE = "<div class='judged'><table class='claims'>{}</table></div>"
CELL = '<td data-by="{}">{}</td>'  # `data-by`: in front of the value where columns do not fit


def claims(figure: int, opened: bool = False) -> str:
    """The claims on a figure of the paper, a column per sampler, as HTML."""
    chosen = study_data.claims(figure)
    if not chosen:
        return ""
    grouped = outcomes.by_claim(chosen)
    used = [name for name in SAMPLERS if any(name in one for one in grouped.values())]
    rows = [HEAD.format("".join(f"<th>{SAMPLERS[name]}</th>" for name in used))]
    for one in grouped.values():
        cells = "".join(
            CELL.format(SAMPLERS[name], _cell(one[name])) if name in one else "<td></td>"
            for name in used
        )
        judged = f"<small>{typeset(_judged(one))}</small>"
        statement = typeset(next(iter(one.values()))["statement"])
        rows.append(f"<tr><td>{statement}{judged}</td>{cells}</tr>")
    return (
        f"<details{' open' if opened else ''}><summary>Figure {figure}, "
        f"{TOPICS[figure].lower()}: {_counted(chosen)}</summary>"
        f"{TABLE.format(''.join(rows))}</details>"
    )


def summary() -> str:
    """The numbers of the paper's claims by outcome, and how to read the tables."""
    marks = ", ".join(f"{mark} {words}" for words, mark in list(outcomes.SYMBOLS.items())[:-1])
    return (
        f"<b>{outcomes.score(study_data.claims())}</b> The paper is {PAPER}. Below each claim: "
        "the number that is judged, and the range of its interval for "
        f"{outcomes.SYMBOLS[REPRODUCED]}. Each cell: verdict, value, 95 % interval over packings. "
        f"{marks}."
    )


def _counted(claims: Rows) -> str:
    counts = outcomes.counted(claims).items()
    return ", ".join(f"{count} {outcome}" for outcome, count in counts if count)


def _judged(by_sampler: dict[str, dict[str, Any]]) -> str:
    """The number that a claim is judged by, and its ranges, in words."""
    claim = next(iter(by_sampler.values()))
    words = f"{outcomes.SYMBOLS[REPRODUCED]} if {claim['good']}"
    if claim["fair"]:
        words += f", {outcomes.SYMBOLS[STRONGLY]} unless {claim['fair']}"
    return f"{_measured(by_sampler)}; {words.replace(' … ', UNBROKEN)}"


def _measured(by_sampler: dict[str, dict[str, Any]]) -> str:
    """The number of a claim in words, with what is different about it for some samplers."""
    words = {
        name: claim["number"] for name, claim in by_sampler.items() if np.isfinite(claim["value"])
    } or {"": next(iter(by_sampler.values()))["measured"]}
    usual, *_ = words.values()
    others: dict[str, list[str]] = {}
    for name, text in words.items():
        if text != usual:
            others.setdefault(_different(text, usual), []).append(SAMPLERS[name])
    notes = [f"{', '.join(names)}: {what}" for what, names in others.items()]
    return f"{usual} ({'; '.join(notes)})" if notes else usual


def _different(text: str, usual: str) -> str:
    """The parts of a text, separated by commas, that another lacks; only η3 if it has η2 there."""
    known = usual.split(", ")
    parts = []
    for part in text.split(", "):
        if part.replace("exact η3", "η2").replace("η3", "η2") in known and part not in known:
            parts.append("η3")
        elif part not in known:
            parts.append(part)
    return ", ".join(dict.fromkeys(parts))


def _cell(claim: dict[str, Any]) -> str:
    words = outcomes.SYMBOLS[claim["verdict"]]
    if np.isfinite(claim["value"]):
        words += f" {_number(claim['value'])}"
    known = claim["verdict"] != FEW and np.isfinite([claim["low"], claim["high"]]).all()
    details = [f"({_number(claim['low'])}{UNBROKEN}{_number(claim['high'])})"] if known else []
    details += [f"at μ\u00a0=\u00a0{claim['mu']:g}"] if np.isfinite(claim["mu"]) else []
    hover = "; ".join(filter(None, (claim["verdict"], claim["why"])))
    title = html.escape(plain(hover), quote=True)
    return f'<span title="{title}">{words} <small>{typeset(" ".join(details))}</small></span>'


def _number(value: float) -> str:
    return f"{value:.3g}".replace("-", "−")


def plain(text: str) -> str:
    """A text with its symbols, without HTML."""
    return text.replace("F_n", "Fₙ").replace("f_n", "fₙ").replace("F_orig", "fₙ as packed")


def typeset(text: str) -> str:
    """A text with its symbols as HTML: F_n with its index below, η1 as η₁, 1e-05 as 10⁻⁵."""
    text = re.sub(r"([A-Za-z])_([a-z]+)", r"\1<sub>\2</sub>", html.escape(text))
    text = re.sub(r"\b1e-0?(\d+)", r"10<sup>−\1</sup>", text)
    text = re.sub(r"(?<!\w)-(?=\d)", "−", text)
    return re.sub(r"η([123])", r"η<sub>\1</sub>", text)
