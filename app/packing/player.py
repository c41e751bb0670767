"""The player: draws the packing and replays states in the browser, without the server."""

from typing import Any

import numpy as np
import param
from bokeh.document import Document

from ..browser.bundle import Scripted
from ..browser.messages import Array, forward, from_browser
from ..results.geometry import CHAIN_WIDTH, FULL_CHANGE, FULL_DEVIATION
from ..results.replays import Replay, worded
from ..state.app_state import AppState
from ..state.view_settings import Appearance
from .replay.stream import Stream

# Messages to the script: forces in ⟨f_n⟩, arrays flat.
NETWORK = {"normal": Array, "tangential": Array, "residual": float}
NETWORKS = NETWORK | {"residual": Array}  # several, one after the other
# The networks through which f_n of a contact can be pulled, and what stops it at both ends.
RAIL = NETWORKS | {"contact": int, "lower": float, "upper": float, "values": Array}
RAIL |= {"opened": Array, "sliding": Array, "whole": bool}
# A packing under compression: its box, disks, and contacts with their branch vectors.
PICTURE = {"mu": float, "box": [float, ...], "tilt": float, "fraction": float, "unbalance": float}
PICTURE |= {"x": Array, "radius": Array, "i": Array, "j": Array, "reach": Array}
PICTURE |= {"normal": Array, "tangential": Array}
# States of a walk in progress, one after the other, each with the numbers shown next to it.
STATES = {"normal": Array, "tangential": Array, "number": Array, "residual": Array}
STATES |= {"eta1": Array, "eta2": Array, "eta3": Array}

SCALES = {"width": CHAIN_WIDTH, "change": FULL_CHANGE, "deviation": FULL_DEVIATION}


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
        {"bounds": {"low": Array, "high": Array}, "number": int},
    )

    walk = param.Dict(default={}, doc="geometry and frames of a Replay, see `frames`")
    exact = param.Dict(default={}, doc="low, high (N_c,) of exact intervals of f_n in ⟨f_n⟩")
    loads = param.Array(default=None, doc="(N_c,) limit loads in ⟨f_n⟩, where colour or width ask")
    reduction = param.Array(default=None, doc="(N_c,) of ΔF_n in ⟨f_n⟩ by what is known, or None")
    measured = param.Dict(default={}, doc="of a frame, see packing.measured")
    most = param.Number(default=0.0, doc="ΔF_n in ⟨f_n⟩ at which its colour is full")
    pins = param.Dict(default={}, doc="contacts that are known, and to measure; see packing.pins")
    thrust = param.Dict(
        default={}, doc="where resultants at joints can pass, see drawing/thrust.js"
    )
    plane = param.Dict(default={}, doc="of force space on screen, see packing.projection")
    palettes = param.Dict(default={}, doc="colours, see style.palettes")
    scales = param.Dict(default=SCALES, doc="width and full colours of chains, see look.js")
    live = param.Boolean(doc="whether something is being computed that can be seen")
    requested = param.String(doc="the requested selection if it is not on screen, in words")
    legend = param.String(doc="HTML: what colour and width show")
    keepable = param.Boolean(doc="whether more networks of the walk could be stored")
    source = param.String(doc="where the states come from, in words")
    busy = param.Boolean()
    twin = param.Dict(default={}, doc="its frames, as `walk`, with its `exact`")
    zoom = param.List(default=None, allow_None=True, doc="x, y, half width of what is seen; or all")
    between = param.List(default=None, allow_None=True)
    displacement = param.Array(default=None, doc="flat (2N,) displacements of the grains")

    def __init__(self, state: AppState, document: Document | None = None, **params: Any) -> None:
        """document: provides the timer of `stream`; without one, call its `tick` yourself."""
        super().__init__(**params)
        self._state, self.stream = state, Stream(state, self, document)
        state.hand.tell = self.tell

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
    _choose_tab = forward("_state.looks.choose_tab", tab=int)
    _fit = forward("_state.looks.fit", wide=bool)
    # All networks of the walk are stored, then the one with this number is shown.
    _keep = forward("_state.keep_all", keep=int)


def frames(replay: Replay, room: int = 0) -> dict[str, Any]:
    """The data of a Replay for the player: flat arrays, frame after frame, and the geometry.

    room: number of frames of a growing replay.
    """
    disks, links = replay.disks, replay.links
    whole = {"contact", "i", "j"}
    radius = np.zeros(replay.summary["n"])
    radius[disks.grain] = disks.r
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
        "seconds": replay.summary.get("seconds", 0.0),  # that the walk took
        "box": [float(side) if np.isfinite(side) else -1.0 for side in replay.box],
        "tilt": replay.tilt,
        "window": list(replay.window),
        "inviting": replay.inviting,
        "origin": worded(replay, "as packed"),
        "x": disks.x,
        "y": disks.y,
        "r": disks.r,
        "grain": disks.grain.astype(np.int32),
        "touching": disks.contacts.astype(np.int32),
        # rows of the style's disk colours: whole, rattler, image, image of a rattler
        "kind": (2 * disks.image + (disks.contacts == 0)).astype(np.int8),
        "radius": radius,
        "unit": replay.unit,
        "outlines": replay.outlines,
        "walls": replay.walls.ravel(),
        "bodies": replay.bodies,
        **{
            name: values.astype(np.int32) if name in whole else values
            for name, values in links._asdict().items()
        },
    }
