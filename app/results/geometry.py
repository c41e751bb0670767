"""Disks and contacts with their periodic images, for drawing: plain arrays."""

from typing import NamedTuple

import numpy as np

from granforce.records import Packing
from granforce.types import Floats, Integers, Mask

# Width of the strip around the cell in which images are drawn, in units of `unit`.
MARGIN = 1.0
# Largest distance from the centre of the contact suggested for dragging, in half view widths.
NEAR = 0.45
SHORT = 0.7  # half the length of a wall of unknown ends, in radii of the disk that touches it
# Width of a force chain with the mean normal force, in units of `unit`, and the default change in
# ⟨f_n⟩ for full colour.
CHAIN_WIDTH, FULL_CHANGE = 0.23, 0.5
FULL_DEVIATION = 4.0  # deviation from the measurement, in σ, for full colour


class Disks(NamedTuple):
    """Visible disks and periodic images, k rows."""

    x: Floats  # (k,) length
    y: Floats
    r: Floats
    grain: Integers  # (k,) number of the grain
    contacts: Integers  # (k,) number of its contacts in the backbone
    image: Mask  # (k,) bool, whether the centre is outside the cell


class Links(NamedTuple):
    """Contacts of the backbone and their periodic images as segments, k rows."""

    # (k,) centre of grain i, length; of bodies, begin of a line through the contact along n
    x0: Floats
    y0: Floats
    x1: Floats  # (k,) that centre + ℓ n, a place at a wall, or end of the line
    y1: Floats
    contact: Integers  # (k,) position among the backbone's contacts
    i: Integers  # (k,) numbers of the two grains
    j: Integers


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


def inviting(links: Links, normal: Floats, window: tuple[float, ...]) -> int:
    """Row of the strongest contact near the centre of the window, by f_n (N_c,); −1 if none."""
    x_low, x_high, y_low, y_high = window
    away = np.maximum(
        np.abs(links.x0 + links.x1 - x_low - x_high), np.abs(links.y0 + links.y1 - y_low - y_high)
    )
    force = np.where(away < NEAR * (x_high - x_low), normal[links.contact], -1.0)
    return int(np.argmax(force)) if force.max(initial=-1.0) >= 0 else -1


def disks(packing: Packing, x: Floats, backbone: Integers) -> Disks:
    """Disks; x (N, 2) centres in the cell, backbone: (N_c,) positions of its contacts."""
    i, j = packing.contacts.i[backbone], packing.contacts.j[backbone]
    number = np.bincount(i, minlength=len(x)) + np.bincount(j, minlength=len(x))
    parts = []
    x, cell = x[: bodies(packing)], packing.cell
    r = packing.r[: len(x), None]
    at = cell.across(x)
    for moved, grain in cell.images(at - r, at + r, MARGIN * unit(packing)):
        image = np.full(len(grain), bool(np.any(moved)))
        place = x[grain] + moved
        parts.append((*place.T, packing.r[grain], grain, number[grain], image))
    return Disks(*(np.concatenate(field) for field in zip(*parts, strict=True)))


def links(packing: Packing, x: Floats, backbone: Integers) -> Links:
    """Segments of the backbone's contacts, given as positions in the packing."""
    i, j = packing.contacts.i[backbone], packing.contacts.j[backbone]
    c = packing.contacts.picked(backbone)
    begin, long = x[i], np.where(j < bodies(packing), c.length, c.arm_i)  # to a wall, not behind it
    reach = long[:, None] * c.normal
    if packing.shapes is not None:
        begin, reach = packing.through_contacts(backbone, np.tile([1.0, 0.0], (len(backbone), 1)))
    parts = []
    # A contact of a disk inside the cell may extend outside, and its image then enters the cell.
    cell = packing.cell
    end = begin + reach
    ends = cell.across(begin), cell.across(end)
    low, high = np.minimum(*ends), np.maximum(*ends)
    for moved, contact in cell.images(low, high, MARGIN * unit(packing)):
        placed = (*(begin[contact] + moved).T, *(begin[contact] + moved + reach[contact]).T)
        parts.append((*placed, contact, i[contact], j[contact]))
    return Links(*(np.concatenate(field) for field in zip(*parts, strict=True)))
