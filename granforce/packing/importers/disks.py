"""Packings from disks alone: contacts where they touch, walls around them, and gravity."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import numpy.typing as npt

from granforce.cell import Cell
from granforce.packing.assemblies import counted_twice, with_network
from granforce.packing.importers.geometry import (
    check_disks,
    largest_gap,
    overlapping,
    touching_contacts,
    with_doubts_noted,
)
from granforce.packing.importers.network import with_nearest_network
from granforce.packing.importers.notes import packing_noted, with_notes
from granforce.packing.scenes import places_behind
from granforce.records import (
    InputError,
    Packing,
    Shapes,
    brief,
    float_array,
    friction,
    make_cell,
    make_contacts,
    make_packing,
    positive,
    real_array,
)
from granforce.tolerances import LARGEST_UNIT, LISTED_TOUCHING
from granforce.types import Floats, Integers

WALLS = ("floor", "box")


@packing_noted
def from_disks(
    x: npt.ArrayLike,
    r: npt.ArrayLike,
    mu: Any,
    *,
    box: npt.ArrayLike | None = None,
    tilt: float = 0.0,
    walls: str | npt.ArrayLike | None = None,
    gravity: float = 0.0,
    pressure: float | None = None,
    clumps: npt.ArrayLike | None = None,
    tolerance: float = LISTED_TOUCHING,
) -> Packing:
    """A Packing of disks, with the force network nearest to equal normal forces.

    Parameters
    ----------
    x : (N, 2) array
        Centres.
    r : (N,) array
        Radii.
    mu : float
        Friction coefficient.
    box : (2,) array, optional
        Sides L_x, L_y of a periodic cell, inf in an open direction. A set that is not periodic in
        both needs walls and gravity. By default it is open.
    tilt : float, default 0
        x component of the cell's second vector.
    walls : str or (k, 4) array, optional
        "floor", "box" (a floor and two sides), at the extent of the disks, or segments x, y, x, y;
        in a box periodic in x, "floor".
        Walls are held: behind each place that a disk touches is one more grain, whose balance is
        not required.
    gravity : float, default 0
        g times the mass density, downwards: a disk weighs g π r².
    pressure : float, optional
        P0 of a periodic cell, force per length; by default 1.
    clumps : (N,) array, optional
        Labels of rigid bodies: disks with one label move as one, and may overlap. Bodies follow the
        order of labels; each needs centres that are not wrapped into the cell. Masses add up, and
        an InputWarning names bodies whose disks overlap.
    tolerance : float, default 10⁻⁶
        Disks closer than this, in largest radii, touch.

    Returns
    -------
    Packing
        info["nearly_touching"] lists pairs in doubt, [i, j, gap]: gaps within a factor of 100 of
        the tolerance, and far above those of other contacts. An InputWarning reports them.

    Raises
    ------
    InputError
        For overlapping disks and for inconsistent options.
    NotJammedError
        If no network exists.
    """
    mu, cell = friction(mu), make_cell((np.inf, np.inf) if box is None else box, tilt)
    r = float_array(r, (-1,), "radii")
    x = float_array(x, (-1, 2), "centres")
    if len(x) != len(r):
        raise InputError(f"disks need a centre and a radius each: {len(x)} centres, {len(r)} radii")
    closed = bool(np.all(np.isfinite(cell.box)))
    if pressure is not None and not closed:
        raise InputError("pressure applies to periodic boxes: leave it out, or give the box")
    if clumps is not None:
        return clumped(x, r, mu, cell, clumps, walls, gravity, tolerance, lambda k: f"disk {k}")
    x = cell.wrapped(x)
    check_disks(x, r, cell, lambda k: f"disk {k}")
    contacts = touching_contacts(x, r, cell, tolerance)
    packing = make_packing(
        x,
        r,
        cell.box,
        contacts,
        np.zeros((len(contacts.i), 2)),
        mu,
        positive(1.0 if pressure is None else pressure, "pressure") if closed else np.nan,
        info={"source": "disks"},
        tilt=cell.tilt,
    )
    packing = with_doubts_noted(packing, tolerance)
    return with_nearest_network(enclosed(packing, walls, gravity, tolerance), forces="found")


def clumped(
    x: Floats,
    r: Floats,
    mu: float,
    cell: Cell,
    clumps: npt.ArrayLike,
    walls: str | npt.ArrayLike | None,
    gravity: float,
    tolerance: float,
    place: Callable[[int], str],
) -> Packing:
    """The Packing of disks that are joined as in `from_disks`; place(k) names disk k."""
    bodies, wrapped = _bodies(clumps, len(r)), cell.wrapped(x)
    if np.all(np.isfinite(cell.box)):
        raise InputError("clumps need walls and gravity: leave out the box, or its side L_y")
    check_disks(wrapped, r, cell, place, rigid=bodies)
    contacts = touching_contacts(wrapped, r, cell, tolerance, rigid=bodies)
    none, info = np.zeros((len(contacts.i), 2)), {"source": "disks"}
    packing = make_packing(wrapped, r, cell.box, contacts, none, mu, info=info)
    i, j, gap = overlapping(wrapped, r, cell)
    twice = np.unique(bodies[i[(bodies[i] == bodies[j]) & (-gap > tolerance * r.max())]])
    joined = _joined(enclosed(packing, walls, gravity, tolerance), x, bodies)
    return with_notes(with_network(joined), [counted_twice(twice)] if len(twice) else [])


def _bodies(clumps: npt.ArrayLike, count: int) -> Integers:
    """The number of the body (N,) of each disk, in the order of the labels."""
    labels = np.zeros(0)
    with suppress(ValueError):  # rows of different lengths
        labels = np.asarray(clumps)
    if labels.shape != (count,) or labels.dtype.kind not in "iuU":
        raise InputError(
            f"clumps must be {count} labels, whole numbers or texts, one for each disk"
        )
    return np.unique(labels, return_inverse=True)[1]


def _joined(packing: Packing, x: Floats, body: Integers) -> Packing:
    """A packing without forces, with its first disks, centres x, joined to bodies (k,)."""
    disks, more = len(x), len(packing.r) - len(x)
    count = int(body.max()) + 1
    of = np.append(body, count + np.arange(more))
    x, r, c = np.concatenate([x, packing.x[disks:]]), packing.r, packing.contacts
    mass = np.pi * r**2
    total = np.bincount(of, mass)
    centre = np.column_stack([np.bincount(of, mass * along) for along in x.T]) / total[:, None]
    away = x - centre[of]
    far, load = np.zeros(len(total)), np.zeros((len(total), 3))
    np.maximum.at(far, of, np.hypot(*away.T) + r)
    np.add.at(load, of, packing.load)
    # The arms and levers of a disk, and from the centre of mass to it.
    i, j = of[c.i], of[c.j]
    arm, lever = (
        [np.sum(away[disk] * along, axis=1) for disk in (c.i, c.j)]
        for along in (c.normal, c.tangent)
    )
    contacts = c._replace(
        i=i,
        j=j,
        length=c.length + arm[0] - arm[1],
        arm_i=c.arm_i + arm[0],
        arm_j=c.arm_j - arm[1],
        levers=np.column_stack(lever),
    )
    turning = np.bincount(of, mass * (0.5 * r**2 + np.sum(away**2, axis=1)))
    shapes = Shapes(
        corners=np.empty((0, 2)),
        sides=np.zeros(disks, dtype=np.int64),
        mass=np.asarray(total, dtype=float),
        inertia=np.asarray(turning, dtype=float),
        body=body,
        circles=np.column_stack([x, r])[:disks],
    )
    return make_packing(
        centre,
        far,
        packing.box,
        contacts,
        packing.forces,
        packing.mu,
        load=load,
        info=packing.info | {"disks": count},
        shapes=shapes,
    )


def enclosed(
    packing: Packing,
    walls: str | npt.ArrayLike | None,
    gravity: float = 0.0,
    tolerance: float = LISTED_TOUCHING,
) -> Packing:
    """A packing without forces, with walls and gravity as in `from_disks`.

    Raises InputError in a box periodic in y, for side walls in one periodic in x, without gravity
    and loads, or if no disk touches a wall.
    """
    gravity = positive(gravity, "gravity", or_zero=True, most=LARGEST_UNIT)
    if walls is None and not gravity:
        return packing
    if np.isfinite(packing.box[1]):
        raise InputError(
            "walls and gravity apply to boxes open in y: leave out the box, or give box=[L_x, inf] "
            "(--box LX inf)"
        )
    if np.isfinite(packing.box[0]) and not (isinstance(walls, str) and walls == "floor"):
        raise InputError('in a box periodic in x, the only wall is a floor: walls="floor"')
    load = packing.load.copy()
    load[:, 1] -= gravity * np.pi * packing.r**2
    if walls is None:
        return packing._replace(load=load)
    segments, count = _segments(packing, walls), len(packing.r)
    behind = places_behind(packing.x, packing.r, segments, largest_gap(tolerance))
    if not len(behind.disk):
        raise InputError("no disk touches a wall; correct the walls, or raise the tolerance")
    if not load.any():  # NaN counts: an open balance may press
        raise InputError(
            "nothing presses on the walls: add gravity (--gravity 1, or gravity=1), or loads"
        )
    r = np.concatenate([packing.r, behind.r])
    outer = make_contacts(
        behind.disk,
        count + behind.grain,
        behind.away,
        packing.r[behind.disk] + behind.r[behind.grain],
        r,
    )
    contacts = packing.contacts.joined(outer)
    return packing._replace(
        x=np.concatenate([packing.x, behind.x]),
        r=r,
        contacts=contacts,
        forces=np.zeros((len(contacts.i), 2)),
        load=np.concatenate([load, behind.load]),
        info=packing.info | {"walls": segments.tolist(), "disks": count, "pressing": []},
    )


def _segments(packing: Packing, walls: str | npt.ArrayLike) -> Floats:
    """Ends (k, 4) of walls."""
    if not isinstance(walls, str):
        return float_array(np.atleast_2d(real_array(walls, "walls")), (-1, 4), "walls")
    if walls not in WALLS:
        words = f"must be {', '.join(WALLS)}, or segments, got {brief(walls)}"
        raise InputError.of("walls", walls, words)
    left, bottom = (packing.x - packing.r[:, None]).min(axis=0)
    right, top = (packing.x + packing.r[:, None]).max(axis=0)
    if np.isfinite(packing.box[0]):
        left, right = 0.0, packing.box[0]
    floor = (left, bottom, right, bottom)
    sides = [(left, bottom, left, top), (right, bottom, right, top)]
    return np.array([floor, *(sides if walls == "box" else [])])
