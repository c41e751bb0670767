"""Force space in a plane: the states' path, the state on screen, and the outline of S."""

from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui
from bokeh.core.properties import value
from bokeh.models import ColumnDataSource, DataRange1d
from bokeh.plotting import figure as Figure

from granforce.records import InputError

from ....background.jobs import Job, reading
from ....browser.panel_patches import together
from ....results import compute, planes, progress_feed
from ....results.library import Shown
from ....results.planes import Outlined, Plane
from ....results.replays import Replay
from ....state.app_state import AppState
from ....state.view_settings import PLANES
from ....widgets.parts import (
    LATER,
    MOVES,
    TabView,
    figure,
    folded,
    note,
    one_of_several,
    plotted,
    question,
)
from ....widgets.plot_style import DARK, DOT, ORIGINAL, PALE, SERIES, STATES, hover, legend_above
from ....widgets.progress import Progress
from . import sentences, stress_sentences
from .annotations import Standing

# What is offered beside states of a kind, and what the others are called.
ALSO = {"walk": "also show uniformly sampled networks", "uniform": "also show the walk"}
CALLED = {"uniform": "uniformly sampled networks", "walk": "walk"}
MARKED = {"uniform": "uniform ones (triangles)", "walk": "networks of the walk (triangles)"}
ENOUGH = 300  # states beside those shown, where they have to be computed

Columns = dict[str, Any]  # of a ColumnDataSource

WHOLE = "principal", "stress"  # planes that are the same whatever contact is selected

COMING = "The networks come as they are found; the first few tell how to look at them."
GROWS = "The networks come as they are found; the exact outline of S follows."

LEAD = (
    "<b>Each dot is one whole network, like the one drawn in the packing.</b> S, the set of all "
    "networks that balance, has {free} dimensions, one for each free number. The blue shape is its "
    "shadow (projection): we look at two of the forces."
)
# Before the first gesture, which is to find out how far S goes.
LEAD_FIRST = (
    "<b>Each dot is one whole set of forces:</b> across its green force, up its violet one. "
    "<b>The red dot is what you see in the packing.</b> The blue ones were found at random, and "
    "none lies beyond the dashed line."
)
# The point goes along an axis by itself, see point.js.
SWEEPS = ("Sweep across ↔", "Sweep up and down ↕")
SWEEPS_OF_A_PAIR = ("Sweep the green force ↔", "Sweep the violet force ↕")
SWEEP = 'button.document.get_model_by_name("player").player.hand.spot.sweep(axis)'


class View(TabView):
    """A plane of force space; the player moves the state on screen along the path."""

    name = "plane"

    def __init__(self, state: AppState) -> None:
        super().__init__(state, "seen", looks=["contact", "pair", "fresh"], work=["fourfold"])
        empty: Columns = {"x": [], "y": []}
        self.path = ColumnDataSource(empty | {"state": []}, name="path")
        self.here = ColumnDataSource(empty, name="here", tags=["follows", "path", self.name])
        self.original, self.beside = ColumnDataSource(empty), ColumnDataSource(empty)
        self.inner, self.outer = (ColumnDataSource(empty, name=n) for n in ("inner", "outer"))
        self.cone = ColumnDataSource(empty)
        self.figure = self._figure()
        self.planes = question("Plotted", PLANES, self.looks, "axes")
        self.task, self.placing = state.work.task(told=False), state.work.task(reading, told=False)
        self.also = pmui.Switch(label=ALSO["walk"], margin=(10, 8))
        self.others = state.work.task()  # who finds other states
        self.other: Replay | None = None  # of those
        self.also.param.watch(lambda event: together(self._fetch), "value")
        self.lead, self.finding, self.told = note(), note(), note()
        self.sweeps = [_sweep(label, axis) for axis, label in enumerate(SWEEPS)]
        self.placing.param.watch(self.failed, "message")
        self.planes.param.watch(self.refresh, "value")
        self.looks.param.watch(self._span, "contact")
        self.looks.param.watch(self._title, "dark")
        self.task.param.watch(self.failed, "message")
        self.shown: tuple[Any, ...] | None = None
        self.found: Outlined | None = None
        self.catch_up()

    def panel(self) -> pn.Column:
        """Choice of the plane, plot, and what it says."""
        wide = {"sizing_mode": "stretch_width"}
        return pn.Column(
            self.lead,
            plotted(self.figure),
            self.finding,
            pn.FlexBox(*self.sweeps, styles=LATER, **wide),
            pn.Column(self.planes, styles=LATER, **wide),
            Progress(self.task),
            pn.Column(self.told, self.also, styles=LATER, **wide),
            Progress(self.others),
            **wide,
        )

    # Contents

    def update(self) -> None:
        """Place the states on screen in the plane, and have the outline looked up or computed."""
        state, replay = self.state, self.state.seen
        if replay is None:
            return
        free = replay.summary["dimension"]
        pair = self.kind == "pair"
        first = self.looks.fresh and pair and free > 0
        self.lead.object = "" if not free else LEAD_FIRST if first else LEAD.format(free=free)
        for button, label in zip(self.sweeps, SWEEPS_OF_A_PAIR if pair else SWEEPS, strict=True):
            button.param.update(label=label, visible=free > 0 and not state.growing)
        self.standing.hide(bool(first), self.found)
        self.invitation.glyph.text = value("then drag me" if first else "drag me")
        self.finding.visible = not first
        wanted = replay, self.kind, *self._depends()
        same = self.shown is not None and self.shown[0] is replay and self.shown[1:] == wanted[1:]
        if same and state.plane is not None:
            return
        if self.shown is None or self.shown[0] is not replay:
            self._look_beside()
        self.shown = wanted
        self.task.cancel()
        self.placing.cancel()
        if wanted[1] in WHOLE:
            self._place(replay, wanted[1])
            return
        try:
            self._placed(replay, self._components(replay))
        except InputError as error:
            self._clear()
            self.told.object = str(error)

    @property
    def kind(self) -> str:
        """The plane chosen; while a walk goes on, that of its states stands for the first pair."""
        first = self.planes.value == "pair" and self.looks.pair is None
        return "principal" if first and self.state.growing else self.planes.value

    def _depends(self) -> tuple[Any, ...]:
        """What a plane of the kind chosen depends on, beside the states."""
        state, kind = self.state, self.kind
        if kind == "pair":
            return (self.looks.pair,)
        if kind == "contact":
            return (self.looks.contact,)
        return (state.work.fourfold,) if kind == "principal" and state.growing else ()

    def _place(self, replay: Replay, kind: str) -> None:
        """Have axes found that need a moment; of a walk under way from what there is of it."""
        state = self.state
        library, following = state.library, state.work.live if state.growing else None
        selection = following.selection if following else state.cell.selection
        states = following.states() if following and state.work.fourfold else None
        if kind == "principal" and following and states is None:
            self._clear()  # too few for axes
            self.told.object = COMING
            return

        def place(job: Job) -> Plane:
            if kind == "stress":
                return planes.stress(library, selection, replay)
            return planes.principal(replay, states)

        self.placing.start(place, lambda plane: self._placed(replay, plane))

    def _clear(self) -> None:
        """Nothing of another plane stays."""
        self.state.plane = self.found = None
        self.finding.object = ""
        self.standing.clear()
        self.path.data = {"x": [], "y": [], "state": []}
        for source in (self.original, self.beside, self.here, self.inner, self.outer, self.cone):
            source.data = {"x": [], "y": []}

    def _placed(self, replay: Replay, plane: Plane) -> None:
        state = self.state
        if state.seen is not replay:
            return
        self._show(replay, plane)
        if state.growing:
            self.told.object = GROWS
            return
        if replay.summary["dimension"] == 0:
            self.told.object = "At h = 0 the forces are determined: S is one point."
            return
        work = planes.outline(state.library, state.cell, replay, plane)
        self.task.start(work, lambda found: self._outlined(replay, found))

    # Uniform states beside the walk, or the walk beside them

    def _look_beside(self) -> None:
        """Those of a store are shown; else the switch has them computed."""
        cell, self.other = self.state.cell, None
        if self.state.growing:
            return self._fetch()
        self.others.cancel()
        self.also.label = ALSO[cell.kind]
        found = planes.beside(self.state.catalogue, cell) is not None
        if self.also.value != found:
            self.also.value = found
        elif found:
            self._fetch()

    def _fetch(self, *events: Any) -> None:
        """Find or compute the other states, or take them away."""
        state, replay = self.state, self.state.replay
        self.others.cancel()
        self.other = None
        if not self.also.value or state.cell is None or state.growing:
            self.beside.data = {"x": [], "y": []}
            self.figure.legend[0].visible = False
            return
        found, own = planes.beside(state.catalogue, state.cell), state.cell.selection
        kind = "walk" if own.kind == "uniform" else "uniform"
        wanted = own._replace(kind=kind, states=min(own.states, ENOUGH))
        work = (
            compute.states(state.library, wanted)
            if found is None
            else lambda job: state.library.shown(found)
        )

        def done(shown: Shown) -> None:
            if state.replay is replay:
                self.other = shown.replay
                self._show_beside()
                if found is None:
                    state.refresh()  # it is listed from now on

        self.others.start(work, done)

    def _show_beside(self) -> None:
        """The other states, in the plane on screen."""
        plane, replay = self.state.plane, self.state.replay
        if self.other is None or plane is None:
            return
        x, y = planes.points(plane, replay, self.other).T
        self.beside.data = {"x": x.astype(np.float32), "y": y.astype(np.float32)}
        legend = self.figure.legend[0]
        legend.items[0].label, legend.visible = value(CALLED[self.other_kind]), True
        if self.found is not None and self.found.plane is plane:
            self._tell(self.found)

    def _components(self, replay: Replay) -> Plane:
        """The plane of one contact's forces, or of two contacts' normal forces."""
        if self.planes.value == "contact":
            contact = self.looks.contact
            contact = _loosest(replay) if contact is None else contact
            return planes.components(replay, (contact, 0), (contact, 1))
        across, up = self.looks.pair or planes.strong_pair(replay)
        return planes.components(replay, (across, 0), (up, 0))

    def _span(self, event: Any) -> None:
        """A contact that is clicked takes the place of the green one of a pair."""
        pair = self.state.plane.pair if self.state.plane is not None else []
        if self.shown is None or self.shown[1:] != ("pair", self.looks.pair):
            return  # another is asked for, as by the way back
        if self.visible and pair and event.new not in (None, *pair):
            self.looks.pair = event.new, pair[1]

    def _show(self, replay: Replay, plane: Plane) -> None:
        """Path, original and cone; the outline is to come."""
        self.state.plane = plane
        x, y = plane.path.T
        frame = min(self.looks.frame, len(x) - 1)
        self.path.data = self._path(replay, plane)
        self.original.data = {"x": x[:1], "y": y[:1]}
        self.here.data = {"x": x[frame : frame + 1].copy(), "y": y[frame : frame + 1].copy()}
        self.inner.data = self.outer.data = {"x": [], "y": []}
        self.standing.clear()
        self._title()
        # Distances mean something among principal axes: both then have the same scale.
        self.figure.match_aspect = not plane.components
        self.cone.data = self._cone(plane, 1.05 * float(x.max()))
        self.told.object = self.finding.object = ""
        self.found = None
        self._show_beside()

    def _title(self, *events: Any) -> None:
        if self.state.plane is not None and self.state.seen is not None:
            self.standing.title(self.state.seen, self.state.plane, self.looks.dark)

    def _path(self, replay: Replay, plane: Plane) -> Columns:
        """Columns of the path; of a walk under way the player fills in the states as they come."""
        path, number = plane.path, replay.number
        if self.state.growing:
            number = progress_feed.numbers(replay.summary)
            path = np.full((len(number), 2), np.nan, dtype=np.float32)
            path[0] = plane.path[0]
        return {"x": path[:, 0].copy(), "y": path[:, 1].copy(), "state": number.astype(np.int32)}

    def _outlined(self, replay: Replay, found: Outlined) -> None:
        self._show(replay, found.plane)
        self.found = found
        for source, corners in ((self.inner, found.inner), (self.outer, found.outer)):
            closed = np.concatenate([corners, corners[:1]])
            source.data = {"x": closed[:, 0], "y": closed[:, 1]}
        self.cone.data = self._cone(found.plane, 1.05 * float(found.outer[:, 0].max()))
        self.standing.show(found)
        self._tell(found)

    def _tell(self, found: Outlined) -> None:
        """How much of the outline the states reach."""
        if found.plane.kind == planes.STRESS:
            self.told.object = stress_sentences.told(found)
            return
        replay, others, called = self.state.replay, np.empty((0, 2)), ""
        if self.other is not None:
            others = np.column_stack([self.beside.data[name] for name in "xy"])
            called = MARKED[self.other_kind]
        self.finding.object = sentences.finding(found, replay, others, called)
        self.told.object = folded(sentences.computed(found, replay))

    @property
    def other_kind(self) -> str:
        """Where the states beside come from."""
        return "walk" if self.state.cell.kind == "uniform" else "uniform"

    def _cone(self, plane: Plane, reach: float) -> Columns:
        """Coulomb's cone of one contact, up to f_n = reach."""
        if len({contact for contact, _ in plane.components}) != 1:
            return {"x": [], "y": []}
        mu = self.state.seen.summary["mu"]
        return {"x": [reach, 0, reach], "y": [mu * reach, 0, -mu * reach]}

    def _figure(self) -> Figure:
        around = {"range_padding": 0.06, "only_visible": True}
        fig = figure(
            "force_space",
            None,
            "",
            "",
            x_range=DataRange1d(**around),
            y_range=DataRange1d(**around),
            aspect_ratio=1.3,  # with what is said below it, no taller than a window
            sizing_mode="scale_width",
            match_aspect=True,
        )
        outlines = [  # with their opacity, of what they are filled with and of their edge
            (
                fig.patch(
                    "x", "y", source=source, fill_color=PALE, fill_alpha=fill, line_color=DARK,
                    line_alpha=line, line_width=wide,
                ),
                fill,
                line,
            )
            for source, fill, line, wide in (
                (self.outer, 0.35, 1.0, 1.6), (self.inner, 0.0, 0.4, 1.0),
            )
        ]  # fmt: skip
        fig.line("x", "y", source=self.cone, line_dash="dashed", color="#888888")
        fig.scatter(
            "x", "y", source=self.beside, marker="triangle", size=5, color=SERIES[2], alpha=0.7,
            legend_label="beside",
        )  # fmt: skip
        states = fig.scatter(
            "x",
            "y",
            source=self.path,
            size=5,
            color=STATES,
            alpha=0.9,
        )
        diamond = fig.scatter(
            "x", "y", source=self.original, marker="diamond", size=15, color=ORIGINAL,
            line_color="#333333",
        )  # fmt: skip
        its_name = fig.text(
            "x", "y", source=self.original, text=value("as packed"), x_offset=-9,
            y_offset=-6, text_align="right", text_font_size="12px", text_font_style="bold",
            text_color=ORIGINAL,
        )  # fmt: skip
        here = fig.scatter(
            "x", "y", source=self.here, size=11, color=DOT, line_color="white", line_width=1.5,
        )  # fmt: skip
        self.invitation = fig.text(
            "x", "y", source=self.here, text=value("drag me"), x_offset=-14, y_offset=8,
            text_align="right", text_color="white", text_font_size="13px",
            background_fill_color=DOT, padding=4, border_radius=5, name="invitation", visible=False,
        )  # fmt: skip
        here.tags, fig.name = MOVES, "path_figure"
        # The state on screen moves too often to be looked at for the range.
        edges = [renderer for renderer, _, _ in outlines]
        fig.x_range.renderers = fig.y_range.renderers = [*edges, states]
        legend_above(fig)
        fig.legend[0].visible = False
        self.standing = Standing(fig, outlines, [diamond, its_name])
        fig.add_tools(hover([states], ("network", "@state"), ("at", "@x{0.00}, @y{0.00}")))
        return fig


def _sweep(label: str, axis: int) -> pmui.Button:
    """A button by which the point goes along an axis and back; pressed again, it stops."""
    button = one_of_several(label)
    button.js_on_click(args={"button": button, "axis": axis}, code=SWEEP)
    return button


def _loosest(replay: Replay) -> int:
    """The contact whose normal force varied most."""
    return int(np.argmax(replay.high[:, 0] - replay.low[:, 0]))
