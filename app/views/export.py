"""Take along what is on screen: pictures, tables, datasets, the packing, the parameters."""

import numpy as np
import panel as pn

from .. import exports
from ..jobs import reading
from ..state import VIEW
from .handover import Handover
from .packing import SATURATION, exact_intervals, normal_extent
from .parts import note
from .style import palettes

FILES = {
    "Picture of the packing": {"svg": "SVG", "png": "PNG"},
    "Data on screen": {
        "csv": "Contacts (CSV)",
        "netcdf": "States (NetCDF)",
        "zarr": "States (Zarr, zipped)",
    },
    "To go on elsewhere": {"npz": "Packing (NPZ)", "json": "Parameters (JSON)"},
}
HELP = """
Contacts: one row each with grains, original and present forces, the range over the states and,
where known, exact bounds. States: packing, states and measures with their units and parameters.
Every plot is saved as PNG or SVG by the buttons above it. The address of the page reopens this
view; <code>granforce walk --packing packing.npz</code> goes on with the packing.
"""
GROUND = ("#ffffff", "#121212")  # by day, by night


class View:
    """Buttons; a file is made, off the event loop, when it is asked for."""

    name, title = "export", "Export"

    def __init__(self, state):
        self.state = state
        self.task = state.task(reading)
        self.buttons = Handover(self._asked, files=FILES, margin=(12, 10, 0, 10))
        self.told = note()
        self.task.param.watch(self._follow, "message")

    def panel(self):
        """Buttons, and what they are for."""
        return pn.Column(self.buttons, self.told, note(HELP), sizing_mode="stretch_width")

    def _asked(self, key):
        state = self.state
        self.told.object = ""
        if state.replay is None:
            self.told.object = "There is nothing on screen yet."
            return
        self.task.start(
            self._making(key), lambda file: self.buttons.hand_over(file, png=key == "png")
        )

    def _making(self, key):
        """Work that makes a file of what is on screen now."""
        state = self.state
        library, cell, replay, exact = state.library, state.cell, state.replay, state.exact
        stem = _stem(cell.selection)
        frame = min(state.frame, len(replay.normal) - 1)
        link, view = state.link(), {name: getattr(state, name) for name in VIEW}
        look = exports.Look(
            frame, state.reference, state.colour, state.thickness, state.overlay,
            palettes(state.dark), GROUND[state.dark],
        )  # fmt: skip

        def work(job):
            job.begin("making the file")
            if key in ("svg", "png"):
                extent = normal_extent(replay, exact_intervals(exact, replay))
                most = float(np.quantile(extent, SATURATION)) if len(extent) else 0.0
                content = exports.picture(replay, extent, most, look).encode()
                return exports.File(f"{stem}.{key}", "image/svg+xml", content)
            if key == "csv":
                content = exports.csv(exports.contacts(replay, exact, frame))
                return exports.File(f"{stem}.csv", "text/csv", content)
            if key == "json":
                content = exports.parameters(cell, link, view)
                return exports.File(f"{stem}.json", "application/json", content)
            packing = library.packing(cell.params["packing"])
            if key == "npz":
                return exports.File(f"{stem}.npz", "application/zip", exports.npz(packing))
            whole = exports.dataset(packing, library.dataset(cell), exact)
            if key == "netcdf":
                return exports.File(f"{stem}.nc", "application/x-netcdf", exports.netcdf(whole))
            return exports.File(f"{stem}.zarr.zip", "application/zip", exports.zarr_zip(whole))

        return work

    def _follow(self, event):
        if event.new:
            self.told.object = event.new


def _stem(selection):
    """Name of a file without its ending."""
    if selection.imported:
        return f"granforce_{selection.packing['imported'][:8]}_mu{selection.mu:g}"
    return f"granforce_n{selection.packing['n']}_mu{selection.mu:g}_s{selection.packing['seed']}"
