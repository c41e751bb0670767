"""The player: draws the packing and replays states in the browser, without the server."""

from collections.abc import Callable
from typing import Any

import numpy as np
import param

from ..browser.bundle import Scripted
from ..browser.messages import Message
from ..results.geometry import CHAIN_WIDTH, FULL_CHANGE, FULL_DEVIATION
from ..results.replays import Replay, worded
from ..state.view_settings import Appearance

SCALES = {"width": CHAIN_WIDTH, "change": FULL_CHANGE, "deviation": FULL_DEVIATION}


class Player(Scripted, Appearance):
    """Packing on canvases, with buttons, scrub slider and live numbers.

    Its script has parts: what is replayed and how (replay/), where and how it is drawn (drawing/),
    dragging of forces (hand/), and the bar, keys and tools around it.

    The frames are sent once, in `walk`. Plots next to it are found in the page by name; any
    ColumnDataSource with the tags ["follows", NAME, TAB] has its single row moved along the columns
    of the source called NAME, which have one row per frame, while TAB is visible.
    """

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

    def __init__(self, **params: Any) -> None:
        super().__init__(**params)
        # Handlers of "tab", "hand", "known", "wide" and "live", called with the message.
        self.hears: dict[str, Callable[[Any], object]] = {}

    def _heard(self, message: Message) -> None:
        for name, part in message.items():
            if name in self.hears:
                self.hears[name](part)


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
