"""The results for the states on screen as two tables: indeterminacy, and the packing."""

import math
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
UNIT = {"extent": " ⟨fₙ⟩"}


class Results(Scripted):
    """Numbers with symbol and name, seen and exact; see results_line.js.

    The volume of S is looked up in the stores, and computed on request.
    """

    html = param.String()

    def __init__(self, state: AppState, **params: Any) -> None:
        super().__init__(**params)
        self._state, self._work = state, state.work
        self._volume: xr.Dataset | None = None
        observe(self._look, state, "replay")
        observe(
            self._tell, state, "exact", "shown", "missing", "work.computation.running",
            "knowledge.known", "knowledge.narrowed", "work.measuring.running",
        )  # fmt: skip
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
            free = replay.summary["dimension"] > 0 and not self._work.measuring.running
            self.html = tables(self._state, self._volume, free)

    @from_browser(measure=True)
    def _measure(self) -> None:
        """Compute the volume of S."""
        if self._state.cell is not None:
            work = compute.volume(self._state.library, self._state.cell)
            self._work.measuring.start(work, self._take)


def tables(state: AppState, volume: xr.Dataset | None, offered: bool) -> str:
    """All numbers as HTML, and a note on omitted work; offered: whether to measure the volume.

    While other states are being computed, dashes, except for what is known of their packing.
    """
    if state.missing and state.work.computation.running:
        return coming(state)
    known = " given the held forces" if state.knowledge.known else ""
    measures = result_values.measures(state)
    sampling = result_values.sampling(state)
    count = f"{state.replay.summary['states']} networks"
    heading = f"seen in all of S ({count})" if known else f"seen in all {count}"
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
    values = [_named(one, one.exact or (MEASURE if offered else "–")) for one in packing]
    doubts = filter(None, [result_values.unborne(state.replay), sampling and sampling.doubt])
    doubt = "".join(f'<p class="flag" role="note">⚠ {line}</p>' for line in doubts)
    now, was = Shown(state.cell, state.replay, state.exact), state.before
    change = "" if was is None else f'<p class="was">{result_values.changes(was, now)}</p>'
    left = f'<p class="left">{worded(state.replay, left_out(state.replay.summary))}</p>'
    return (
        _table(["How undetermined", *_titles(measures)], rows)
        + _table(_titles(packing), [values])
        + doubt
        + change
        + left
    )


def coming(state: AppState) -> str:
    """The tables while the requested states are being computed."""
    measures, packing = result_values.measures(state), result_values.packing(state)
    was = Shown(state.cell, state.replay, state.exact)
    found = [_named(one, one.exact if state.growing and one.exact else "–") for one in packing]
    rows = [[words, *_dashes(measures)] for words in ("seen: being computed", "exact")]
    return (
        _table(["How undetermined", *_titles(measures)], rows)
        + _table(_titles(packing), [found])
        + f'<p class="was">Before: {result_values.changes(was)}</p>'
    )


def _titles(quantities: Iterable[Quantity]) -> list[str]:
    return [term(one.key, f"{one.symbol} {one.words}") for one in quantities]


def _values(quantities: Iterable[Quantity], of: str) -> list[str]:
    values = [(one, getattr(one, of).replace("±", term("error", "±"))) for one in quantities]
    return [_named(one, value + UNIT.get(one.key, "")) if value else "" for one, value in values]


def _dashes(quantities: Iterable[Quantity]) -> list[str]:
    return [_named(one, "–") for one in quantities]


def _named(quantity: Quantity, value: str) -> str:
    """A value after its symbol and name, seen where a low window leaves no room for titles."""
    name = f'<span class="name"> {quantity.words}</span>'
    return f'<i class="symbol">{term(quantity.key, quantity.symbol)}{name}</i> {value}'


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
    if math.isnan(summary.get("eta1", 0.0)):  # only if S is certified to be unbounded
        line = f"S is unbounded: some forces have no largest value, so η is undefined. {line}"
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
