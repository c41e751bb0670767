"""Small pictures of packings, to choose among: a few disks, and forces that change between them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import param

from granforce.records import Packing
from granforce.types import Floats, Integers

from ..browser.bundle import Scripted
from ..browser.messages import Message
from ..results import geometry
from ..widgets.plot_style import EDGE, GREY

HALF = 5.0  # of the part that is seen, in largest radii
FRAMES = 16  # networks that a picture goes through


class Glimpses(Scripted):
    """Pictures side by side, one of which is clicked; see glimpse.js."""

    items = param.List(doc="of each: [SVG, widths of its lines, network after network, words]")

    def __init__(self, chosen: Callable[[int], object]) -> None:
        """chosen(k): the k-th picture was clicked."""
        super().__init__(sizing_mode="stretch_width", margin=(2, 8), visible=False)
        self._chosen = chosen

    def _heard(self, message: Message) -> None:
        if 0 <= message["pick"] < len(self.items):
            self._chosen(message["pick"])


def glimpse(packing: Packing, backbone: Integers, normal: Floats) -> list[Any]:
    """The middle of a packing as [SVG, widths]: disks, and lines as wide as their normal forces.

    backbone (N_c,): its contacts, as positions in the packing. normal (F, N_c): their f_n in ⟨f_n⟩
    in FRAMES networks or more.
    """
    x, half = packing.cell.wrapped(packing.x), HALF * packing.r.max()
    disks = geometry.disks(packing, x, backbone)
    links = geometry.links(packing, x, backbone)
    left, right, low, high = geometry.square(x, packing)
    middle = np.array([left + right, low + high]) / 2

    def near(across: Floats, up: Floats) -> Any:
        away = np.maximum(np.abs(across - middle[0]), np.abs(up - middle[1]))
        return away < half + 2 * packing.r.max()

    seen, drawn = near(disks.x, disks.y), near(links.x0, links.y0)
    circles = "".join(
        f'<circle cx="{a:.2f}" cy="{b:.2f}" r="{r:.2f}"/>'
        for a, b, r in zip(disks.x[seen], disks.y[seen], disks.r[seen], strict=True)
    )
    ends = (side[drawn] for side in (links.x0, links.y0, links.x1, links.y1))
    lines = "".join(
        f'<path d="M{a:.2f} {b:.2f}L{c:.2f} {d:.2f}"/>' for a, b, c, d in zip(*ends, strict=True)
    )
    corner, side = middle - half, 2 * half
    picture = (
        f'<svg viewBox="{corner[0]:.2f} {corner[1]:.2f} {side:.2f} {side:.2f}" aria-hidden="true">'
        f'<g fill="{EDGE}" fill-opacity="0.4" stroke="{EDGE}" stroke-width="0.04">{circles}</g>'
        f'<g stroke="{GREY}" stroke-linecap="round">{lines}</g></svg>'
    )
    frames = np.linspace(0, len(normal) - 1, FRAMES).astype(int)
    width = geometry.CHAIN_WIDTH * normal[frames][:, links.contact[drawn]]
    return [picture, np.round(width, 3).ravel().tolist()]
