"""The player: replays the walk in the browser; the server does nothing per frame."""

from pathlib import Path
from typing import ClassVar

import numpy as np
import param
from panel.custom import JSComponent


class Player(JSComponent):
    """Buttons, scrub slider and live numbers; see player.js.

    The frames are shipped once, in `walk`; the plots are found in the page by their names.
    """

    walk = param.Dict(default={}, doc="arrays of a Replay, see `frames`")

    _esm = Path(__file__).with_name("player.js")
    _stylesheets: ClassVar = [Path(__file__).with_name("player.css")]

    def show(self, replay):
        """Ship the frames of a replay."""
        self.walk = frames(replay) if replay is not None else {}


def frames(replay):
    """What the player needs of a Replay: flat float32 arrays, frame after frame."""
    return {
        "normal": replay.normal.ravel(),
        "tangential": replay.tangential.ravel(),
        "contacts": replay.normal.shape[1],
        "number": replay.number.astype(np.int32),
        "distance": replay.distance.astype(np.float32),
        "residual": replay.residual.astype(np.float32),
        "order": replay.order.astype(np.int32),
        "mu": replay.summary["mu"],
        "states": replay.summary["states"],
    }
