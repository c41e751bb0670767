"""Two frictions side by side: the same packing, made at another μ or with its friction changed."""

from typing import Any

import param

from granforce.records import InputError

from ..background.limits import LIMITS
from ..background.notifications import observe
from ..results import compute
from ..results.library import Shown, cell_of
from ..results.selection import Selection


class Comparison(param.Parameterized):
    """The packing next to the states on screen if `looks.beside` names another μ.

    It is the same selection at that μ, with its own packing: `twin`. While the view is split,
    choosing another μ moves the present packing there; pinning a state or ending the split view
    removes it.
    """

    twin = param.Parameter(doc="the Shown of that μ, or None")

    def __init__(self, state: Any) -> None:
        super().__init__()  # type: ignore[no-untyped-call]  # param has no type hints
        self.state, self.looks, self.task = state, state.looks, state.work.task()
        observe(self._follow, state, "cell", "missing", "looks.split", "looks.beside")

    def keep(self, selection: Selection) -> None:
        """React to a new Selection: if only μ differs, the present states become the comparison."""
        state, looks = self.state, self.looks
        if not looks.split or looks.beside is not None or state.cell is None:
            return
        shown = state.cell.selection
        if shown.mu != selection.mu and shown.at(selection.mu).names(selection):
            looks.beside = shown.mu

    def _follow(self, *events: Any) -> None:
        """Load the other packing, or compute it if no store has it."""
        state, looks = self.state, self.looks
        arrived = any(event.name in ("cell", "missing") for event in events) and not state.missing
        if not looks.split or (
            arrived and state.cell is not None and looks.beside == state.cell.mu
        ):
            looks.beside = None  # the same μ twice
        if looks.beside is None or state.cell is None:
            self.task.cancel()
            self.twin = None
            return
        try:
            selection = state.given_held(state.cell.selection.at(looks.beside))
            selection.check(LIMITS)
        except InputError as error:
            looks.beside, state.work.message = None, str(error)
            return
        if self.twin is None or not self.twin.cell.selection.names(selection):
            self._find(selection)

    def _find(self, selection: Selection) -> None:
        state, library = self.state, self.state.library
        cell = cell_of(state.catalogue, selection)
        if cell is None and LIMITS.shared and selection.dear:
            state.looks.beside = None
            state.work.message = (
                f"the packing at μ = {selection.mu:g} takes long to compute: open it by itself "
                "first"
            )
        elif cell is None:
            self.task.start(compute.states(library, selection), self._show)
        elif (shown := library.shown_in_memory(cell)) is None:
            self.task.start(lambda job: library.shown(cell), self._show)
        else:
            self.task.cancel()
            self.twin = shown

    def _show(self, shown: Shown) -> None:
        self.twin = shown
