"""One line on what is on screen: tested and mixed, or being computed, or failed."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import param

from ..background.jobs import Job, reading
from ..background.notifications import observe
from ..browser.bundle import Scripted
from ..browser.messages import from_browser
from ..results.library import Cell
from ..state.app_state import AppState
from ..widgets.hints import term
from . import result_values

TESTED = "distance_to_rest"  # in the record of a packing tested to be at rest


class StatusLine(Scripted):
    """Facts about the states on screen, a task's progress, or a failure; see status_line.js.

    If the partial result of the task is a valid result, its buttons are Stop and keep, and Discard.
    """

    progress = param.Dict(default={}, doc="as of Work")

    facts = param.List(doc="HTML, one each")
    failed = param.String(doc="what went wrong, in one line; empty if nothing did")

    def __init__(self, state: AppState, **params: Any) -> None:
        super().__init__(**params)
        self._state, work = state, state.work
        self._rest: tuple[Cell, bool] | None = None  # whether it was tested
        self._looking = work.task(reading, reported=False)
        observe(
            self._tell, state, "replay", "exact", "missing", "cell", "knowledge.known",
            "knowledge.narrowed", "work.computation.running", "work.reader.running",
        )  # fmt: skip
        observe(self._look, state, "cell")
        observe(self._report, work, "message", "progress")
        self._look()
        self._tell()
        self._report()

    def _look(self, *events: Any) -> None:
        """Read whether rest was tested in the packing's record."""
        library, cell = self._state.library, self._state.cell
        if cell is not None:

            def read(job: Job) -> tuple[Cell, bool]:
                return cell, TESTED in library.packing(cell.params["packing"]).info

            self._looking.start(read, self._take)

    def _take(self, result: tuple[Cell, bool]) -> None:
        self._rest = result
        self._tell()

    def _tell(self, *events: Any) -> None:
        lines = list(facts(self._state))
        if self._rest is not None and self._rest[0] == self._state.cell:
            lines.append(f"{term('at_rest')}: {'' if self._rest[1] else 'not '}tested")
        self.facts = lines

    def _report(self, *events: Any) -> None:
        work = self._state.work
        self.param.update(failed=work.message, progress=work.progress)

    @from_browser(read=True)
    def _forget(self) -> None:
        self._state.work.message = ""

    @from_browser(stop=True)
    def _stop(self) -> None:
        if (task := self._state.work.foremost) is not None:
            task.stop()

    @from_browser(cancel=True)
    def _cancel(self) -> None:
        if (task := self._state.work.foremost) is not None:
            task.dismiss()


def facts(state: AppState) -> Iterator[str]:
    """Facts about the numbers on screen, as HTML."""
    cell, replay = state.cell, state.replay
    if cell is None or replay is None:
        yield state.nothing
        return
    if state.missing and not state.work.computation.running:
        yield f"<b>Still showing μ = {cell.mu:g}, {cell.series}: the requested results follow</b>"
    yield bounds(state)
    yield str(result_values.sampling(state))


def bounds(state: AppState) -> str:
    """The number of certified exact bounds, their accuracy, and whether they ignore held forces."""
    exact, known, whole = state.exact, "", state.knowledge.whole
    if exact is None:
        return "exact bounds: not computed"
    if whole is not None:
        exact = whole.after
    elif state.knowledge.known:
        known = " without the held forces"
    gap = exact["interval_gap"].values
    count, total = int(np.isfinite(gap).sum()), gap.size
    most = float(exact["max_gap"])
    of = "" if count == total else f" of {total}"
    return f"{count}{of} {term('certified', 'bounds certified')}{known}, gap ≤ {power(most)} ⟨fₙ⟩"


def power(value: float) -> str:
    """A small number as text, "5·10⁻⁹"."""
    if not value > 0:
        return "0"
    digits, exponent = f"{value:.0e}".split("e")
    raised = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{digits}·10{raised}"
