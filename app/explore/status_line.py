"""One line on what is on screen: what is certified and mixed, or computing, or went wrong."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import param

from ..browser.messages import Message
from ..results.selection import KINDS, SOLVERS
from ..state.app_state import AppState
from ..widgets.progress import Progress


class StatusLine(Progress):
    """Facts on the states on screen, or how far a task is, or what failed; see status_line.js."""

    facts = param.List(doc="HTML, one each")
    failed = param.String(doc="what went wrong, in one line; empty if nothing did")

    def __init__(self, state: AppState, **params: Any) -> None:
        knowledge, work = state.knowledge, state.work
        tasks = work.computation, work.loading, work.measuring, state.besides.task
        super().__init__(*tasks, knowledge.task, knowledge.ranking, **params)
        self._state = state
        state.param.watch(self._tell, ["replay", "exact", "missing", "cell"])
        work.param.watch(self._fail, "message")
        self._tell()
        self._fail()

    def _tell(self, *events: Any) -> None:
        self.facts = list(facts(self._state))

    def _fail(self, *events: Any) -> None:
        self.failed = self._state.work.message

    def _heard(self, message: Message) -> None:
        if "read" in message:
            self._state.work.message = ""
        else:
            super()._heard(message)


def facts(state: AppState) -> Iterator[str]:
    """What there is to know of the numbers on screen, as HTML."""
    cell, replay = state.cell, state.replay
    if cell is None or replay is None:
        return
    if state.missing:
        yield f"<b>Of μ = {cell.mu:g}, {cell.series}, while others are asked for</b>"
    yield bounds(state)
    yield sampled(state)


def bounds(state: AppState) -> str:
    """How many exact bounds are certified, and how exactly."""
    exact = state.exact
    if exact is None:
        return "exact bounds: not computed"
    gap = exact["interval_gap"].values
    count, wanted = int(np.isfinite(gap).sum()), gap.size
    most = float(exact["max_gap"]) / state.replay.force_scale
    of = "" if count == wanted else f" of {wanted}"
    return f"{count}{of} bounds certified, gap ≤ {power(most)} ⟨fₙ⟩"


def sampled(state: AppState) -> str:
    """How the states were found, how many of those tried, and whether they mixed."""
    asked, summary = state.cell.selection, state.replay.summary
    how = f"random walk, {SOLVERS[asked.relax]}" if asked.kind == "walk" else KINDS[asked.kind]
    parts = [f"{how}: {summary['states']} networks"]
    if summary.get("acceptance") is not None and not summary.get("skipped"):
        parts.append(f"{summary['acceptance']:.0%} of attempts accepted")
    r_hat, size = summary.get("worst_r_hat"), summary.get("least_bulk_size")
    if r_hat is not None:
        parts.append(f"R̂ ≤ {r_hat:.2f}")
    if size is not None:
        parts.append(f"effective size ≥ {size:.0f}")
    return ", ".join(parts)


def power(value: float) -> str:
    """A small number as text, "5·10⁻⁹"."""
    if not value > 0:
        return "0"
    digits, exponent = f"{value:.0e}".split("e")
    raised = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{digits}·10{raised}"
