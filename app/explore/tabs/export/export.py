"""Export of what is on screen: pictures, tables, datasets, the packing, the parameters."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import panel as pn
import xarray as xr

from granforce.records import InputError

from ....background.jobs import Job, reading
from ....packing.captions import caption, known_words, network, origin, shown_stem, stem
from ....packing.legend import measured, pins, reduction
from ....results.compute import computed_anew, thrust
from ....results.library import Cell, Library
from ....results.saved_file import File, csv
from ....state.app_state import AppState
from ....state.known import MOST_KNOWN
from ....widgets.file_buttons import Handover
from ....widgets.parts import note
from . import files, standalone


class Snapshot:
    """What is on screen when a file is requested; makes the file."""

    def __init__(self, state: AppState) -> None:
        self.library, self.cell, self.replay = state.library, state.cell, state.replay
        self.exact = state.exact
        self.view, self.link, self.command = state.view, state.link(), state.command
        self.stem, self.shown_stem = stem(state.cell.selection), shown_stem(state)
        self.known, self.source = list(known_words(state)), origin(state.cell)
        frame = min(state.looks.frame, len(self.replay.normal) - 1)
        held, knowledge = state.hand.held, state.knowledge
        self.narrowed = knowledge.narrowed
        self._columns = files.contacts(self.replay, self.exact, frame, held, knowledge)
        self._head = files.explained(
            self._columns, self.replay, self.source, network(state),
            *known_words(state, MOST_KNOWN), files.bounds_of(knowledge, state.obeying),
            f"This view: ?{self.link}",
        )  # fmt: skip
        chosen = state.looks.contact
        self.pushed = state.pushed
        self.contact = self.replay.inviting if chosen is None else chosen
        numbers = state.numbers
        self._numbered = self.view if numbers is None else numbers.of(self.view)
        self._shown: dict[str, Any] = {
            "loads": state.loads, "reduction": reduction(knowledge, self.replay),
            "measured": measured(state, self.replay), "pins": pins(knowledge),
        }  # fmt: skip

    def file(self, ending: str, mime: str, content: bytes) -> File:
        """A file named after the packing, and after the network on screen if it depends on it."""
        stem = self.shown_stem if ending in OF_THE_NETWORK else self.stem
        return File(f"{stem}.{ending}", mime, content)

    def csv(self, job: Job) -> File:
        """A table of the contacts."""
        return self.file("csv", "text/csv", csv(self._columns, self._head))

    def motion(self, job: Job) -> File:
        """A table of the first motion of the disks under the push."""
        if self.pushed is None or self.contact is None:
            raise InputError("nothing was pushed: push two disks apart in the Push tab first")
        packing = self.library.packing(self.cell.params["packing"])
        columns, head = files.motion(packing, self.pushed, int(self.replay.backbone[self.contact]))
        head += f"# {self.source}\n# This packing: ?{self.link}\n"
        return self.file("motion.csv", "text/csv", csv(columns, head))

    def json(self, job: Job) -> File:
        """Parameters, link, command and view."""
        content = files.parameters(self.cell, self.link, self._numbered)
        return self.file("json", "application/json", content)

    def npz(self, job: Job) -> File:
        """The packing."""
        content = files.npz(self.library.packing(self.cell.params["packing"]))
        return self.file("npz", "application/zip", content)

    def netcdf(self, job: Job) -> File:
        """All states, as NetCDF."""
        return self.file("nc", "application/x-netcdf", files.netcdf(self._dataset(job)))

    def zarr(self, job: Job) -> File:
        """All states, as a zipped Zarr group."""
        return self.file("zarr.zip", "application/zip", files.zarr_zip(self._dataset(job)))

    def _dataset(self, job: Job) -> xr.Dataset:
        states = all_states(self.library, self.cell, job)
        job.begin("making the file")
        return files.dataset(self.library.packing(self.cell.params["packing"]), states, self.exact)

    def html(self, job: Job) -> File:
        """The view as a page that needs no server."""
        shown = self._shown
        if self.replay.outlines and self.replay.summary["dimension"] > 0:
            shown = shown | {"thrust": thrust(self.library, self.cell)(job)}
        content = standalone.html(
            self.library, self.cell, self.replay, self.exact, shown, view=self.view,
            job=job, narrowed=self.narrowed, link=self.link, command=self.command,
            source=" ".join([self.source, *self.known]),
        )  # fmt: skip
        return self.file("html", "text/html", content)


class Kind(NamedTuple):
    """A kind of file: its button's label and its method; None: the browser draws it."""

    words: str
    make: Callable[[Snapshot, Job], File] | None = None
    long: bool = False  # whether its progress is shown


GROUPS = {
    "Picture of the packing": {"svg": Kind("SVG"), "png": Kind("PNG")},
    "Animation": {"webm": Kind("Movie (WebM)")},
    "Share with others": {"html": Kind("This view as a page (HTML)", Snapshot.html, True)},
    "Data on screen": {
        "csv": Kind("Contacts (CSV)", Snapshot.csv),
        "motion": Kind("Motion by the push (CSV)", Snapshot.motion),
        "netcdf": Kind("Networks (NetCDF)", Snapshot.netcdf, True),
        "zarr": Kind("Networks (Zarr, zipped)", Snapshot.zarr, True),
    },
    "To continue elsewhere": {
        "npz": Kind("Packing (NPZ)", Snapshot.npz),
        "json": Kind("Parameters (JSON)", Snapshot.json),
    },
}
OF_THE_NETWORK = ("svg", "png", "csv", "html")  # kinds of files that show the network on screen
FILES = {
    heading: {key: kind.words for key, kind in group.items()} for heading, group in GROUPS.items()
}
KINDS = {key: kind for group in GROUPS.values() for key, kind in group.items()}
HELP = """
Each file shows the current view, including pulled and held forces. A push ends with its tab, but
its motion can be saved here. Pictures have a colour bar, scales and a caption. The movie plays from
the first network to the last, at the player's speed. The HTML page needs no server. Contacts: a row
each, with disks, forces as packed and on screen, the range over the networks and, if computed, the
exact bounds, in mean forces. Networks: the packing and <b>all</b> networks, with measures, units
and parameters. To save a plot, use the buttons at its right, which appear on hover. The address of
the page reopens this view.
"""


class View:
    """Buttons; a file is made off the event loop when it is requested."""

    name = "export"

    def __init__(self, state: AppState) -> None:
        self.state = state
        self.task, self.making = state.work.task(reading), state.work.task()
        self.buttons = Handover(self._asked, files=FILES, margin=(12, 10, 0, 10))

    def panel(self) -> pn.Column:
        """Buttons with explanations."""
        return pn.Column(self.buttons, note(HELP), sizing_mode="stretch_width")

    def _asked(self, key: str) -> None:
        state, kind = self.state, KINDS[key]
        if state.unsaved:
            state.work.message = state.unsaved
        elif kind.make is None:
            whole = stem(state.cell.selection)
            name = f"{shown_stem(state) if key in OF_THE_NETWORK else whole}.{key}"
            self.buttons.hand_over_picture(name, caption(state, moving=key == "webm"))
        else:
            task = self.making if kind.long else self.task
            task.start(partial(kind.make, Snapshot(state)), self.buttons.hand_over)


def all_states(library: Library, cell: Cell, job: Job) -> xr.Dataset:
    """The dataset of a cell with all its states; those not stored are computed again."""
    if cell.params.get("keep") is None:
        return library.dataset(cell)
    return computed_anew(library, cell, cell.params | {"keep": None}, job)
