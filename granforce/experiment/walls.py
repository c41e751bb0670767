"""Walls of a photoelastic frame: bodies on which grains press, in known directions.

A wall is an additional body of the packing. Its contacts have lever arm 0 on its side, so that its
torque does not count; its support is unknown, and its balance is left open. If a load cell measures
the force on a straight wall, the wall is balanced and held by an additional contact in the same
direction: the sum of the forces on the wall is in the same cone as each of them, and equals the
measured force.

Directions come from the angles listed by a solver, or from the nearest side of an outline: a box,
or an annulus (a circle if no grain is flagged −1, for the inner wall). Flags mark the grains at
walls. A flag on nearly all grains has another meaning; in that case, and without a flag, the grains
at the boundary of the frame are used.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import scipy  # which imports its parts on first use

from granforce.experiment.boundary import boundary
from granforce.experiment.listings.listing import Listing
from granforce.packing.importers.geometry import components
from granforce.records import Contacts, InputError, make_contacts, positive
from granforce.system.wording import number
from granforce.types import Floats, Integers, Mask

SIDES = ("left", "right", "bottom", "top")  # least and largest x, least and largest y
_NORMALS = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
_SHAPES = {"box": 4, "annulus": 4, "circle": 3}
# Name of the only wall if contacts have angles but no outline.
_ANY = "wall"
# Grains at a side are within this many mean radii of the outermost grain.
_AT_SIDE = 1.0
# A flag on more than this fraction of the grains does not mark walls, unless there are few grains.
_NEARLY_ALL, _FEW = 0.9, 20
# Largest mean distance, in mean radii, of the grains at walls from an outline that fits.
_NEAR = 0.75


class WallOutline(NamedTuple):
    """Walls around a frame."""

    shape: str  # box: x0, x1, y0, y1; annulus: centre x, y, inner and outer radius; circle: x, y, R
    numbers: tuple[float, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its walls."""
        return {"box": SIDES, "annulus": ("inner", "outer"), "circle": ("outer",)}[self.shape]

    def gaps(self, x: Floats, r: Floats) -> tuple[Floats, Floats]:
        """Gaps (N, walls) of disks, and the unit vectors (N, walls, 2) from them to the walls."""
        if self.shape == "box":
            low, high = np.array(self.numbers[::2]), np.array(self.numbers[1::2])
            away = np.stack([x - low, high - x], axis=-1).reshape(len(x), 4)
            return away - r[:, None], np.broadcast_to(_NORMALS, (len(x), 4, 2))
        from_centre = x - self.numbers[:2]
        distance = np.hypot(*from_centre.T)
        out = from_centre / np.maximum(distance, 1e-300)[:, None]
        gaps, ways = [self.numbers[-1] - distance - r], [out]
        if self.shape == "annulus":
            gaps.insert(0, distance - r - self.numbers[2])
            ways.insert(0, -out)
        return np.stack(gaps, axis=1), np.stack(ways, axis=1)

    def place(self, wall: int, reach: float) -> Floats:
        """Where the body of a wall is drawn: `reach` beyond its middle."""
        if self.shape == "box":
            x0, x1, y0, y1 = self.numbers
            half = np.array([x1 - x0, y1 - y0]) / 2 + reach
            return np.array([x0 + x1, y0 + y1]) / 2 + half * _NORMALS[wall]
        if self.names[wall] == "inner":
            return np.array(self.numbers[:2])
        return np.add(self.numbers[:2], [0.0, self.numbers[-1] + reach])


class WallContacts(NamedTuple):
    """Contacts of grains with walls."""

    grain: Integers  # (w,) int64
    wall: Integers  # (w,) int64, number of the wall
    normal: Floats  # (w, 2) from the grain to the wall
    forces: Floats  # (w, 2) f_n, f_t as measured; NaN if not measured
    factor: Floats  # (w,) of the variance
    names: tuple[str, ...]  # of the walls
    outline: WallOutline | None


def read_outline(text: str) -> str | WallOutline:
    """'open', 'box', 'annulus', 'circle' or 'auto' (found from the grains), or a WallOutline.

    With its numbers, such as box:0,100,0,80 or annulus:500,500,200,450. auto: the shape that fits
    best. Raises InputError.
    """
    shape, _, numbers = str(text).strip().partition(":")
    if shape in ("open", "auto") and not numbers:
        return shape
    if shape not in _SHAPES:
        raise InputError(f"walls are open, auto, {', '.join(_SHAPES)}, got {str(text)[:40]!r}")
    return _outline(shape, numbers) if numbers else shape


def _outline(shape: str, numbers: str) -> WallOutline:
    try:
        values = tuple(map(number, numbers.split(",")))
    except ValueError:
        values = ()
    if len(values) != _SHAPES[shape] or not np.all(np.isfinite(values)):
        raise InputError(f"walls {shape} need {_SHAPES[shape]} numbers, got {numbers[:40]!r}")
    if shape == "box" and not (values[0] < values[1] and values[2] < values[3]):
        raise InputError("walls box: x0,x1,y0,y1 must ascend")
    if shape == "annulus" and not 0 < values[2] < values[3]:
        raise InputError("walls annulus: x,y,inner,outer: the inner radius must be the smaller")
    if shape == "circle" and not values[2] > 0:
        raise InputError("walls circle: x,y,R: the radius must be above 0")
    return WallOutline(shape, values)


def read_wall_force(text: str) -> tuple[str, tuple[float, ...]]:
    """(name, (f_x, f_y, σ)) of 'right: fx fy sigma', the force of grains on a wall."""
    name, _, numbers = str(text).partition(":")
    try:
        values = tuple(map(number, numbers.replace(",", " ").split()))
    except ValueError:
        values = ()
    if len(values) != 3 or not np.all(np.isfinite(values)):
        raise InputError(f"--wall-force {str(text)[:40]!r}: give it as 'right: fx fy sigma'")
    positive(values[2], "the error of a wall's force")
    return name.strip(), values


def flagged(
    listing: Listing, flag: str | None, walls: str | WallOutline | None
) -> tuple[Floats, str | None]:
    """(N,) flags of grains at walls: not 0, and below 0 at an inner wall; and a note or None.

    flag: "ignore" to ignore those in the listing. walls: as returned by `read_outline`, or None.
    Raises InputError for another flag.
    """
    if flag not in (None, "ignore"):
        raise InputError(f"flag must be ignore, got {str(flag)[:40]!r}")
    given = listing.flag
    many, shaped = np.mean(given != 0), walls not in (None, "open")
    marked = given.any() or np.any(listing.ends < 0)
    believed = many <= _NEARLY_ALL or len(given) < _FEW
    if flag is None and believed and (marked or not shaped):
        if walls in ("annulus", "auto") and not np.any(given < 0):  # one flag for both walls
            at_hole = (boundary(listing.x, listing.r) < 0) & (given != 0)
            return np.where(at_hole, -1.0, given), None
        return given, None
    marks: Floats = (
        _nearest_side(listing, walls)
        if isinstance(walls, WallOutline)
        else (boundary(listing.x, listing.r).astype(np.float64))
    )
    if flag == "ignore" or not given.any():
        return marks, None
    shape = "annulus" if np.any(marks < 0) else "box"
    return marks, (
        f"{np.sum(given != 0)} of {len(given)} grains are flagged as touching a wall, so the flag "
        f"is ignored, and the {np.sum(marks != 0)} grains at the boundary of the frame count as "
        f"those at walls (as with --flag ignore); --walls {shape} or auto makes walls of the "
        "boundary"
    )


def _nearest_side(listing: Listing, outline: WallOutline) -> Floats:
    gap = outline.gaps(listing.x, listing.r)[0]
    at = gap.min(axis=1) <= _AT_SIDE * listing.r.mean()
    inner = outline.names[0] == "inner"
    return np.where(at, np.where(inner & (gap.argmin(axis=1) == 0), -1.0, 1.0), 0.0)


def wall_contacts(
    listing: Listing,
    x: Floats,
    r: Floats,
    at_wall: Mask,
    walls: str | WallOutline | None,
    reach: float,
) -> WallContacts | None:
    """The WallContacts of a frame, or None if its walls are open.

    at_wall (N,): grains at walls. walls: as returned by `read_outline`, or None for angles if they
    are listed. reach: gap in mean radii up to which a grain at a wall touches a side.
    """
    if walls == "open":
        return None
    lines = _wall_lines(listing)
    if walls is None:
        return _by_directions(lines)
    if isinstance(walls, WallOutline):
        return _by_outline(lines, walls, x, r, at_wall, reach)
    return _by_outline(lines, fitted(walls, x, r, at_wall, listing.flag), x, r, at_wall, reach)


class _WallLines(NamedTuple):
    """The lines of a listing that join a grain and a wall."""

    grain: Integers  # (k,)
    normal: Floats  # (k, 2) from the grain to the wall, NaN if not listed
    forces: Floats  # (k, 2) f_n, f_t
    factor: Floats  # (k,) of the variance


def _wall_lines(listing: Listing) -> _WallLines:
    rows = listing.rows
    lines = np.flatnonzero((rows == -1).any(axis=1) & (rows >= 0).any(axis=1))
    beta = np.where(rows[lines, 0] >= 0, listing.beta[lines], listing.beta[lines] + np.pi)
    return _WallLines(
        grain=rows[lines].max(axis=1),
        normal=np.column_stack([np.cos(beta), np.sin(beta)]),
        forces=listing.forces[lines],
        factor=1 / listing.weight[lines],
    )


def _by_directions(lines: _WallLines) -> WallContacts | None:
    """Contacts in the listed directions, with a wall for each contact of one grain; or None."""
    measured = np.isfinite(lines.normal[:, 0])
    if not measured.any():
        return None
    wall = _occurrence(lines.grain[measured])
    return WallContacts(
        grain=lines.grain[measured],
        wall=wall,
        normal=lines.normal[measured],
        forces=lines.forces[measured],
        factor=lines.factor[measured],
        names=tuple(f"{_ANY} {k + 1}" if k else _ANY for k in range(wall.max() + 1)),
        outline=None,
    )


def _by_outline(
    lines: _WallLines, outline: WallOutline, x: Floats, r: Floats, at_wall: Mask, reach: float
) -> WallContacts:
    """Contacts of the grains at walls with the sides of an outline, measured where listed."""
    gap, ways = outline.gaps(x, r)
    touching = at_wall[:, None] & (gap <= reach * r.mean())
    touching[np.flatnonzero(at_wall), gap[at_wall].argmin(axis=1)] = True
    grain, wall = np.nonzero(touching)
    gap, ways = gap[grain, wall], ways[grain, wall]
    forces, factor = np.full((len(grain), 2), np.nan), np.ones(len(grain))
    taken = np.zeros(len(grain), dtype=bool)
    for k, listed_grain in enumerate(lines.grain):
        candidates = np.flatnonzero(grain == listed_grain)
        if np.isfinite(lines.normal[k, 0]):  # the side to which the angle points
            best = candidates[np.argmax(ways[candidates] @ lines.normal[k])]
        else:  # the nearest side; several lines of one grain are contacts with several sides
            left = candidates[~taken[candidates]] if not taken[candidates].all() else candidates
            best = left[np.argmin(gap[left])]
        taken[best] = True
        forces[best], factor[best] = lines.forces[k], lines.factor[k]
    return WallContacts(grain, wall, ways, forces, factor, outline.names, outline)


def _occurrence(grain: Integers) -> Integers:
    """(w,) earlier occurrences of the grain: two contacts of one grain are with two bodies."""
    order = np.argsort(grain, kind="stable")
    new = np.concatenate([[True], np.diff(grain[order]) != 0])
    first = np.maximum.accumulate(np.where(new, np.arange(len(grain)), 0))
    which = np.empty(len(grain), dtype=np.int64)
    which[order] = np.arange(len(grain)) - first
    return which


def fitted(shape: str, x: Floats, r: Floats, at_wall: Mask, flag: Floats) -> WallOutline:
    """Walls of a shape, fitted to the grains at walls; "auto": of the shape that fits best."""
    if shape == "auto":
        return _best_fitted(x, r, at_wall, flag)
    if at_wall.sum() < 4:
        raise InputError(
            f"walls {shape}: fewer than four grains are at walls (by a flag, or an id below 0); "
            "give the outline with its numbers"
        )
    unit = r.mean()  # the tolerances of the fit are absolute
    x, r, flag = x[at_wall] / unit, r[at_wall] / unit, flag[at_wall]
    if shape == "box":
        numbers = []
        for axis in (0, 1):
            low, high = x[:, axis] - r, x[:, axis] + r
            numbers.append(np.median(low[low < low.min() + _AT_SIDE * r.mean()]))
            numbers.append(np.median(high[high > high.max() - _AT_SIDE * r.mean()]))
        return WallOutline("box", tuple(float(unit * number) for number in numbers))
    inner = flag < 0
    if shape == "annulus" and inner.sum() < 3:
        raise InputError(
            "walls annulus: too few grains at the inner wall (flagged −1, or next to a hole)"
        )
    if shape == "circle":
        inner[:] = False

    def misses(p: Floats) -> Floats:
        distance = np.hypot(*(x - p[:2]).T)
        return np.where(inner, distance - r - p[2], p[3] - distance - r)

    centre = x[~inner].mean(axis=0)
    away = np.hypot(*(x - centre).T)
    start = [*centre, away[inner].mean() if inner.any() else 0.0, away[~inner].mean()]
    best = scipy.optimize.least_squares(misses, start, loss="soft_l1", f_scale=0.1 * r.mean()).x
    cut = best if shape == "annulus" else best[[0, 1, 3]]
    return _outline(shape, ",".join(repr(float(unit * value)) for value in cut))


def _best_fitted(x: Floats, r: Floats, at_wall: Mask, flag: Floats) -> WallOutline:
    inner = np.any(flag[at_wall] < 0)
    some = [fitted(one, x, r, at_wall, flag) for one in ("box", "annulus" if inner else "circle")]
    off = [_misfit(outline, x, r, at_wall) for outline in some]
    best = int(np.argmin(off))
    if not off[best] <= _NEAR:
        raise InputError(
            f"walls auto: neither {some[0].shape} nor {some[1].shape} fits the grains at walls; "
            "give the outline with its numbers"
        )
    return some[best]


def _misfit(outline: WallOutline, x: Floats, r: Floats, at_wall: Mask) -> float:
    """Mean distance of grains at walls from the nearest side, in mean radii."""
    gap = outline.gaps(x[at_wall], r[at_wall])[0]
    return float(np.abs(gap).min(axis=1).mean() / r.mean())


def bad_fit(outline: WallOutline, x: Floats, r: Floats, at_wall: Mask) -> str | None:
    """A note if the grains at walls are far from the outline, or if there are none."""
    if not at_wall.any():
        return f"walls {outline.shape}: no grain lies at these walls; check the numbers"
    off = _misfit(outline, x, r, at_wall)
    if off <= _NEAR:
        return None
    return (
        f"walls {outline.shape}: the {at_wall.sum()} grains at walls lie {off:.1f} mean radii from "
        "the nearest side on average, so the outline probably has another shape; --walls auto "
        "selects the shape that fits best"
    )


class Bodies(NamedTuple):
    """Walls as bodies after the N grains, their contacts, and measurements by load cells."""

    x: Floats  # (b, 2)
    r: Floats  # (b,)
    load: Floats  # (b, 3) 0 if a load cell holds the wall, otherwise NaN
    contacts: Contacts  # contacts with walls, then those held by load cells
    measured: Floats  # (w + cells, 2)
    sigma: Floats  # (w + cells, 2) NaN for walls, errors for load cells
    factor: Floats  # (w + cells,)
    names: tuple[str, ...]  # (b,)


def bodies(
    touching: WallContacts, x: Floats, r: Floats, forces: Mapping[str, Sequence[float]]
) -> Bodies:
    """The Bodies of WallContacts; forces: {name: (f_x, f_y, σ)} of load cells.

    Raises InputError for a force on a missing wall, or on one that is not straight.
    """
    straight = touching.outline is not None and touching.outline.shape == "box"
    for name in forces:
        if name not in touching.names or not straight:
            raise InputError(
                f"no straight wall is called {name[:40]!r}; walls: {', '.join(touching.names)} "
                "(a force on a wall needs --walls box)"
            )
    count, radius, cells = len(touching.names), r.mean(), list(forces)
    if touching.outline is None:
        places = [x.mean(axis=0)] * count
    else:
        places = [touching.outline.place(k, 2 * radius) for k in range(count)]
    walls = np.array([touching.names.index(name) for name in cells], dtype=np.int64)
    ground = places + [np.add(places[k], 3 * radius * _NORMALS[k]) for k in walls]
    total = np.array(ground)
    load = np.full((len(total), 3), np.nan)
    load[walls] = 0.0
    i = np.concatenate([touching.grain, len(x) + walls])
    j = np.concatenate([len(x) + touching.wall, len(x) + count + np.arange(len(cells))])
    normal = np.concatenate([touching.normal, _NORMALS[walls]])
    radii = np.concatenate([r, np.full(len(total), radius)])
    contacts = make_contacts(i, j, normal, radii[i] + radii[j], radii)
    arm = np.where(i < len(x), radii[i], 0.0)
    contacts = contacts._replace(arm_i=arm, arm_j=np.zeros(len(j)))
    values = np.array([forces[name] for name in cells]).reshape(-1, 3)
    held = components(values[:, :2], _NORMALS[walls])
    sigma = np.full((len(i), 2), np.nan)
    sigma[len(touching.grain) :] = values[:, 2:]
    return Bodies(
        x=total,
        r=radii[len(x) :],
        load=load,
        contacts=contacts,
        measured=np.concatenate([touching.forces, held]),
        sigma=sigma,
        factor=np.concatenate([touching.factor, np.ones(len(cells))]),
        names=(*touching.names, *(f"cell of the {name} wall" for name in cells)),
    )
