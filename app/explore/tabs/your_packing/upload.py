"""Bring your own packing: drop its files, read the report, and use it like any other."""

import html
from typing import Any

import panel as pn
import panel_material_ui as pmui

from granforce.experiment.measurements import checked_calibration
from granforce.packing.importers.text import number_or_nan
from granforce.records import InputError, brief, friction, make_cell, positive
from granforce.system.wording import number

from ....background.jobs import error_line, reading
from ....background.limits import LIMITS
from ....results import photoelastic_frames, uploads
from ....results.saved_file import File
from ....results.selection import Selection, typed
from ....state.app_state import AppState
from ....widgets.file_buttons import Handover
from ....widgets.file_drop import Dropper
from ....widgets.parts import PRIMARY, by_words, note
from ....widgets.select import Select
from . import photoelastic as measured
from . import samples
from .my_computations import Mine

STATES = 200  # of the first walk
SAMPLES = {
    "disks": "Table of disks (walls: a floor, gravity: 1)",
    "bodies": "Table of bodies",
    "lammps": "LAMMPS: two dumps",
    "photoelastic": "Photoelastic frame: two lists",
}
HELP = """
<b>NPZ</b> of <code>granforce pack</code> or <code>import</code>; <b>LAMMPS</b>: a particle and a
contact dump; <b>tables</b> (CSV): x, y, r and, if known, i, j, f_n, f_t; <b>bodies</b> (CSV, JSON):
body, x, y; <b>photoelastic frames</b>: both lists of PeGS, or its <code>_solved.mat</code>.
"""
HOLD_WANTED = (
    "What holds the disks? Enter the sides of a periodic box, such as 30, 30, or choose Walls and "
    "enter Gravity, such as 1; then press Read. Other loads need columns fx, fy, torque."
)
IDLE_PRESSURE = (
    "Pressure applies only to a table in a periodic box, without forces and loads: leave it empty"
)
REPORT = """
<table style="border-collapse:collapse;font-size:13px;font-variant-numeric:tabular-nums">{}</table>
"""
ROW = '<tr><td style="padding:2px 18px 2px 0;opacity:.75">{}</td><td><b>{}</b></td></tr>'
WALLS = {
    "": "as listed", "box": "a box", "annulus": "an annulus", "circle": "a circle",
    "open": "left open",
}  # fmt: skip
AROUND = {"": "none", "floor": "a floor", "box": "a floor and two sides"}
SMALL = {"size": "small", "width": 150, "margin": (4, 8)}


class View:
    """Drop files and see the report; the packing is then on the page."""

    name = "upload"

    def __init__(self, state: AppState) -> None:
        self.state = state
        self.files: uploads.Files = {}
        self.task = state.work.task(reported=False)
        self.dropper = Dropper(
            self._dropped, self._refuse,
            label="Drop the files of a packing here, or click to choose them",
            most=LIMITS.upload * 10**6, sizing_mode="stretch_width", margin=(8, 10),
        )  # fmt: skip
        self.mu = pmui.TextInput(label="Friction μ", value="0.3", **SMALL)
        self.box = pmui.TextInput(label="Box L_x, L_y, tilt", placeholder="open", **SMALL)
        self.pressure = pmui.TextInput(label="Pressure", placeholder="1", **SMALL)
        self.around = Select(label="Walls", options=by_words(AROUND), width=190, margin=(4, 8))
        self.gravity = pmui.TextInput(label="Gravity", placeholder="0", **SMALL)
        self.tolerance = pmui.TextInput(label="Tolerance", placeholder="default", **SMALL)
        self.walls = Select(label="Walls", options=by_words(WALLS), width=150, margin=(4, 8))
        self.calibration = pmui.TextInput(
            label="Pressure calibration a, b, σ", placeholder="not used", **SMALL | {"width": 200}
        )
        self.reverse = pmui.Switch(label="Tangential forces reversed", margin=(8, 8))
        self.read = pmui.Button(label="Read", margin=(8, 8), **PRIMARY)
        self.error = pmui.Alert(severity="error", visible=False, sizing_mode="stretch_width")
        self.waiting = pmui.Alert(severity="info", visible=False, sizing_mode="stretch_width")
        self.brought: uploads.Brought | None = None
        self.report = note()
        self.frame = pn.Column(sizing_mode="stretch_width")
        self.samples = Handover(self._asked, files={"Samples to try": SAMPLES}, margin=(2, 10))
        self.making = state.work.task(reading)
        self.read.on_click(lambda event: self._read())
        self.task.param.watch(lambda event: self._refuse(event.new), "message")
        state.param.watch(self._report, "replay")
        self._ask()

    def panel(self) -> pn.Column:
        """The drop area, questions, and results."""
        return pn.Column(
            self.dropper,
            pn.FlexBox(
                *(self.mu, self.box, self.pressure, self.around, self.gravity),
                *(self.tolerance, self.walls, self.calibration, self.reverse, self.read),
                sizing_mode="stretch_width",
            ),
            self.error,
            self.waiting,
            self.report,
            self.frame,
            note(HELP),
            self.samples,
            # On a shared server it would show the computations of all visitors.
            *([] if LIMITS.shared else [Mine(self.state)]),
            sizing_mode="stretch_width",
        )

    def _asked(self, name: str) -> None:
        """Hand over the files of a sample."""

        def done(files: list[File]) -> None:
            for file in files:
                self.samples.hand_over(file)

        self.making.start(lambda job: samples.sample(name), done)

    def _ask(self) -> None:
        """Show the fields that these files need."""
        kind = uploads.family(self.files) if self.files else None
        self.mu.visible = kind not in (None, "npz")
        self.reverse.visible = self.walls.visible = kind in ("pegs", "solved")
        self.calibration.visible = uploads.lists_pressures(self.files)
        for field in (self.box, self.pressure, self.around, self.gravity):
            field.visible = kind == "table"
        self.tolerance.visible = kind in ("table", "blocks")
        self.read.visible = self.mu.visible and not uploads.missing(self.files)

    def _dropped(self, new: list[tuple[str, bytes]]) -> None:
        self._refuse("")
        self._clear()  # earlier files
        try:
            self.files = uploads.added(self.files, new)
        except InputError as error:
            self._refuse(error_line(error))
            return
        self._ask()
        absent = [uploads.WORDS[part] for part in uploads.missing(self.files)]
        taken = "; ".join(
            f"{name} was read as the {uploads.WORDS[part]}"
            for part, (name, _) in self.files.items()
        )
        self._wait(f"{taken}. Now drop the {' and the '.join(absent)}." if absent else "")
        if not absent:
            self._read()

    def _read(self) -> None:
        self._refuse("")
        try:
            options = self._options()
        except InputError as error:
            self._refuse(error_line(error))
            return
        loose = uploads.loose(self.files) and not (options["box"] or options["gravity"])
        self._wait(HOLD_WANTED if loose else "")
        if loose:
            return
        if uploads.family(self.files) in ("pegs", "solved"):
            self._clear()
            self.task.start(photoelastic_frames.infer(self.files, **options), self._compare)
            return
        self.task.start(uploads.bring(self.state.library, self.files, **options), self._show)

    def _options(self) -> dict[str, Any]:
        kind = uploads.family(self.files)
        options: dict[str, Any] = (
            {} if kind == "npz" else {"mu": friction(typed(_entered(self.mu)))}
        )
        if kind in ("pegs", "solved"):
            options |= {"reverse": self.reverse.value, "walls": self.walls.value or None}
        if given := self.calibration.visible and _entered(self.calibration):
            numbers = map(number_or_nan, given.replace(",", " ").split())
            options["calibration"] = checked_calibration(list(numbers))
        if tolerance := self.tolerance.visible and _entered(self.tolerance):
            options["tolerance"] = positive(typed(tolerance), "Tolerance")
        if kind == "table":
            options |= self._holding()
        return options

    def _holding(self) -> dict[str, Any]:
        """The options of a table on what holds its disks."""
        sides = _entered(self.box).replace(",", " ").split()
        if len(sides) not in (0, 2, 3):
            raise InputError(
                "enter the two sides of the box, such as 30, 30, and its tilt, if any; leave "
                "it empty for an open packing"
            )
        box = [positive(typed(side), "a side of the box") for side in sides[:2]] or None
        gravity = _entered(self.gravity) or "0"
        options = {
            "box": box,
            "tilt": make_cell(box, _tilt(sides[2])).tilt if box and sides[2:] else 0.0,
            "walls": self.around.value or None,
            "gravity": positive(typed(gravity), "Gravity", or_zero=True),
        }
        pressure = _entered(self.pressure)
        if pressure and not (box and uploads.loose(self.files)):
            raise InputError(IDLE_PRESSURE)
        return options | ({"pressure": positive(typed(pressure), "Pressure")} if pressure else {})

    def _show(
        self, brought: uploads.Brought, frame: photoelastic_frames.Frame | None = None
    ) -> None:
        """Report, and open the packing; its walk is computed at once."""
        self.brought = brought
        self._report()
        self.state.measured = frame and photoelastic_frames.measured(frame, brought.params)
        mu = brought.params["mu"]
        self.state.ask(Selection(brought.params, mu, states=STATES), at_once=True)

    def _report(self, *events: Any) -> None:
        """Show the report, at the friction on screen if the packing is there."""
        brought, cell = self.brought, self.state.cell
        if brought is None:
            return
        report = brought.report
        if cell and cell.selection.packing.get("imported") == brought.params["imported"]:
            report = uploads.at_friction(report, self.state.replay)
        rows = "".join(ROW.format(*map(html.escape, row)) for row in uploads.report_rows(report))
        self.report.object = f"<p>{html.escape(brought.source)}</p>" + REPORT.format(rows)

    def _compare(self, frame: photoelastic_frames.Frame) -> None:
        """Compare measured and inferred forces."""
        options = self._options()
        shown = measured.Frames(frame, dict(self.files), self.task, self.open, **options)
        self.frame[:] = shown.panel()

    def open(self, frame: photoelastic_frames.Frame) -> None:
        """Open a frame as a packing like any other."""
        if self.task.running:
            return
        packing, source = frame.packing, f"{frame.source}, frame {frame.report['frame']}"
        self.task.start(
            uploads.keep(self.state.library, packing, source),
            lambda brought: self._show(brought, frame),
        )

    def _clear(self) -> None:
        self.brought, self.report.object = None, ""
        self.frame[:] = []

    def _wait(self, line: str) -> None:
        """Say what is still missing; empty if nothing is."""
        self.waiting.param.update(title=line, visible=bool(line))

    def _refuse(self, line: str) -> None:
        self.error.param.update(title=line, visible=bool(line))


def _entered(field: pmui.TextInput) -> str:
    """The text of a field, also before Enter was pressed."""
    return (field.value_input or field.value).strip()


def _tilt(text: str) -> float:
    try:
        return number(text)
    except ValueError:
        raise InputError(f"the tilt must be a number, got {brief(text)}") from None
