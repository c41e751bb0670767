"""Disks and contacts, for drawing: plain arrays. Scripts add their periodic images."""

import numpy as np

from granforce.records import Packing
from granforce.types import Floats, Integers

# Width of the strip around the cell in which images are drawn, in units of `unit`; see images.js.
MARGIN = 1.0
# Largest distance from the centre of the contact suggested for dragging, in half view widths.
NEAR = 0.45
SHORT = 0.7  # half the length of a wall of unknown ends, in radii of the disk that touches it
# Width of a force chain with the mean normal force, in units of `unit`, and the default change in
# ⟨f_n⟩ for full colour.
CHAIN_WIDTH, FULL_CHANGE = 0.23, 0.5
FULL_DEVIATION = 4.0  # deviation from the measurement, in σ, for full colour


def bodies(packing: Packing) -> int:
    """The number of disks or bodies; grains that follow them are behind walls."""
    if "disks" in packing.info:
        return packing.info["disks"]
    return len(packing.r) - packing.info.get("walls", 0)


def walls(packing: Packing, backbone: Integers) -> Floats:
    """Ends (k, 4) of walls as given, else of short lines along them where they are touched."""
    if len(packing.walls):
        return packing.walls
    touched = backbone[packing.contacts.j[backbone] >= bodies(packing)]
    at, c = packing.contact_points[touched], packing.contacts.picked(touched)
    along = SHORT * packing.r[c.i, None] * c.tangent
    return np.column_stack([at - along, at + along])


def unit(packing: Packing) -> float:
    """The largest radius, length; of bodies, half the median ℓ: fixed ones may be large."""
    if packing.shapes is None or not len(packing.contacts.i):
        return float(packing.r.max())
    return float(np.median(packing.contacts.length) / 2)


def outlines(packing: Packing) -> list[list[float]]:
    """Corners of each body relative to its centre, flat; empty for a disk. [] if all are disks."""
    if packing.shapes is None:
        return []
    bodies = zip(packing.shapes.polygons(), packing.x, strict=True)
    return [(corners - centre).ravel().tolist() for corners, centre in bodies]


def square(x: Floats, packing: Packing) -> tuple[float, float, float, float]:
    """(x_low, x_high, y_low, y_high) of a square around the cell (or the grains, if open)."""
    margin = MARGIN * unit(packing)
    periodic = np.isfinite(packing.box)
    corner, opposite = packing.cell.bounding_box
    r, shapes = packing.r[:, None], packing.shapes
    ends = np.concatenate([x - r, x + r])
    if shapes is not None:
        corners = shapes.polygons()
        round_ones = np.array([len(body) == 0 for body in corners])
        ends = np.concatenate([ends[np.tile(round_ones, 2)], *corners])
    low = np.where(periodic, corner, ends.min(axis=0))
    high = np.where(periodic, opposite, ends.max(axis=0))
    middle, half = (low + high) / 2, (high - low).max() / 2 + margin
    corners = np.stack([middle - half, middle + half], axis=1)
    x_low, x_high, y_low, y_high = corners.ravel().tolist()
    return x_low, x_high, y_low, y_high


def lines(packing: Packing, x: Floats, backbone: Integers) -> tuple[Floats, Floats]:
    """Start and extent (N_c, 2) of the line of each contact of the backbone.

    From the centre of grain i to that of j, or to a wall; of bodies, through the contact along n.
    """
    if packing.shapes is not None:
        return packing.through_contacts(backbone, np.tile([1.0, 0.0], (len(backbone), 1)))
    c = packing.contacts.picked(backbone)
    length = np.where(c.j < bodies(packing), c.length, c.arm_i)  # to a wall, not behind it
    return x[c.i], length[:, None] * c.normal


def inviting(middles: Floats, normal: Floats, window: tuple[float, ...]) -> int | None:
    """The strongest contact near the centre of the window, by f_n (N_c,); None without one.

    middles (N_c, 2): of the lines.
    """
    x_low, x_high, y_low, y_high = window
    away = np.abs(2 * middles - [x_low + x_high, y_low + y_high]).max(axis=1)
    force = np.where(away < NEAR * (x_high - x_low), normal, -1.0)
    return int(np.argmax(force)) if force.max(initial=-1.0) >= 0 else None
