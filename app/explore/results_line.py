"""The results for the states on screen: one line, and two tables with errors that it unfolds."""

from collections.abc import Iterable
from typing import Any

import param
import xarray as xr

from ..background.notifications import observe
from ..browser.bundle import Scripted
from ..browser.messages import from_browser
from ..results import compute
from ..results.library import Cell, Shown
from ..results.progress_feed import Summary
from ..results.replays import worded
from ..state.app_state import AppState
from ..widgets.hints import term
from . import result_values
from .result_values import Quantity

MEASURE = '<button type="button" class="soft">measure</button>'
GIVEN = " given the held forces"
NONE = "", "–"  # values that are not there
UNBOUNDED = (
    "S is unbounded: some forces can grow together without a load and have no largest value, so η "
    "is undefined. To bound S, select such a contact and hold its force (H) or, if it is friction "
    "that wedges the grains, choose a smaller μ."
)
MORE = '; <button type="button" class="soft more">take five times as many</button>'
UNIT = {"extent": " ⟨fₙ⟩"}
FOLD = '<button type="button" class="fold" title="all numbers, with their meaning"></button>'


class Results(Scripted):
    """Numbers with symbol and name, seen and exact; see results_line.js.

    In low windows the tables are closed, to leave the room to the tabs. The volume of S is looked
    up in the stores, and computed on request.
    """

    html = param.String()
    open = param.Boolean(doc="whether the tables are open in a low window, too")

    def __init__(self, state: AppState, **params: Any) -> None:
        super().__init__(**params)
        self._state, self._work = state, state.work
        self._volume: xr.Dataset | None = None
        observe(self._look, state, "replay")
        observe(
            self._tell, state, "exact", "shown", "missing", "work.computation.running",
            "knowledge.known", "knowledge.narrowed", "work.measuring.running", "looks.tab",
        )  # fmt: skip
        state.looks.sync_opened(self, "results")
        self._look()

    def _look(self, *events: Any) -> None:
        """Look up the volume of the packing on screen."""
        state, self._volume = self._state, None
        self._work.measuring.cancel()
        self._tell()
        if state.replay is not None and state.cell is not None:
            self._work.looking.start(compute.known_volume(state.library, state.cell), self._take)

    def _take(self, result: tuple[Cell, xr.Dataset | None]) -> None:
        if result[0] == self._state.cell:
            self._volume = result[1]
            self._tell()

    def _tell(self, *events: Any) -> None:
        replay = self._state.replay
        if replay is not None:
            self.html = results(self._state, self._volume)

    @from_browser(more=True)
    def _more(self) -> None:
        """Take more networks of the same S."""
        if self._state.cell is not None:
            selection = self._state.cell.selection
            self._state.ask(selection._replace(states=5 * selection.states), at_once=True)

    @from_browser(measure=True)
    def _measure(self) -> None:
        """Compute the volume of S."""
        if self._state.cell is not None:
            work = compute.volume(self._state.library, self._state.cell)
            self._work.measuring.start(work, self._take)


def results(state: AppState, volume: xr.Dataset | None = None) -> str:
    """All numbers as HTML, and a note on omitted work.

    While other states are being computed, dashes, except for what is known of their packing.
    """
    if state.missing and state.work.computation.running:
        return coming(state)
    known = GIVEN if state.narrows else ""
    older = bool(known) and not state.obeying
    measures = result_values.measures(state)
    sampling = result_values.sampling(state)
    count = f"{state.replay.summary['states']} networks"
    heading = f"seen in all {count}"
    if older:
        heading = f"older than the held forces: seen in {count}"
    elif known:
        heading = f"seen{known} ({count})" + ("" if state.obeys_held else ", which a push ignores")
    if not state.replay.summary["dimension"]:
        heading = "the only network"
    if sampling and sampling.verdict:
        heading += f", {term('r_hat', sampling.verdict)}"
    rows = [[heading, *_values(measures, "seen")]]
    if known and state.knowledge.whole is None:
        rows.append([f"exact{known}: being computed", *_dashes(measures)])
    elif any(one.exact for one in measures):
        rows.append([f"exact{known}", *_values(measures, "exact")])
    packing = result_values.packing(state, volume)
    unknown = "being measured" if state.work.measuring.running else MEASURE
    values = [one.exact or unknown for one in packing]
    doubts = [result_values.unborne(state.replay)]
    endless = result_values.unbounded(state.replay.summary)
    if sampling and sampling.doubt:  # no number of networks fills an unbounded S
        doubts.append(sampling.doubt + ("" if endless else MORE))
    doubts.append(UNBOUNDED if endless else "")
    doubt = "".join(f'<p class="flag" role="note">⚠ {line}</p>' for line in filter(None, doubts))
    now, was = Shown(state.cell, state.replay, state.exact), state.before
    change = "" if was is None or older else f'<p class="was">{result_values.changes(now, was)}</p>'
    left = f'<p class="left">{worded(state.replay, left_out(state.replay.summary))}</p>'
    line = _laid_out(heading, measures, packing, rows, values, left, known, older)
    return line + doubt + change


def coming(state: AppState) -> str:
    """The numbers while the requested states are being computed: those that stay the same."""
    same, heading = not state.requested, "seen: being computed"
    measures, packing = result_values.measures(state), result_values.packing(state)
    measures = [one._replace(seen="–", exact=one.exact if same else "") for one in measures]
    packing = [
        one._replace(exact=one.exact if (same or state.growing) and one.exact else "–")
        for one in packing
    ]
    known = GIVEN if state.narrows else ""
    rows = [[heading, *_dashes(measures)], [f"exact{known}", *_values(measures, "exact")]]
    was = Shown(state.cell, state.replay, state.exact)
    before = f'<p class="was">Before: {result_values.changes(was)}</p>'
    values = [one.exact for one in packing]
    return _laid_out(heading, measures, packing, rows, values, known=known) + before


def _laid_out(
    heading: str,
    measures: Iterable[Quantity],
    packing: Iterable[Quantity],
    rows: list[list[str]],
    values: list[str],
    left: str = "",
    known: str = "",
    older: bool = False,
) -> str:
    """The line and the tables; rows, values: of the tables; left: what the numbers leave out.

    known: of which S the exact values are; older: whether the seen ones are of another.
    """
    seen = [
        (one, f"<i>{one.seen}</i>", f" (exact{known} <b>{one.exact}</b>)" * (one.exact not in NONE))
        for one in measures
    ]
    parts = [*seen, *((one, one.exact, "") for one in packing if one.exact[:1] not in NONE)]
    line = "".join(
        f"<span>{term(one.key, one.symbol)} <b>{value}</b>{more}</span>"
        for one, value, more in parts
    )
    return (
        f'<p class="line{" older" * older}"><span class="of">{heading}</span>{line}{FOLD}</p>'
        f'<div class="tables{" older" * older}">'
        + _table(["How undetermined", *_titles(measures)], rows)
        + _table(_titles(packing), [values])
        + f"{left}</div>"
    )


def _titles(quantities: Iterable[Quantity]) -> list[str]:
    return [term(one.key, f"{one.symbol} {one.words}") for one in quantities]


def _values(quantities: Iterable[Quantity], of: str) -> list[str]:
    values = [(one, getattr(one, of).replace("±", term("error", "±"))) for one in quantities]
    return [value + UNIT.get(one.key, "") if value else "" for one, value in values]


def _dashes(quantities: Iterable[Quantity]) -> list[str]:
    return ["–" for _ in quantities]


def _table(head: list[str], rows: list[list[str]]) -> str:
    titles = "".join(f'<th scope="col">{title}</th>' for title in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{titles}</tr></thead><tbody>{body}</tbody></table>"


# Number in the summary → key of the glossary, a noun, and the rest of the sentence.
LEFT_OUT = {
    "rattlers": ("rattler", "loose disk", ""),
    "unloaded_contacts": ("unloaded", "contact", " without force"),
    "tangential_unknowns": ("no_friction", "force", " along contacts"),
    "skipped": ("determined", "network", " identical to the others"),
    "held": ("held_components", "force", " that cannot vary"),
    "dropped": ("dropped", "network", " before the sample"),
}


def left_out(summary: Summary) -> str:
    """One line on work that was skipped and attempts that failed, as HTML."""
    counts = [
        f"{count} {term(key_of_term, noun + 's' * (count != 1) + rest)}"
        for key, (key_of_term, noun, rest) in LEFT_OUT.items()
        if (count := summary.get(key))
    ]
    line = f"Not counted: {', '.join(counts) or 'nothing'}."
    if summary.get("rejected") or summary.get("unconverged"):
        line += (
            f" {term('failed', 'Failed attempts')}: {summary['rejected']} not in balance, "
            f"{summary['unconverged']} not finished."
        )
    if summary["kept"] < summary["states"] and summary["dimension"]:
        line += (
            f" Played: {summary['kept']} of the {summary['states']} networks, evenly spaced; ± and "
            f"R̂ are from these {summary['kept']}, the values from all {summary['states']}."
        )
    return line
