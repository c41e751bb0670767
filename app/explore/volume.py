"""The volume of S of the packing on screen: looked up in the stores, computed on request."""

from typing import Any

import param
import xarray as xr

from ..results import compute
from ..results.library import Cell
from ..state.app_state import AppState


class Volume(param.Parameterized):
    """`found` once it is known; `offered` if it can be computed."""

    found = param.Parameter(doc="Dataset of the volume, or None")
    offered = param.Boolean(doc="whether there is a volume to be measured")

    def __init__(self, state: AppState) -> None:
        super().__init__()  # type: ignore[no-untyped-call]  # param says no types
        self.state, self.work = state, state.work
        state.param.watch(self._look, "replay")
        self.work.measuring.param.watch(self._offer, "running")
        self._look()

    def measure(self) -> None:
        """Compute it in the background."""
        cell = self.state.cell
        if cell is not None:
            self.work.measuring.start(compute.volume(self.state.library, cell), self._take)

    def _look(self, *events: Any) -> None:
        """Look it up in the stores."""
        state, self.found = self.state, None
        self.work.measuring.cancel()
        self._offer()
        if state.replay is not None and state.cell is not None:
            self.work.looking.start(compute.known_volume(state.library, state.cell), self._take)

    def _take(self, result: tuple[Cell, xr.Dataset | None]) -> None:
        cell, found = result
        if cell == self.state.cell:
            self.found = found
            self._offer()

    def _offer(self, *events: Any) -> None:
        replay = self.state.replay
        free = replay is not None and replay.summary["dimension"] > 0
        self.offered = bool(free and self.found is None and not self.work.measuring.running)
