"""The player: draws the packing and replays states in the browser, without the server."""

from typing import Any

import numpy as np
import param
from bokeh.document import Document

from ..background.notifications import observe
from ..browser.bundle import Scripted
from ..browser.messages import Array, forward, from_browser
from ..results import compute, progress_feed
from ..results.geometry import CHAIN_WIDTH, FULL_DEVIATION
from ..results.replays import Replay, worded
from ..state.app_state import AppState
from ..state.view_settings import Appearance
from ..widgets.plot_style import palettes
from .legend import (
    THRUST,
    exact_intervals,
    full_change,
    full_colour,
    jamming,
    legend,
    measured,
    pins,
    projection,
    reduction,
)
from .replay.stream import Stream

# Messages to the script: forces in ⟨f_n⟩, arrays flat.
NETWORK = {"normal": Array, "tangential": Array, "residual": float}
NETWORKS = NETWORK | {"residual": Array}  # several, one after the other
# The networks through which f_n of a contact can be pulled, and what stops it at both ends.
RAIL = NETWORKS | {"contact": int, "lower": float, "upper": float, "values": Array}
RAIL |= {"opened": Array, "sliding": Array, "whole": bool}
# A packing under compression: its box, disks, and contacts with their branch vectors.
PICTURE = {"mu": float, "box": [float, ...], "tilt": float, "fraction": float, "unbalance": float}
PICTURE |= {"centres": Array, "radius": Array, "i": Array, "j": Array, "reach": Array}
PICTURE |= {"normal": Array, "tangential": Array}
# States of a walk in progress, one after the other, each with the numbers shown next to it.
STATES = {"normal": Array, "tangential": Array, "number": Array, "residual": Array}
STATES |= {"eta1": Array, "eta2": Array, "eta3": Array}

# Parameters of the view that the player also knows, and those that it may change.
APPEARANCE = sorted(set(Appearance.param) - {"name"})
SHARED = (
    "contact", "frame", "colour", "thickness", "full", "stretch", "paused", "opened", "pulled",
)  # fmt: skip

SCALES = {"width": CHAIN_WIDTH, "deviation": FULL_DEVIATION}


class Player(Scripted, Appearance):
    """Packing on canvases, with buttons, scrub slider and live numbers.

    Its script has parts: what is replayed and how (replay/), where and how it is drawn (drawing/),
    dragging of forces (hand/), and the bar, keys and tools around it.

    The frames are sent once, in `walk`. Plots next to it are found in the page by name; any
    ColumnDataSource with the tags ["follows", NAME, TAB] has its single row moved along the columns
    of the source called NAME, which have one row per frame, while TAB is visible.

    A drag of a force (hand/drag_force.js): `grab` is answered with the rail or fan of networks
    along which the script then moves, and `pull` with the network `held` after release (see
    state/pulls.py).
    """

    to_browser = (
        {"rail": RAIL},  # in answer to `grab`
        {"rail": None},  # the contact cannot be pulled
        {"fan": NETWORKS | {"x": Array, "y": Array}},  # in answer to `grab_point`
        {"rail": None, "fan": None},
        {"held": NETWORK | {"pull": list}},  # the network after all pulls
        {"held": None},  # there are none: the states are on screen again
        {"picture": PICTURE, "number": int},  # of a computation; `painted` answers with the number
        {"states": STATES, "number": int},
    )

    walk = param.Dict(
        default={}, doc="geometry and frames of a Replay, see `frames`; where its player `begin`s"
    )
    exact = param.Dict(default={}, doc="low, high (N_c,) of exact intervals of f_n in ⟨f_n⟩")
    loads = param.Array(default=None, doc="(N_c,) limit loads in ⟨f_n⟩, where colour or width ask")
    reduction = param.Array(default=None, doc="(N_c,) of ΔF_n in ⟨f_n⟩ by what is known, or None")
    measured = param.Dict(default={}, doc="of a frame, see legend.measured")
    most = param.Number(default=0.0, doc="ΔF_n in ⟨f_n⟩ at which its colour is full")
    most_change = param.Number(doc="change of f_n in ⟨f_n⟩ at which its colour is full")
    pins = param.Dict(default={}, doc="contacts that are known, and to measure; see legend.pins")
    thrust = param.Dict(default={}, doc="where resultants at joints pass, see drawing/thrust.js")
    plane = param.Dict(default={}, doc="of force space on screen, see legend.projection")
    palettes = param.Dict(default={}, doc="colours, see plot_style.palettes")
    scales = param.Dict(default=SCALES, doc="width and full colours of chains, see chain_style.js")
    ignoring = param.Boolean(doc="whether forces are held that the networks do not have")
    live = param.Boolean(doc="whether something is being computed that can be seen")
    requested = param.String(doc="the requested selection if it is not on screen, in words")
    legend = param.String(doc="HTML: what colour and width show")
    keepable = param.Number(doc="expected s for storing all networks of the walk; 0: it is done")
    source = param.String(doc="where the states come from, in words")
    busy = param.Boolean()
    zoom = param.List(default=None, allow_None=True, doc="x, y, half width of what is seen; or all")
    motion = param.Dict(default={}, doc="flat field (2N,), contacts (N_c,), animated; see Motion")

    def __init__(self, state: AppState, document: Document | None = None) -> None:
        """document: provides the timer of `stream`; without one, call its `tick` yourself."""
        looks = state.looks
        super().__init__(
            name="player",  # its name for other components of the page
            sizing_mode="stretch_width",
            palettes=palettes(looks.dark),
            zoom=None if looks.zoom is None else list(looks.zoom),
            **{name: getattr(looks, name) for name in APPEARANCE},
            source=state.source,
            busy=state.work.busy,
        )
        self._state, state.hand.tell = state, self.tell
        for name in SHARED:
            self.param.watch(lambda event: looks.param.update({event.name: event.new}), name)
        self._shown = None
        self.param.watch(self._go, "zoom")
        looks.param.watch(self._follow, APPEARANCE)
        observe(self._follow, state, "source", "loads", "work.busy")
        observe(self._show, state, "shown", "exact", "measured", "knowledge.narrowed", "looks.full")
        observe(self._pin, state, "replay", "knowledge.known", "knowledge.ranked")
        observe(self._move, state, "motion")
        observe(self._compare_held, state, "shown", "replay", "knowledge.known")
        dress = self.param.update
        observe(lambda event: dress(plane=projection(event.new)), state, "plane")
        observe(lambda event: dress(palettes=palettes(event.new)), looks, "dark")
        observe(
            self._explain, state, "looks.colour", "looks.thickness", "looks.full", "looks.stretch",
            "looks.dark", "looks.tab", "looks.pulled", "shown", "exact", "loads",
            "measured", "knowledge.known", "knowledge.narrowed", "hand.pulls", "work.moving",
            "pushed",
        )  # fmt: skip
        observe(self._turn, looks, "tab")
        self._bounding = state.work.task(reported=False)
        observe(self._bound_thrust, state, "replay")
        self._show()
        self._bound_thrust()
        self._pin()
        self._compare_held()
        self._explain()
        self.stream = Stream(state, self, document)

    @from_browser(drawn=True, visible=bool)
    def _start(self, visible: bool) -> None:
        """The page was drawn anew: it shows neither pulls nor a walk in progress."""
        self.stream.start(visible)
        self._state.hand.show()

    _see = forward("stream.look", visible=bool)
    _confirm = forward("stream.confirm", painted=int)
    # A drag of a contact, and of the point in force space; then f_n is where it was released.
    _grab = forward("_state.hand.grab", grab=int)
    _pull = forward("_state.hand.pull", pull=[int, float])
    _grab_point = forward("_state.hand.grab_point", grab_point=True)
    _pull_point = forward("_state.hand.pull_point", pull_point=[float, float])
    _undo = forward("_state.hand.undo", undo=True)
    _free = forward("_state.hand.free", free=True)
    # f_n of a contact, and ± its error bar, is taken for known.
    _hold = forward("_state.knowledge.hold", hold=[int, float, float])
    _release = forward("_state.knowledge.release", release=int)
    _sample = forward("_state.sample_held", sample=True)
    _choose_tab = forward("_state.looks.choose_tab", tab=int)
    _fit = forward("_state.looks.fit", wide=bool)
    # All networks of the walk are stored, then the one with this number is shown.
    _keep = forward("_state.keep_all", keep=int)

    # What it is sent

    def _go(self, event: Any) -> None:
        """To another part of the picture; browsers send tuples as lists."""
        self._state.looks.zoom = None if event.new is None else tuple(event.new)

    def _follow(self, *events: Any) -> None:
        self.param.update({event.name: event.new for event in events})

    def _show(self, *events: Any) -> None:
        """Send related changes in one message."""
        state, looks, replay = self._state, self._state.looks, self._state.shown
        if replay is None:
            return
        exact = exact_intervals(state.drawn, replay)
        changes = {
            "exact": exact,
            "reduction": reduction(state.knowledge, replay) if state.obeys_held else None,
            "measured": measured(state, replay),
            "most": full_colour(state),
        }
        if self._shown is not replay:
            self._shown = replay
            room = len(progress_feed.numbers(replay.summary)) if state.growing else 0
            begin = {"begin": looks.frame, "rests": looks.paused and not state.growing}
            changes["walk"] = frames(replay, room) | begin
        changes["keepable"] = state.keepable
        self.param.update(changes)

    def _turn(self, event: Any) -> None:
        """Hide the held forces in the tab of pushes, which ignore them, and show them in others."""
        if self._state.knowledge.known and "perturb" in (event.old, event.new):
            self._show()

    def _bound_thrust(self, *events: Any) -> None:
        """Of bodies: compute where the resultants at their joints can pass."""
        state, replay = self._state, self._state.replay
        self.thrust = {}
        if replay is not None and replay.outlines and replay.summary["dimension"]:
            work = compute.thrust(state.library, state.cell)
            self._bounding.start(work, lambda bands: self._show_thrust(bands, replay))

    def _show_thrust(self, bands: dict[str, Any], replay: Replay) -> None:
        if replay is self._state.replay:
            self.thrust = bands
            self._explain()

    def _pin(self, *events: Any) -> None:
        self.pins = pins(self._state.knowledge)

    def _compare_held(self, *events: Any) -> None:
        self.ignoring = not self._state.obeying

    def _move(self, event: Any) -> None:
        motion = event.new
        self.motion = (
            {}
            if motion is None
            else {
                "field": motion.field.astype(np.float32).ravel(),
                "contacts": motion.contacts.astype(np.int8),
                "animated": motion.animated,
            }
        )

    def _explain(self, *events: Any) -> None:
        if self._state.work.moving:
            self.legend = jamming(self._state)
            return
        self.most_change = full_change(self._state)
        self.legend = legend(self._state) + (THRUST if self.thrust else "")


def frames(replay: Replay, room: int = 0) -> dict[str, Any]:
    """The data of a Replay for the player: flat arrays, frame after frame, and the geometry.

    room: number of frames of a growing replay.
    """
    return {
        "normal": replay.normal.ravel(),
        "tangential": replay.tangential.ravel(),
        "contacts": replay.normal.shape[1],
        "room": room,
        "number": replay.number.astype(np.int32),
        "residual": replay.residual.astype(np.float32),
        **{name: values.astype(np.float32) for name, values in replay.growth.items()},
        "low": np.ascontiguousarray(replay.low[:, 0]),
        "high": np.ascontiguousarray(replay.high[:, 0]),
        "backbone": replay.backbone.astype(np.int32),
        "mu": replay.summary["mu"],
        "friction": replay.friction,
        "free": replay.summary["dimension"],
        "states": replay.summary["states"],
        "box": [float(side) if np.isfinite(side) else -1.0 for side in replay.box],
        "tilt": replay.tilt,
        "window": list(replay.window),
        "inviting": replay.inviting,
        "centres": replay.centres.ravel(),
        "radius": replay.radius,
        "i": replay.i.astype(np.int32),
        "j": replay.j.astype(np.int32),
        "starts": replay.starts.ravel(),
        "reach": replay.reach.ravel(),
        "origin": worded(replay, "as packed"),
        "unit": replay.unit,
        "outlines": replay.outlines,
        "walls": replay.walls.ravel(),
    }
