"""Convex polygons and disks in the plane: area, inertia, and where two of them touch.

Corners run anticlockwise. Two polygons are apart along an outward normal of one of their edges; the
largest of these distances is their gap. An edge that lies on an edge touches at both ends of the
part that they share, a corner on an edge at one point. Corner on corner no normal is determined, so
no contact can be made there unless the normal is given.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.records import InputError, float_array
from granforce.types import Floats, Mask

# Corners are left out if they bend the outline by less than this (in radians), which is rounding.
_STRAIGHT = 1e-9
# Where a surface is probed beyond the end of an edge, relative to its length; normals (in radians)
# that count as one; and how well a given normal separates bodies, relative to the larger.
_PROBE, _ALIKE, _SEPARATED = 1e-3, 1e-4, 1e-6


class Touch(NamedTuple):
    """Points at which two bodies touch."""

    points: Floats  # (k, 2) midway between the surfaces
    normal: Floats  # (2,) unit vector from the first body to the second
    gap: Floats  # (k,)


class Meeting(NamedTuple):
    """How two bodies lie to each other."""

    gap: float  # distance along the best normal, below 0 if they overlap
    touch: Touch | None
    cornered: bool  # whether they touch corner on corner, without a normal


def polygon(corners: npt.ArrayLike, name: str) -> Floats:
    """The corners (k, 2) of a convex polygon, anticlockwise, without corners that do not bend it.

    Two corners are kept: the ends of a thin wall, whose two edges face its two sides.

    Raises InputError naming it if they lie on one line otherwise, or it is not convex.
    """
    corners = float_array(corners, (-1, 2), name)
    if len(corners) == 2 and np.any(corners[0] != corners[1]):
        return corners
    while len(corners) > 2:
        edges = np.roll(corners, -1, axis=0) - corners
        bend = _bends(np.roll(edges, 1, axis=0), edges)
        flat = np.abs(bend) < _STRAIGHT
        if not flat.any():
            break
        corners = np.delete(corners, np.argmax(flat), axis=0)
    if len(corners) < 3:
        raise InputError(f"{name} needs three corners that do not lie on one line")
    turned = bend.sum() / (2 * np.pi)
    if not _convex(bend):
        away = corners - corners.mean(axis=0)
        around = corners[np.argsort(np.arctan2(away[:, 1], away[:, 0]))]
        edges = np.roll(around, -1, axis=0) - around
        if _convex(_bends(np.roll(edges, 1, axis=0), edges)):
            raise InputError(
                f"the corners of {name} are in the wrong order, so that its sides cross; list "
                "them one after the other around the body"
            )
        raise InputError(
            f"{name} is not convex: divide it into convex parts, and give the body as the list of "
            'these ([part, part] in Python, "parts" in JSON, a column part in CSV)'
        )
    return corners if turned > 0 else corners[::-1].copy()


def _convex(bend: Floats) -> bool:
    """Whether an outline with these bends turns once, always to the same side."""
    once = abs(abs(bend.sum()) / (2 * np.pi) - 1) <= 1e-6
    return once and bool(np.all(bend > 0) or np.all(bend < 0))


def _bends(before: Floats, after: Floats) -> Floats:
    """Angles by which the outline turns at each corner; 0 where an edge has no length."""
    across = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.arctan2(across, np.sum(before * after, axis=1))


def moments(corners: Floats) -> tuple[float, Floats, float]:
    """Area, centre of area (2,), and polar second moment of area about it, of a polygon (k, 2).

    Of two corners: length, middle, and polar second moment of length.
    """
    if len(corners) == 2:
        length = float(np.hypot(*(corners[1] - corners[0])))
        return length, corners.mean(axis=0), length**3 / 12
    first = corners.mean(axis=0)
    a = corners - first
    b = np.roll(a, -1, axis=0)
    twice = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    area = 0.5 * twice.sum()
    centre = ((a + b) * twice[:, None]).sum(axis=0) / (6 * area)
    polar = (twice * np.sum(a * a + a * b + b * b, axis=1)).sum() / 12
    return float(area), first + centre, float(polar - area * centre @ centre)


def polygons_meet(
    a: Floats,
    b: Floats,
    tolerance: float,
    beyond_a: Mask | None = None,
    beyond_b: Mask | None = None,
) -> Meeting:
    """The Meeting of two convex polygons (k, 2); surfaces up to a tolerance apart touch.

    beyond_a, beyond_b (k, 2): as of `goes_on`, by default no.
    """
    sides = _Sides(a, b, beyond_a), _Sides(b, a, beyond_b)
    gap = float(max(side.least.max() for side in sides))
    if abs(gap) > tolerance:
        return Meeting(gap, None, False)
    touches = []
    for side, sign in zip(sides, (1.0, -1.0), strict=True):
        for edge in np.flatnonzero(side.least >= -tolerance).tolist():
            touch = side.touch(edge, sign, tolerance)
            if touch is not None:
                touches.append((np.ptp(touch.points, axis=0).max(), touch))
    best = max(touches, key=lambda one: one[0], default=(0.0, None))[1]
    return Meeting(gap, best, best is None)


class _Sides:
    """The edges of one polygon, and the heights of another's corners above them."""

    def __init__(self, one: Floats, other: Floats, beyond: Mask | None = None) -> None:
        self.beyond = np.zeros((len(one), 2), dtype=bool) if beyond is None else beyond
        along = np.roll(one, -1, axis=0) - one
        self.length = np.hypot(*along.T)
        self.one, self.along = one, along / self.length[:, None]
        self.out = np.column_stack([self.along[:, 1], -self.along[:, 0]])
        away = other[None] - one[:, None]
        self.height = np.einsum("ekx,ex->ek", away, self.out)
        self.place = np.einsum("ekx,ex->ek", away, self.along)
        self.least = self.height.min(axis=1)

    def touch(self, edge: int, sign: float, tolerance: float) -> Touch | None:
        """Where the other's corners touch this edge; None if they meet it in its corners only."""
        near = np.flatnonzero(self.height[edge] <= tolerance)
        place, height = self.place[edge, near], self.height[edge, near]
        order = np.argsort(place)
        # A corner that meets the end of an edge touches it only if the surface goes straight on.
        margin = np.where(self.beyond[edge], -tolerance, tolerance)
        inside = (margin[0] < place) & (place < self.length[edge] - margin[1])
        ends = np.clip(place[order[[0, -1]]], 0.0, self.length[edge])
        if len(near) > 1 and ends[1] - ends[0] > tolerance:
            gap = np.interp(ends, place[order], height[order])
        elif inside.sum() == 1:
            ends, gap = place[inside], height[inside]
        else:
            return None
        out = self.out[edge]
        points = self.one[edge] + ends[:, None] * self.along[edge] + 0.5 * gap[:, None] * out
        return Touch(points, sign * out, gap)


def goes_on(corners: Floats, siblings: Sequence[Floats]) -> Mask:
    """Whether the surface goes straight on beyond the two ends (k, 2) of each edge of a polygon.

    siblings: the other parts of its body, corners (m, 2) or x, y, r of a disk.
    """
    along = np.roll(corners, -1, axis=0) - corners
    ends = np.stack([corners - _PROBE * along, corners + (1 + _PROBE) * along], axis=1)
    inwards = np.stack([-along[:, 1], along[:, 0]], axis=1)[:, None]
    probes = (ends + _PROBE**2 * inwards).reshape(-1, 2)
    covered = np.zeros(len(probes), dtype=bool)
    for one in siblings:
        if one.ndim == 1:
            covered |= np.hypot(*(probes - one[:2]).T) < one[2]
        else:
            covered |= _Sides(one, probes).height.max(axis=0) < 0
    return covered.reshape(-1, 2)


def corners_meet(a: Floats, b: Floats, angle: float, gap: float) -> Touch | None:
    """The Touch of two polygons corner on corner, with a normal at an angle (radians) to x.

    None if the normal does not separate them, to 10⁻⁶ of the larger.
    """
    apart = np.hypot(*np.moveaxis(a[:, None] - b, -1, 0))
    first, second = np.unravel_index(np.argmin(apart), apart.shape)
    at, normal = 0.5 * (a[first] + b[second]), np.array([np.cos(angle), np.sin(angle)])
    most = _SEPARATED * max(np.ptp(a), np.ptp(b))
    if np.max((a - at) @ normal) > most or np.min((b - at) @ normal) < -most:
        return None
    return Touch(at[None], normal, np.array([gap]))


def united(touches: Sequence[Touch], tolerance: float) -> list[Touch]:
    """Touches of parts of two bodies as those of the bodies: what adjoins on one line is one."""
    done: list[Touch] = []
    for touch in touches:
        adjoining = [other for other in done if _adjoin(other, touch, tolerance)]
        done = [other for other in done if not any(other is one for one in adjoining)]
        points = np.concatenate([one.points for one in (touch, *adjoining)])
        gap = np.concatenate([one.gap for one in (touch, *adjoining)])
        place = _places(points, touch.normal)
        ends = [np.argmin(place), np.argmax(place)][: 1 + bool(np.ptp(place) > tolerance)]
        done.append(touch._replace(points=points[ends], gap=gap[ends]))
    return done


def _adjoin(a: Touch, b: Touch, tolerance: float) -> bool:
    """Whether two touches have one normal and line, and share a place on it."""
    if a.normal @ b.normal < 1 - 0.5 * _ALIKE**2:
        return False
    if abs((b.points[0] - a.points[0]) @ a.normal) > tolerance:
        return False
    one, other = _places(a.points, a.normal), _places(b.points, a.normal)
    return bool(max(one.min(), other.min()) <= min(one.max(), other.max()) + tolerance)


def _places(points: Floats, normal: Floats) -> Floats:
    """Where points (k, 2) lie along t."""
    return points @ np.array([-normal[1], normal[0]])


def disk_meets(x: Floats, r: float, corners: Floats, tolerance: float) -> Meeting:
    """The Meeting of a disk, centre x (2,) and radius r, with a convex polygon (k, 2)."""
    sides = _Sides(corners, x[None])
    outside = int(np.argmax(sides.least))
    if sides.least[outside] < 0:
        return Meeting(float(sides.least[outside] - r), None, False)
    place = np.clip(sides.place[:, 0], 0.0, sides.length)
    nearest = sides.one + place[:, None] * sides.along
    distance = np.hypot(*(nearest - x).T)
    edge = int(np.argmin(distance))
    return disks_meet(x, r, nearest[edge], 0.0, tolerance)


def disks_meet(x: Floats, r: float, y: Floats, s: float, tolerance: float) -> Meeting:
    """The Meeting of two disks of centres x, y (2,) and radii r, s."""
    distance = float(np.hypot(*(y - x)))
    gap = distance - r - s
    if abs(gap) > tolerance or distance == 0:
        return Meeting(gap, None, False)
    normal = (y - x) / distance
    points = (x + (r + 0.5 * gap) * normal)[None]
    return Meeting(gap, Touch(points, normal, np.array([gap])), False)
