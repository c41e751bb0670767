"""A photoelastic frame: measured and inferred forces, the network, and a report."""

import html
from collections.abc import Callable
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui
from bokeh.models import ColumnDataSource
from bokeh.plotting import figure as Figure

from ....background.jobs import Task
from ....browser.panel_patches import together
from ....results import photoelastic_frames
from ....results.photoelastic_frames import Frame
from ....results.saved_file import File
from ....results.uploads import Files
from ....widgets.file_buttons import Handover
from ....widgets.parts import PRIMARY, by_words, figure, note
from ....widgets.plot_style import BLUE, ORANGE, corner, hover, legend_above
from ....widgets.select import Select
from . import frame_picture

COMPONENTS = (("fₙ", BLUE), ("fₜ", ORANGE))
SHOWN = {
    "inferred": "Inferred", "measured": "Measured", "beside": "Both",
    "deviation": "Difference in σ",
}  # fmt: skip
TOLD = 12  # contacts that are listed
PLAYED_MS = 700  # per frame of a series
WIDE = {"sizing_mode": "stretch_width", "margin": 0}
HALF = WIDE | {"styles": {"flex": "1 1 240px"}, "min_width": 240}  # one of two, if both fit


class Frames:
    """The frames of the uploaded files, one at a time."""

    def __init__(
        self,
        first: Frame,
        files: Files,
        task: Task,
        on_open: Callable[[Frame], object],
        **options: Any,
    ) -> None:
        """on_open(frame): called to open the frame as a packing; options: of `infer`."""
        self.files, self.task, self.options = files, task, options
        self.known = {first.report["frame"]: first}
        self.frame, self.playing = first, 0
        self.choice = Select(label="Forces", options=by_words(SHOWN), value="inferred", width=180)
        self.choice.param.watch(lambda event: together(self._dress), "value")
        self.pictures = pn.Row(styles={"flex-wrap": "wrap"}, **WIDE)
        self.save = Handover(
            self._hand_over, files={"This frame": {"table": "All contacts (CSV)"}}, margin=(4, 10)
        )
        self.open = pmui.Button(label="Open as a packing", margin=(4, 10), **PRIMARY)
        self.open.on_click(lambda event: on_open(self.frame))
        self.player = pn.widgets.DiscretePlayer(
            label="frame", options=list(first.numbers), value=first.report["frame"],
            interval=PLAYED_MS, loop_policy="loop", visible=len(first.numbers) > 1,
            show_loop_controls=False, **WIDE,
        )  # fmt: skip
        self.player.param.watch(lambda event: self._turn(event.new), "value")
        self.findings, self.listed, self.stresses = note(), note(), note()
        self.compared = pn.pane.Bokeh(**WIDE)
        self._fill(first)

    def panel(self) -> list[Any]:
        """All parts, from the top."""
        return [
            self.player, self.findings, self.choice, self.pictures, self.open, note(OPENED),
            self.listed, self.compared, self.stresses, self.save,
        ]  # fmt: skip

    def _turn(self, number: int) -> None:
        """Show another frame: from memory, or after inference, while the player waits."""
        if number in self.known:
            self._show(self.known[number])
        elif not self.task.running:
            self.playing = self.player.direction
            self.player.pause()
            work = photoelastic_frames.infer(self.files, frame=number, **self.options)
            self.task.start(work, self._inferred)

    def _inferred(self, frame: Frame) -> None:
        self.known[frame.report["frame"]] = frame
        self._show(frame)
        if self.player.value not in self.known:  # changed in the meantime
            self._turn(self.player.value)
        else:
            self.player.direction = self.playing

    def _show(self, frame: Frame) -> None:
        together(self._fill, frame=frame)

    def _fill(self, frame: Frame) -> None:
        self.frame = frame
        rows = "".join(
            f"<p style='margin:5px 0'>{html.escape(line)}</p>"
            for line in photoelastic_frames.account(frame.report)
        )
        head = f"<p><b>{html.escape(frame.source)}</b>, frame {frame.report['frame']}</p>"
        self.picture, self.layers = frame_picture.network(frame)
        self.pictures[:] = self._panes()
        self.findings.object = head + rows + findings(frame.report)
        self.listed.object = listed(frame)
        self.compared.object = compared(frame)
        self.stresses.object = stresses(frame)

    def _panes(self) -> list[Any]:
        """The chosen quantities in one or two pictures, styled before they are visible."""
        shown, one = self.choice.value, self.picture
        both = shown == "beside"
        frame_picture.dress(one, self.layers, "inferred" if both else shown, small=both)
        old: Any = self.pictures[0] if len(self.pictures) else None
        first = pn.pane.Bokeh(one, **HALF) if old is None or old.object is not one else old
        if not both:
            return [first]
        other, layers = frame_picture.network(self.frame, x_range=one.x_range, y_range=one.y_range)
        frame_picture.dress(other, layers, "measured", small=True)
        return [first, pn.pane.Bokeh(other, **HALF)]

    def _dress(self) -> None:
        self.pictures[:] = self._panes()

    def _hand_over(self, key: str) -> None:
        name = f"frame{self.frame.report['frame']}.csv"
        self.save.hand_over(File(name, "text/csv", photoelastic_frames.table(self.frame)))


OPENED = """
Open as a packing makes this frame the packing of the page, with its inferred forces and with wall
forces held fixed. Intervals, pulls and outlines then show which other forces balance allows.
"""


def findings(report: dict[str, Any]) -> str:
    """The findings by kind and line, collapsed."""
    if not report["findings"]:
        return ""
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in report["findings"])
    return f"<details><summary>Repairs, line by line</summary><ul>{lines}</ul></details>"


def compared(frame: Frame) -> Figure:
    """Figure of inferred against measured forces, for measured contacts."""
    fig = figure("photoelastic_forces", None, "measured / ⟨mₙ⟩", "inferred / ⟨mₙ⟩", height=340)
    measured = np.isfinite(frame.measured).all(axis=1)
    drawn, ends = [], [0.0]
    for part, (label, colour) in enumerate(COMPONENTS):
        x, y, error = (
            values[measured, part] for values in (frame.measured, frame.inferred, frame.error)
        )
        ends += [x.min(initial=0), x.max(initial=0), y.min(initial=0), y.max(initial=0)]
        source = ColumnDataSource(
            {
                "x": x, "y": y, "low": y - error, "high": y + error,
                "contact": np.flatnonzero(measured),
            },
            name=f"photoelastic_{'nt'[part]}",
        )  # fmt: skip
        fig.segment("x", "low", "x", "high", source=source, color=colour, alpha=0.2)
        drawn.append(
            fig.scatter(
                "x", "y", source=source, size=4, alpha=0.5, color=colour, legend_label=label
            )
        )
    ends = [min(ends), max(ends)]
    fig.line(ends, ends, color="#888888", line_dash="dashed", legend_label="as measured")
    fig.add_tools(hover(drawn, ("measured", "@x{0.00}"), ("inferred", "@y{0.00}")))
    legend_above(fig)
    corner(fig, "inferred: in balance, within friction")
    return fig


def listed(frame: Frame) -> str:
    """Suspects and certain contacts as sentences."""

    def named(c: int) -> str:
        one, two = frame.ids[frame.ends[c]]
        return f"{one:g}–{two:g}" if two >= 0 else f"{one:g}–wall"

    suspects = [
        f"{named(c)} ({np.nanmax(np.abs(frame.deviation[c])):.1f} σ)" for c in frame.suspects[:TOLD]
    ]
    certain = [
        f"{named(c)} ({frame.inferred[c, 0]:.2f} ± {frame.error[c, 0]:.2f} ⟨mₙ⟩)"
        for c in frame.certain[:TOLD]
    ]
    sentences = []
    for count, words, some in (
        (len(frame.suspects), "Measured contacts beyond 3 σ", suspects),
        (
            len(frame.certain),
            "Contacts that were not measured but certainly carry force, by 2 σ",
            certain,
        ),
    ):
        more = ", …" if count > len(some) else ""
        sentences.append(f"<p>{words} ({count}){': ' if some else ''}{', '.join(some)}{more}.</p>")
    return "".join(sentences)


def stresses(frame: Frame) -> str:
    """The stress by region as a table, with the top of the picture above."""
    side = round(len(frame.stress) ** 0.5)
    rows = []
    for b in reversed(range(side)):
        cells = []
        for a in range(side):
            k = a * side + b
            lines = (
                f"{name} {value:.2f} ± {error:.2f}"
                for name, value, error in zip(
                    ("σₓₓ", "σᵧᵧ", "σₓᵧ"), frame.stress[k], frame.stress_error[k], strict=True
                )
            )
            cells.append(f"<td>{'<br>'.join(lines)}</td>")
        rows.append(f"<tr>{''.join(cells)}</tr>")
    head = "Stress by region, relative to the mean pressure (y points up in the picture)"
    return f"<table class='claims'><caption>{head}</caption>{''.join(rows)}</table>"
