"""Force space in a plane: all networks found, the one on screen, and the outline of S."""

from typing import Any

import numpy as np
import panel as pn

from granforce.records import InputError

from ....background.jobs import Job, reading
from ....background.notifications import observe
from ....results import planes, progress_feed
from ....results.planes import Outlined, Plane
from ....results.replays import Replay
from ....state.app_state import AppState
from ....state.view_settings import PLANES
from ....widgets.parts import TabView, folded, note, plotted, question
from . import sentences
from .other_states import MARKED, OtherStates
from .space_figure import Columns, SpaceFigure

WHOLE = "principal", "stress"  # planes that do not depend on the selected contact
# Width over height: next to the packing a window is no higher than this; on a wide screen force
# space has its own column.
ASPECT, WIDE_ASPECT = 1.7, 1.15
COMING = "Networks appear as they are sampled."
GROWS = "Networks appear as they are sampled; the exact outline of S follows."
ONE_POINT = "At h = 0 the forces are determined: S is one point."


class View(TabView):
    """A plane of force space; the player moves the state on screen along the path."""

    name = "plane"

    def __init__(self, state: AppState) -> None:
        super().__init__(state, "shown", "looks.contact", "looks.pair", "work.fourfold")
        self.drawing = SpaceFigure(self.name, self._choose)
        self.planes = question("Plane", PLANES, self.looks, "axes", width=310, margin=(4, 8))
        self.task, self.placing = state.work.task(), state.work.task(reading)
        self.others = OtherStates(state, self._show_others)
        self.lead, self.finding, self.details = note("Placing the networks …"), note(), note()
        self.planes.param.watch(self.refresh, "value")
        self.looks.param.watch(self._span, "contact")
        self.looks.param.watch(self._title, "dark")
        self.looks.param.watch(self._fit, "wide")
        observe(self._explain, state.knowledge, "narrowed", "known")
        self.shown: tuple[Any, ...] | None = None
        self.outlined: Outlined | None = None
        self._fit()
        self.catch_up()

    def panel(self) -> pn.Column:
        """Plot, choice of the plane, and explanation."""
        wide = {"sizing_mode": "stretch_width"}
        return pn.Column(
            self.lead, plotted(self.drawing.figure), self.planes, self.finding, self.details,
            self.others.switch, **wide,
        )  # fmt: skip

    def _fit(self, *events: Any) -> None:
        self.drawing.figure.aspect_ratio = WIDE_ASPECT if self.looks.wide else ASPECT

    # Contents

    def update(self) -> None:
        """Place the states on screen in the plane, and look up or compute the outline."""
        state, replay = self.state, self.state.shown
        if replay is None:
            return
        request = replay, self.kind, *self._depends()
        same = self.shown is not None and self.shown[0] is replay and self.shown[1:] == request[1:]
        if same and state.plane is not None:
            return
        if self.shown is None or self.shown[0] is not replay:
            self._clear()
            self.others.look()
        self.shown = request
        self.task.cancel()
        self.placing.cancel()
        if request[1] in WHOLE:
            self._place(replay, request[1])
            return
        try:
            self._placed(replay, self._components(replay))
        except InputError as error:
            self._clear()
            self.details.object = str(error)

    @property
    def kind(self) -> str:
        """The chosen plane; during a walk, the plane of its states replaces the first pair."""
        first = self.planes.value == "pair" and self.looks.pair is None
        return "principal" if first and self.state.growing else self.planes.value

    def _depends(self) -> tuple[Any, ...]:
        """Dependencies of a plane of the chosen kind, in addition to the states."""
        state, kind = self.state, self.kind
        if kind == "pair":
            return (self.looks.pair,)
        if kind == "contact":
            return (self.looks.contact,)
        return (state.work.fourfold,) if kind == "principal" and state.growing else ()

    def _place(self, replay: Replay, kind: str) -> None:
        """Compute axes that take a moment; during a walk, from the states so far."""
        state = self.state
        library, following = state.library, state.work.live if state.growing else None
        selection = following.selection if following else state.cell.selection
        states = following.states() if following and state.work.fourfold else None
        if kind == "principal" and following and states is None:
            self._clear()  # too few for axes
            self.details.object = COMING
            return

        def place(job: Job) -> Plane:
            if kind == "stress":
                return planes.stress(library, selection, replay)
            return planes.principal(replay, states)

        self.placing.start(place, lambda plane: self._placed(replay, plane))

    def _clear(self) -> None:
        """Remove everything that belongs to another plane."""
        self.state.plane = self.outlined = None
        self.finding.object = self.lead.object = ""
        self.drawing.clear()

    def _placed(self, replay: Replay, plane: Plane) -> None:
        state = self.state
        if state.shown is not replay:
            return
        self.show_plane(replay, plane)
        if state.growing:
            self.details.object = GROWS
            return
        if replay.summary["dimension"] == 0:
            self.details.object = ONE_POINT
            return
        work = planes.outline(state.library, state.cell, replay, plane)
        self.task.start(work, lambda outlined: self.show_outline(replay, outlined))

    def _components(self, replay: Replay) -> Plane:
        """The plane of one contact's forces, or of two contacts' normal forces."""
        if self.planes.value == "contact":
            contact = self.looks.contact
            contact = _loosest(replay) if contact is None else contact
            return planes.components(replay, (contact, 0), (contact, 1))
        across, up = self.looks.pair or planes.strong_pair(replay)
        return planes.components(replay, (across, 0), (up, 0))

    def _choose(self, row: int) -> None:
        """Show the network that was clicked."""
        if not self.state.growing:
            self.looks.frame = row

    def _span(self, event: Any) -> None:
        """A clicked contact replaces the green one of a pair."""
        pair = self.state.plane.pair if self.state.plane is not None else []
        if self.shown is None or self.shown[1:] != ("pair", self.looks.pair):
            return  # another plane was requested, for example by Back
        if self.visible and pair and event.new not in (None, *pair):
            self.looks.pair = event.new, pair[1]

    def show_plane(self, replay: Replay, plane: Plane) -> None:
        """Show path, original network and cone; the outline follows."""
        self.state.plane = plane
        frame = min(self.looks.frame, len(plane.path) - 1)
        self.drawing.show(plane, self._path(replay, plane), frame)
        self._title()
        self.drawing.draw_cone(plane, replay.summary["mu"], 1.05 * float(plane.path[:, 0].max()))
        self.details.object = self.finding.object = ""
        self.outlined = None
        self._show_others()
        self._explain()

    def _explain(self, *events: Any) -> None:
        """Say what is drawn, and how many dimensions held forces leave."""
        replay, plane, whole = self.state.shown, self.state.plane, self.state.knowledge.whole
        if replay is not None and plane is not None:
            left = None if whole is None or self.state.elsewhere else whole.dimension[1]
            self.lead.object = sentences.lead(replay, plane, self.outlined is not None, left)

    def _title(self, *events: Any) -> None:
        if self.state.plane is not None and self.state.shown is not None:
            self.drawing.title(self.state.shown, self.state.plane, self.looks.dark)

    def _path(self, replay: Replay, plane: Plane) -> Columns:
        """Columns of the path; during a walk the player adds states as they arrive."""
        path, number = plane.path, replay.number
        if self.state.growing:
            number = progress_feed.numbers(replay.summary)
            path = np.full((len(number), 2), np.nan, dtype=np.float32)
            path[0] = plane.path[0]
        return {"x": path[:, 0].copy(), "y": path[:, 1].copy(), "state": number.astype(np.int32)}

    def show_outline(self, replay: Replay, outlined: Outlined) -> None:
        """Show the outline of S in its plane, unless another packing is on screen by now."""
        if self.shown is not None and self.shown[0] is not replay:  # another one arrived meanwhile
            return
        self.show_plane(replay, outlined.plane)
        self.outlined = outlined
        self.drawing.outline(outlined)
        reach = 1.05 * float(outlined.outer[:, 0].max())
        self.drawing.draw_cone(outlined.plane, replay.summary["mu"], reach)
        self._explain()
        self._tell(outlined)

    def _show_others(self) -> None:
        """Show the other states in the plane on screen."""
        plane, replay, other = self.state.plane, self.state.replay, self.others.replay
        if other is None or plane is None:
            self.drawing.beside.data = {"x": [], "y": []}
        else:
            x, y = planes.points(plane, replay, other).T
            self.drawing.beside.data = {"x": x.astype(np.float32), "y": y.astype(np.float32)}
        if self.outlined is not None and self.outlined.plane is plane:
            self._tell(self.outlined)

    def _tell(self, outlined: Outlined) -> None:
        """Report how much of the outline the states reach."""
        if outlined.plane.kind == planes.STRESS:
            self.details.object = sentences.stresses(outlined)
            return
        replay, others, called = self.state.replay, np.empty((0, 2)), ""
        if self.others.replay is not None:
            others = np.column_stack([self.drawing.beside.data[name] for name in "xy"])
            called = MARKED[self.others.kind]
        self.finding.object = sentences.finding(outlined, replay, others, called)
        self.details.object = folded(sentences.computed(outlined, replay))


def _loosest(replay: Replay) -> int:
    """The contact whose normal force varied most."""
    return int(np.argmax(replay.high[:, 0] - replay.low[:, 0]))
