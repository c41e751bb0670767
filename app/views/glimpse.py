"""Small pictures of packings, to choose among: a few disks and the forces between them."""

from collections.abc import Callable

import numpy as np
import param

from granforce.records import Packing

from .. import geometry
from .messages import Message
from .scripts import Scripted
from .style import EDGE, GREY

HALF = 5.0  # of the part that is seen, in largest radii


class Glimpses(Scripted):
    """Pictures side by side, one of which is clicked; see glimpse.js."""

    items = param.List(doc="[SVG, words] of each")

    def __init__(self, chosen: Callable[[int], object]) -> None:
        """chosen(k): the k-th picture was clicked."""
        super().__init__(sizing_mode="stretch_width", margin=(2, 8), visible=False)
        self._chosen = chosen

    def _heard(self, message: Message) -> None:
        if 0 <= message["pick"] < len(self.items):
            self._chosen(message["pick"])


def glimpse(packing: Packing) -> str:
    """The middle of a packing as SVG: disks, and lines as wide as their normal forces."""
    x, half = packing.cell.wrapped(packing.x), HALF * packing.r.max()
    pressing = np.flatnonzero(packing.forces[:, 0] > 0)
    force = packing.forces[pressing, 0] / packing.forces[pressing, 0].mean()
    disks = geometry.disks(packing, x, pressing)
    links = geometry.links(packing, x, pressing)
    low, high, bottom, top = geometry.square(x, packing)
    middle = np.array([low + high, bottom + top]) / 2
    seen = np.hypot(disks.x - middle[0], disks.y - middle[1]) < 1.5 * half + disks.r
    circles = "".join(
        f'<circle cx="{a:.2f}" cy="{b:.2f}" r="{r:.2f}"/>'
        for a, b, r in zip(disks.x[seen], disks.y[seen], disks.r[seen], strict=True)
    )
    near = np.hypot(links.x0 - middle[0], links.y0 - middle[1]) < 1.5 * half + packing.r.max()
    lines = "".join(
        f'<path d="M{a:.2f} {b:.2f}L{c:.2f} {d:.2f}" stroke-width="{width:.2f}"/>'
        for a, b, c, d, width in zip(
            *(side[near] for side in (links.x0, links.y0, links.x1, links.y1)),
            geometry.CHAIN_WIDTH * force[links.contact[near]],
            strict=True,
        )
    )
    corner, side = middle - half, 2 * half
    return (
        f'<svg viewBox="{corner[0]:.2f} {corner[1]:.2f} {side:.2f} {side:.2f}" aria-hidden="true">'
        f'<g fill="{EDGE}" fill-opacity="0.4" stroke="{EDGE}" stroke-width="0.04">{circles}</g>'
        f'<g stroke="{GREY}" stroke-linecap="round">{lines}</g></svg>'
    )
