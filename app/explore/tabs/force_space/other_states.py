"""Uniform states next to the walk on screen, or the walk next to uniform states."""

from collections.abc import Callable
from typing import Any

import panel_material_ui as pmui

from ....background.jobs import WAITING
from ....background.notifications import observe
from ....browser.panel_patches import together
from ....results import compute, planes
from ....results.library import Shown
from ....results.replays import Replay
from ....state.app_state import AppState

# The label of the switch that adds states of a kind.
ALSO = {"uniform": "also uniformly sampled networks", "walk": "also the walk"}
MARKED = {"uniform": "uniform ones (triangles)", "walk": "networks of the walk (triangles)"}
ENOUGH = 300  # states in addition to those shown, if they have to be computed


class OtherStates:
    """A switch that loads or computes the other kind of states: `replay`."""

    def __init__(self, state: AppState, changed: Callable[[], object]) -> None:
        """changed(): called when there are others, or none any more."""
        self.state, self._changed = state, changed
        self.replay: Replay | None = None
        self.switch = pmui.Switch(label=ALSO["uniform"], size="small", margin=(6, 8))
        self.task = state.work.task()
        self.switch.param.watch(lambda event: together(self.fetch), "value")
        observe(self._tell, self, "task.running", "state.work.progress")

    @property
    def kind(self) -> str:
        """The source of the other states."""
        cell = self.state.cell
        return "walk" if cell is not None and cell.kind == "uniform" else "uniform"

    def look(self) -> None:
        """Show those of a store; otherwise the switch computes them."""
        cell, self.replay = self.state.cell, None
        if self.state.growing or cell is None:
            return self.fetch()
        self.task.cancel()
        self._tell()
        available = planes.other_states(self.state.catalogue, cell) is not None
        if self.switch.value != available:
            self.switch.value = available
        elif available:
            self.fetch()

    def _tell(self, *events: Any) -> None:
        """Name the switch, and what its states wait for: the page reports only `foremost`."""
        label, job, first = ALSO[self.kind], self.task.job, self.state.work.foremost
        other = None if first is None else first.job
        if job is not None and job.stage == WAITING and other not in (None, job):
            label += f" – waits for: {other.stage.partition(':')[0]}"
        self.switch.label = label

    def fetch(self, *events: Any) -> None:
        """Load or compute the other states, or remove them."""
        state, replay, cell = self.state, self.state.replay, self.state.cell
        self.task.cancel()
        self.replay = None
        if not self.switch.value or cell is None or state.growing:
            self._changed()
            return
        other = planes.other_states(state.catalogue, cell)
        selection = cell.selection
        requested = selection._replace(kind=self.kind, states=min(selection.states, ENOUGH))
        work = (
            compute.states(state.library, requested)
            if other is None
            else lambda job: state.library.shown(other)
        )

        def done(shown: Shown) -> None:
            if state.replay is replay:
                self.replay = shown.replay
                self._changed()
                if other is None:
                    state.refresh()  # now it is listed

        self.task.start(work, done)
