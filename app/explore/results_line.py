"""Numbers of the walk on screen, and what was left out or went wrong on the way."""

from collections.abc import Iterator
from typing import Any

import panel as pn

from ..results.progress_feed import Summary
from ..state.app_state import AppState
from ..widgets.foldout import Foldout
from ..widgets.hints import term
from ..widgets.parts import LATER

TILE = """<div class="tile" tabindex="0" data-term="{term}"><div class="name">{name}</div>
<div>{value}</div><div class="name">{meaning}</div></div>"""
STYLE = """
.tiles { display: grid; grid-template-columns: repeat(auto-fill, minmax(114px, 1fr)); gap: 5px;
  margin-top: 6px; }
.tile { padding: 4px 6px 3px; border-radius: 6px; background: rgba(128, 128, 128, 0.1);
  font-variant-numeric: tabular-nums; font-size: 13.5px; cursor: help; line-height: 18px; }
.tile .name { font-size: 11px; line-height: 13px; opacity: 0.85; white-space: nowrap; }
.tile:focus-visible { outline: 2px solid #e8710a; }
.flag { margin: 6px 0 0; padding: 5px 9px; border-radius: 6px; font-size: 12.5px;
  background: #7a4a00; color: #ffffff; }
.first { font-size: 14px; line-height: 1.45; margin: 8px 2px 0; }
.rest { font-size: 12px; opacity: 0.85; margin: 6px 2px 0; }
"""

# Words and symbol, name among the summary's numbers, form, key of the glossary, and what it is of.
TILES = (
    ("free numbers h", "dimension", "d", "h", "forces less equations"),
    ("spread η1", "eta1", ".4f", "eta1", "of one force"),
    ("distance η2", "eta2", ".4f", "eta2", "of two networks"),
    ("range η3", "eta3", ".4f", "eta3", "largest − least force"),
)
# The same of what only those look at who check.
CHECKS = (
    ("disks N", "n", "d", "n", ""),
    ("packing fraction φ", "packing_fraction", ".4f", "phi", ""),
    ("contacts per disk z", "coordination", ".3f", "z", ""),
    ("accepted", "acceptance", ".0%", "accepted", ""),
    ("mixing R̂", "worst_r_hat", ".3f", "r_hat", ""),
    ("effective size", "least_bulk_size", ".0f", "ess", ""),
)

# Beyond these, numbers from a sample are flagged: chains do not agree, or too few states count.
MOST_R_HAT, LEAST_SIZE = 1.1, 100
FLAG = '<div class="flag" role="note">⚠ {}</div>'


def doubts(summary: Summary) -> Iterator[str]:
    """Sentences on what is not good enough to be relied on."""
    r_hat, size = summary.get("worst_r_hat"), summary.get("least_bulk_size")
    if r_hat is not None and r_hat > MOST_R_HAT:
        yield (
            f"The chains have not mixed: R̂ = {r_hat:.2f} for the worst component, more than "
            f"{MOST_R_HAT:g}. Ask for more networks before relying on these numbers."
        )
    if size is not None and size < LEAST_SIZE:
        yield (
            f"The worst component is worth {size:.0f} independent networks only, fewer than "
            f"{LEAST_SIZE}: its errors are large. Ask for more networks."
        )


def numbers(summary: Summary) -> str:
    """How undetermined the forces are, and what speaks against that, as HTML."""
    flags = "".join(map(FLAG.format, doubts(summary)))
    return f'<p class="first">{finding(summary)}</p>{flags}'


def checks(summary: Summary) -> str:
    """The measures of that, what they stand on, and what was left out, as HTML."""
    style, rest = f"<style>{STYLE}</style>", f'<div class="rest">{left_out(summary)}</div>'
    return style + as_tiles(TILES, summary) + as_tiles(CHECKS, summary) + rest


def finding(summary: Summary) -> str:
    """What the numbers say, in one sentence."""
    if not summary["dimension"]:
        return (
            "<b>How much can the forces vary?</b> Not at all: balance leaves every force one value."
        )
    networks = "one network" if summary["states"] == 1 else f"{summary['states']} networks"
    return (
        f"<b>How much can the forces vary?</b> Over {networks} found at random, a force varies by "
        f"about <b>{100 * summary['eta1']:.2g} %</b> of the mean force. Pulled on purpose, it can "
        "go further."
    )


def as_tiles(rows: tuple[tuple[str, ...], ...], summary: Summary) -> str:
    """Tiles of those numbers of a summary that it has, as HTML; rows: as TILES."""
    values = dict(summary)
    if summary.get("skipped"):
        values["acceptance"] = None  # nothing was tried
    made = "".join(
        TILE.format(name=name, value=_text(values[key], form), term=term, meaning=meaning)
        for name, key, form, term, meaning in rows
        if key in values
    )
    return f'<div class="tiles">{made}</div>'


def _text(value: Any, form: str) -> str:
    return "–" if value is None else format(value, form)


# Number of the summary → key of the glossary, and words.
LEFT_OUT = {
    "rattlers": ("rattler", "loose disks"),
    "unloaded_contacts": ("unloaded", "contacts without force"),
    "tangential_unknowns": ("no_friction", "forces along contacts"),
    "skipped": ("determined", "networks that could only be the same"),
    "held": ("held_components", "forces that cannot vary"),
    "dropped": ("dropped", "networks on the way to the sample"),
}


def left_out(summary: Summary) -> str:
    """One line on work that was skipped and attempts that failed, as HTML."""
    counts = [
        f"{summary[key]} {term(key_of_term, words)}"
        for key, (key_of_term, words) in LEFT_OUT.items()
        if summary.get(key)
    ]
    line = f"Not counted: {', '.join(counts) or 'nothing'}."
    if summary.get("rejected") or summary.get("unconverged"):
        line += (
            f" {term('failed', 'Failed attempts')}: {summary['rejected']} not in balance, "
            f"{summary['unconverged']} not finished."
        )
    if summary["kept"] < summary["states"]:
        line += f" Shown: {summary['kept']} evenly spaced of {summary['states']} networks."
    return line


def tiles(state: AppState, volume: Any) -> pn.Column:
    """The numbers of the replay on screen, its Volume, and what they stand on, to be opened."""
    folded = Foldout(line="In numbers", sizing_mode="stretch_width", margin=(2, 12))
    within = pn.Column(volume.tiles, volume.measure, visible=False, sizing_mode="stretch_width")
    folded.link(within, open="visible")

    shown = pn.pane.HTML(stylesheets=[STYLE], sizing_mode="stretch_width", margin=(0, 10))

    def tell(*events: Any) -> None:
        if state.replay is not None:
            summary = state.replay.summary
            shown.object, folded.inside = numbers(summary), checks(summary)

    state.param.watch(tell, "replay")
    tell()
    return pn.Column(shown, folded, within, styles=LATER, sizing_mode="stretch_width")


def of_which(state: AppState) -> pn.pane.HTML:
    """Whose numbers and plots are pale, while others are asked for."""
    line = pn.pane.HTML(visible=False, sizing_mode="stretch_width", margin=(6, 12, 0, 12))

    def tell(*events: Any) -> None:
        old = state.cell is not None and state.missing
        line.visible = old
        if old:
            line.object = f"<b>Pale: still of μ = {state.cell.mu:g}</b>, {state.cell.series}"

    state.param.watch(tell, ["missing", "cell"])
    tell()
    return line
