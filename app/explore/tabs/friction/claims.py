"""The paper's claims and their verdicts, as tables."""

import html
import re

from granforce.paper.claims import groups
from granforce.paper.claims.table import TOPICS
from granforce.paper.claims.verdicts import SYMBOLS
from granforce.paper.documents import UNBROKEN, case_texts, preparation_note

from ....results import study_data
from ....state.view_settings import SAMPLERS as words

# Samplers by whose numbers claims are judged.
SAMPLERS = {name: words[part] for name, part in groups.SAMPLERS.items() if part in words}
SAMPLERS |= {"exact": "exact", "": "packings"}
PAPER = "Shaebani, Unger, Kertész, PRE 79, 052302 (2009)"
HEAD = "<tr><th>claim</th><th>verdict</th><th>cases</th><th>others</th></tr>"
TABLE = "<div class='judged'><table class='claims'>{}</table></div>"
CELL = '<td data-by="{}">{}</td>'  # `data-by`: in front of the value where columns do not fit


def claims(figure: int, opened: bool = False) -> str:
    """The claims on a figure of the paper, with their verdicts, as HTML."""
    chosen = study_data.claims(figure)
    if not chosen:
        return ""
    rows = "".join(map(_row, chosen))
    symbols = " ".join(SYMBOLS[claim["verdict"]] for claim in chosen)
    return (
        f"<details{' open' if opened else ''}><summary>Figure {figure}, "
        f"{TOPICS[figure].lower()}: {symbols}</summary>{TABLE.format(HEAD + rows)}</details>"
    )


def summary() -> str:
    """How to read the tables."""
    marks = ", ".join(f"{mark} {words}" for words, mark in list(SYMBOLS.items())[:-1])
    return (
        f"<b>Claims of {PAPER}</b>, by 95 % intervals: {marks}. Figures 4 and 6 show "
        "nearest-network walks; claims are judged by what is named below each, mostly "
        f"{SAMPLERS['gauss_seidel']}."
    )


def _row(claim: study_data.Claim) -> str:
    by = claim["by"]
    place = f"{claim['number']}; {SAMPLERS[claim['sampler']]}; ✓ if {claim['range']}"
    verdict = f"{SYMBOLS[claim['verdict']]} {claim['verdict']}{preparation_note(claim)}"
    others = (
        f"{SYMBOLS[one['verdict']]} {SAMPLERS[name]}"
        for name, one in by.items()
        if name in SAMPLERS and name != claim["sampler"] and one["cases"]
    )
    cells = (
        ("verdict", verdict),
        ("cases", "<br>".join(map(typeset, case_texts(by[claim["sampler"]]["cases"])))),
        ("others", "<br>".join(others)),
    )
    words = f"{typeset(claim['text'])} ({claim['place']})<small>{typeset(place)}</small>"
    return f"<tr><td>{words}</td>{''.join(CELL.format(*cell) for cell in cells)}</tr>"


def typeset(text: str) -> str:
    """A text with its symbols as HTML: F_n with its index below, η1 as η₁, 1e-05 as 10⁻⁵."""
    text = re.sub(r"([A-Za-z])_([a-z]+)", r"\1<sub>\2</sub>", html.escape(text))
    text = re.sub(r"\b1e-0?(\d+)", r"10<sup>−\1</sup>", text)
    text = re.sub(r"(?<!\w)-(?=\d)", "−", text).replace(" … ", UNBROKEN)
    return re.sub(r"η([123])", r"η<sub>\1</sub>", text)
