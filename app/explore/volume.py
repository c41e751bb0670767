"""A card beside η: how wide S is along each free dimension, by its volume."""

from typing import Any

import panel as pn
import panel_material_ui as pmui
import xarray as xr

from ..results import compute
from ..results.library import Cell
from ..state.app_state import AppState
from ..widgets.parts import OUTLINED, PLAIN
from .results_line import STYLE, as_tiles

# As summary.TILES, of names in the dataset.
TILES = (
    ("width of S", "extent", ".4f", "width", ""),
    ("volume ln V", "log_volume", ".1f", "volume", ""),
    ("error of ln V", "log_volume_error", ".2f", "volume", ""),
)


class Volume:
    """The volume of all networks of the packing on screen, once known: `tiles`; else `measure`."""

    def __init__(self, state: AppState) -> None:
        self.state, self.work = state, state.work
        self.found: xr.Dataset | None = None
        self.tiles = pn.pane.HTML(stylesheets=[STYLE], sizing_mode="stretch_width", margin=(0, 10))
        self.measure = pmui.Button(
            label="Measure the volume of all networks", sx=PLAIN, margin=(4, 10), **OUTLINED
        )
        self.measure.on_click(lambda event: self._measure())
        state.param.watch(self._look, "replay")
        self.work.measuring.param.watch(self._offer, "running")
        self._look()

    def _look(self, *events: Any) -> None:
        """Whether a store has it already."""
        state, self.found = self.state, None
        self.work.measuring.cancel()
        self._show()
        if state.replay is not None and state.cell is not None:
            self.work.looking.start(compute.known_volume(state.library, state.cell), self._take)

    def _measure(self) -> None:
        cell = self.state.cell
        if cell is not None:
            self.work.measuring.start(compute.volume(self.state.library, cell), self._take)

    def _take(self, result: tuple[Cell, xr.Dataset | None]) -> None:
        cell, found = result
        if cell == self.state.cell:
            self.found = found
            self._show()

    def _show(self) -> None:
        self.tiles.object = "" if self.found is None else text(self.found)
        self._offer()

    def _offer(self, *events: Any) -> None:
        replay = self.state.replay
        free = replay is not None and replay.summary["dimension"] > 0
        wanted = free and self.found is None and not self.work.measuring.running
        self.measure.visible = bool(wanted)


def text(dataset: xr.Dataset) -> str:
    """The tiles of a volume, as HTML."""
    return as_tiles(TILES, {key: dataset[key].item() for _, key, *_ in TILES})
