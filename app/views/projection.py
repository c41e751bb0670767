"""Force space in a plane: the states' path, the state on screen, and the outline of S."""

import numpy as np
import panel as pn
import panel_material_ui as pmui
from bokeh.models import ColumnDataSource, DataRange1d

from granforce.records import InputError

from .. import projections
from ..jobs import reading
from .parts import Seen, choice, figure, note
from .progress import Progress
from .style import DARK, DOT, ORIGINAL, PALE, hover, quiet_legend

PLANES = {
    "principal": "principal axes",
    "contact": "fₙ, fₜ of a contact",
    "pair": "fₙ of two contacts",
}


class View(Seen):
    """A plane of force space; the player moves the state on screen along the path."""

    name, title = "projection", "Force space"

    def __init__(self, state):
        super().__init__(state, "replay", "contact")
        empty = {"x": [], "y": []}
        self.path = ColumnDataSource(empty | {"state": []}, name="path")
        self.here = ColumnDataSource(empty, name="here", tags=["follows", "path", self.name])
        self.original = ColumnDataSource(empty)
        self.inner, self.outer = (ColumnDataSource(empty, name=n) for n in ("inner", "outer"))
        self.cone = ColumnDataSource(empty)
        self.figure = self._figure()
        self.planes = choice(PLANES, "principal")
        self.other = pmui.IntInput(
            label="second contact", value=0, start=0, size="small", width=130, margin=(2, 8)
        )
        self.task, self.projecting = state.task(), state.task(reading)
        self.told = note()
        for widget in (self.planes, self.other):
            widget.param.watch(self.refresh, "value")
        self.task.param.watch(self._failed, "message")
        self.shown = None
        self.catch_up()

    def panel(self):
        """Choice of the plane, plot, and what it says."""
        return pn.Column(
            pn.FlexBox(self.planes, self.other, sizing_mode="stretch_width"),
            pn.pane.Bokeh(self.figure, sizing_mode="stretch_width", margin=0),
            Progress(self.task),
            self.told,
            sizing_mode="stretch_width",
        )

    # Contents

    def update(self):
        """Project the states on screen, and have the outline looked up or computed."""
        state, replay = self.state, self.state.replay
        self.other.visible = self.planes.value == "pair"
        if replay is None:
            return
        wanted = replay, self.planes.value, state.contact, self.other.value
        if wanted[1] == "principal":
            wanted = wanted[:2]  # does not depend on a contact
        if self.shown is not None and self.shown[0] is replay and self.shown[1:] == wanted[1:]:
            return
        self.shown = wanted
        self.task.cancel()
        self.projecting.cancel()
        if wanted[1] == "principal":
            self.projecting.start(
                lambda job: projections.principal(replay),
                lambda plane: self._projected(replay, plane),
            )
            return
        try:
            self._projected(replay, self._components(replay))
        except InputError as error:
            self.told.object = str(error)

    def _projected(self, replay, plane):
        state = self.state
        self._show(replay, plane)
        if replay.summary["dimension"] == 0:
            self.told.object = "At h = 0 the forces are determined: S is one point."
            return
        work = projections.outline(state.library, state.cell, replay, plane)
        self.task.start(work, lambda found: self._outlined(replay, found))

    def _components(self, replay):
        """The plane of one contact's forces, or of two contacts' normal forces."""
        contact = self.state.contact
        if contact is None:
            contact = int(np.argmax(replay.high[:, 0] - replay.low[:, 0]))
        if self.planes.value == "contact":
            return projections.components(replay, (contact, 0), (contact, 1))
        other = int(np.searchsorted(replay.backbone, self.other.value or 0))
        if other == len(replay.backbone) or replay.backbone[other] != self.other.value:
            raise InputError(f"contact {self.other.value} carries no load; choose another")
        return projections.components(replay, (contact, 0), (other, 0))

    def _show(self, replay, plane):
        """Path, original and cone; the outline is to come."""
        x, y = plane.path.T
        frame = min(self.state.frame, len(x) - 1)
        self.path.data = {"x": x.copy(), "y": y.copy(), "state": replay.number.astype(np.int32)}
        self.original.data = {"x": x[:1], "y": y[:1]}
        self.here.data = {"x": x[frame : frame + 1].copy(), "y": y[frame : frame + 1].copy()}
        self.inner.data = self.outer.data = {"x": [], "y": []}
        self.figure.xaxis.axis_label, self.figure.yaxis.axis_label = projections.labels(
            replay, plane
        )
        # Distances mean something among principal axes: both then have the same scale.
        self.figure.match_aspect = not plane.components
        self.cone.data = self._cone(plane, 1.05 * float(x.max()))
        self.told.object = ""

    def _outlined(self, replay, found):
        self._show(replay, found.plane)
        for source, corners in ((self.inner, found.inner), (self.outer, found.outer)):
            closed = np.concatenate([corners, corners[:1]])
            source.data = {"x": closed[:, 0], "y": closed[:, 1]}
        self.cone.data = self._cone(found.plane, 1.05 * float(found.outer[:, 0].max()))
        part = np.ptp(found.plane.path[1:], axis=0) / np.ptp(found.outer, axis=0)
        area = projections.area(projections.hull(found.plane.path[1:]))
        area /= projections.area(found.outer)
        states = len(found.plane.path) - 1
        self.told.object = (
            f"Shaded: the exact outline of S in this plane ({found.programs} linear programs, "
            f"{found.seconds:.1f} s, known to {found.gap:.1g} ⟨fₙ⟩). The {states} states shown span"
            f" {part[0]:.0%} of it across, {part[1]:.0%} upwards and {area:.1%} of its area."
        )

    def _cone(self, plane, reach):
        """Coulomb's cone of one contact, up to f_n = reach."""
        if len({contact for contact, _ in plane.components}) != 1:
            return {"x": [], "y": []}
        mu = self.state.replay.summary["mu"]
        return {"x": [reach, 0, reach], "y": [mu * reach, 0, -mu * reach]}

    def _failed(self, event):
        if event.new:
            self.told.object = event.new

    def _figure(self):
        around = {"range_padding": 0.06, "only_visible": True}
        fig = figure(
            "force_space",
            None,
            "",
            "",
            x_range=DataRange1d(**around),
            y_range=DataRange1d(**around),
            aspect_ratio=1.08,
            sizing_mode="scale_width",
            match_aspect=True,
        )
        fig.patch(
            "x", "y", source=self.outer, fill_color=PALE, fill_alpha=0.35, line_color=DARK,
            line_width=1.6, legend_label="outline of S",
        )  # fmt: skip
        fig.patch("x", "y", source=self.inner, fill_alpha=0, line_color=DARK, line_alpha=0.4)
        outlines = list(fig.renderers)
        fig.line("x", "y", source=self.cone, line_dash="dashed", color="#888888")
        fig.line("x", "y", source=self.path, color=DARK, line_alpha=0.35, line_width=0.8)
        states = fig.scatter(
            "x", "y", source=self.path, size=4, color=DARK, alpha=0.65, legend_label="states"
        )
        fig.scatter(
            "x", "y", source=self.original, marker="diamond", size=15, color=ORIGINAL,
            line_color="#333333", legend_label="original",
        )  # fmt: skip
        fig.scatter(
            "x", "y", source=self.here, size=11, color=DOT, line_color="white", line_width=1.5,
            legend_label="now",
        )  # fmt: skip
        # The state on screen moves too often to be looked at for the range.
        fig.x_range.renderers = fig.y_range.renderers = [*outlines, states]
        quiet_legend(fig, "top_left")
        fig.add_tools(hover([states], ("state", "@state"), ("at", "@x{0.00}, @y{0.00}")))
        return fig
