"""The player: draws the packing and replays states in the browser; no server work per frame."""

from pathlib import Path
from typing import ClassVar

import numpy as np
import param
from panel.custom import JSComponent

from .scripts import joined

FOLDER = Path(__file__).parent


class Player(JSComponent):
    """Packing on canvases, with buttons, scrub slider and live numbers; see player.js.

    The frames are shipped once, in `walk`. Plots beside it are found in the page by their names;
    any ColumnDataSource with the tags ["follows", NAME, TAB] has its single row moved along the
    columns of the source called NAME, one row of which belongs to each frame, while TAB is visible.
    """

    walk = param.Dict(default={}, doc="geometry and frames of a Replay, see `frames`")
    exact = param.Dict(default={}, doc="low, high (N_c,) of exact intervals of f_n in ⟨f_n⟩")
    palettes = param.Dict(default={}, doc="colours, see style.palettes")
    source = param.String(doc="where the states come from, in words")
    busy = param.Boolean()
    contact = param.Integer(default=None, allow_None=True)
    frame = param.Integer(default=0)
    reference = param.Integer(default=0)
    between = param.List(default=None, allow_None=True)
    tab = param.String()
    colour = param.String(default="mobilised")
    thickness = param.String(default="normal")
    overlay = param.Boolean()
    scale = param.String(default="mean")
    displacement = param.Array(default=None, doc="flat (2N,) displacements of the grains")

    _esm = joined("seen", "scene", "player")
    _stylesheets: ClassVar = [FOLDER / "player.css"]

    def __init__(self, **params):
        super().__init__(**params)
        self.on_digit = None

    def _handle_msg(self, message):
        """Digits pressed anywhere on the page."""
        if self.on_digit is not None and isinstance(message.get("tab"), int):
            self.on_digit(message["tab"])


def frames(replay):
    """What the player needs of a Replay: flat arrays, frame after frame, and the geometry."""
    disks, links = replay.disks, replay.links
    whole = {"contact", "i", "j"}
    radius = np.zeros(replay.summary["n"])
    radius[disks.grain] = disks.r
    return {
        "normal": replay.normal.ravel(),
        "tangential": replay.tangential.ravel(),
        "contacts": replay.normal.shape[1],
        "number": replay.number.astype(np.int32),
        "distance": replay.distance.astype(np.float32),
        "residual": replay.residual.astype(np.float32),
        "attempts": replay.attempts.astype(np.float32),
        "low": np.ascontiguousarray(replay.low[:, 0]),
        "high": np.ascontiguousarray(replay.high[:, 0]),
        "backbone": replay.backbone.astype(np.int32),
        "mu": replay.summary["mu"],
        "states": replay.summary["states"],
        "box": [float(side) if np.isfinite(side) else -1.0 for side in replay.box],
        "window": list(replay.window),
        "x": disks.x,
        "y": disks.y,
        "r": disks.r,
        "grain": disks.grain.astype(np.int32),
        "touching": disks.contacts.astype(np.int32),
        # rows of style's disk colours: whole, rattler, image, image of a rattler
        "kind": (2 * disks.image + (disks.contacts == 0)).astype(np.int8),
        "radius": radius,
        **{
            name: values.astype(np.int32) if name in whole else values
            for name, values in links._asdict().items()
        },
    }
