"""Share what is on screen: pictures, tables, datasets, the packing, the parameters."""

from collections.abc import Callable
from typing import Any

import panel as pn
import xarray as xr

from ....background.jobs import Job, reading
from ....packing.captions import caption, known_words, origin, stem
from ....packing.view import exact_intervals, full_extent, gone, measured, pins
from ....results import planes
from ....results.compute import found_or_made
from ....results.library import SOURCES, Cell, Library
from ....state.app_state import AppState
from ....widgets.file_buttons import Handover
from ....widgets.parts import note
from ....widgets.plot_style import palettes
from ....widgets.progress import Progress
from . import files, movies, standalone

FILES = {
    "Picture of the packing": {"svg": "SVG", "png": "PNG"},
    "Animation": {"webm": "Movie (WebM)", "gif": "Movie (GIF)"},
    "Share with others": {"html": "This view as a page (HTML)"},
    "Data on screen": {
        "csv": "Contacts (CSV)",
        "netcdf": "States (NetCDF)",
        "zarr": "States (Zarr, zipped)",
    },
    "To go on elsewhere": {"npz": "Packing (NPZ)", "json": "Parameters (JSON)"},
}
DRAWN = ("svg", "png", "webm")  # in the browser
HELP = """
Pictures have a colour bar, a scale and a caption. Movies play from the first state to the last, or
to and fro between two: WebM is recorded here at the player's speed, GIF is drawn for slides, at
most 5 MB. The page as one file plays without a server and without a network.
Contacts: one row each with disks, forces as packed and now, the range over the networks and,
where known, exact bounds; the file's first lines explain the columns. States: the packing, and
<b>all</b> states with their measures, units and parameters; where only some were kept, all are
computed again. Every plot is saved as PNG or SVG by the buttons above it. The address of the page
reopens this view; <code>granforce walk --packing packing.npz</code> goes on with the packing.
"""
LONG = ("netcdf", "zarr", "gif", "html")  # with progress


class View:
    """Buttons; a file is made, off the event loop, when it is asked for."""

    name = "export"

    def __init__(self, state: AppState) -> None:
        self.state = state
        self.task, self.making = state.work.task(reading, told=False), state.work.task(told=False)
        self.buttons = Handover(self._asked, files=FILES, margin=(12, 10, 0, 10))
        self.told = note()
        for task in (self.task, self.making):
            task.param.watch(self._follow, "message")
        self.making.param.watch(self._rest, "running")

    def panel(self) -> pn.Column:
        """Buttons, and what they are for."""
        return pn.Column(
            self.buttons,
            Progress(self.making),
            self.told,
            note(HELP),
            sizing_mode="stretch_width",
        )

    def _asked(self, key: str) -> None:
        state = self.state
        self.told.object = ""
        if state.replay is None:
            self.told.object = "There is nothing on screen yet."
            return
        name = stem(state.cell.selection)
        if key in DRAWN:
            self.buttons.hand_over_picture(f"{name}.{key}", caption(state))
            return
        task = self.making if key in LONG else self.task
        task.start(self._work(key, name), self.buttons.hand_over)

    def _rest(self, event: Any) -> None:
        """What failed or was cancelled brings no file: its button rests, too."""
        if not event.new:
            self.buttons.rest()

    def _work(self, key: str, stem: str) -> Callable[[Job], files.File]:
        """Work that makes a file of what is on screen now."""
        state = self.state
        library, cell, replay, exact = state.library, state.cell, state.replay, state.exact
        possible, known = state.possible, state.knowledge
        drawn: dict[str, Any] = {"loads": state.loads, "gone": gone(known, replay)}
        drawn["measured"] = measured(state, replay)
        shown = drawn | {"pins": pins(known)}
        view, link, command, held = state.view, state.link(), state.command, state.hand.held
        told, source = caption(state), " ".join([origin(cell), *known_words(state)])
        frame = min(state.looks.frame, len(replay.normal) - 1)

        def work(job: Job) -> files.File:
            job.begin("making the file")
            if key == "csv":
                columns = files.contacts(replay, exact, frame, held)
                head = files.explained(
                    columns, replay, origin(cell), files.on_screen(replay, frame, held)
                )
                content = files.csv(columns, head)
                return files.File(f"{stem}.csv", "text/csv", content)
            if key == "json":
                content = files.parameters(cell, link, view)
                return files.File(f"{stem}.json", "application/json", content)
            if key == "npz":
                content = files.npz(library.packing(cell.params["packing"]))
                return files.File(f"{stem}.npz", "application/zip", content)
            if key in ("netcdf", "zarr"):
                states = all_states(library, cell, job)
                job.begin("making the file")
                whole = files.dataset(library.packing(cell.params["packing"]), states, exact)
                if key == "netcdf":
                    return files.File(f"{stem}.nc", "application/x-netcdf", files.netcdf(whole))
                return files.File(f"{stem}.zarr.zip", "application/zip", files.zarr_zip(whole))
            if key == "gif":
                job.begin("drawing the movie")
                bounds = exact_intervals(possible, replay)
                most = full_extent(replay, bounds, view["full"])
                names = ("colour", "thickness", "reference", "dark", "full", "stretch")
                looks = {name: view[name] for name in names} | {"most": most} | drawn
                look = movies.shades(replay, bounds, palettes(view["dark"]), **looks)
                content = movies.gif(
                    replay, look | told, between=view["between"], progress=job.tell,
                    cancelled=job.cancelled,
                )  # fmt: skip
                return files.File(f"{stem}.gif", "image/gif", content)
            outlined = None
            if replay.summary["dimension"] > 0:
                kept = standalone.thinned(replay)[0]
                outlined = planes.outline(library, cell, kept, planes.principal(kept))(job)
            job.begin("making the page")
            content = standalone.html(
                library, cell, replay, possible, shown, view=view, outlined=outlined, link=link,
                command=command, source=source,
            )  # fmt: skip
            return files.File(f"{stem}.html", "text/html", content)

        return work

    def _follow(self, event: Any) -> None:
        if event.new:
            self.told.object = event.new


def all_states(library: Library, cell: Cell, job: Job) -> xr.Dataset:
    """The dataset of a cell with all its states: those that were not kept are computed again."""
    if cell.params.get("keep") is None:
        return library.dataset(cell)
    params = cell.params | {"keep": None}
    return found_or_made(library, job, "all states", SOURCES[cell.kind], params)
