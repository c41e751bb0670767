"""Packings from disks alone: contacts where they touch, walls around them, and gravity."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from granforce.packing.importers.geometry import (
    check_disks,
    largest_gap,
    touching_contacts,
    with_doubts_noted,
)
from granforce.packing.importers.network import with_nearest_network
from granforce.packing.importers.notes import packing_noted
from granforce.packing.scenes import places_behind
from granforce.records import (
    InputError,
    Packing,
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
from granforce.types import Floats

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
        Sides L_x, L_y of a periodic cell. By default the set is open and needs walls and gravity.
    tilt : float, default 0
        x component of the cell's second vector.
    walls : str or (k, 4) array, optional
        "floor", "box" (a floor and two sides), at the extent of the disks, or segments x, y, x, y.
        Walls are held: behind each place that a disk touches is one more grain, whose balance is
        not required.
    gravity : float, default 0
        g times the mass density, downwards: a disk weighs g π r².
    pressure : float, optional
        P0 of a periodic cell, force per length; by default 1.
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
    x = cell.wrapped(x)
    check_disks(x, r, cell, lambda k: f"disk {k}")
    contacts = touching_contacts(x, r, cell, tolerance)
    closed = bool(np.all(np.isfinite(cell.box)))
    if pressure is not None and not closed:
        raise InputError("pressure applies to periodic boxes: leave it out, or give the box")
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


def enclosed(
    packing: Packing,
    walls: str | npt.ArrayLike | None,
    gravity: float = 0.0,
    tolerance: float = LISTED_TOUCHING,
) -> Packing:
    """A packing without forces, with walls and gravity as in `from_disks`.

    Raises InputError in a periodic box, without gravity and loads, or if no disk touches a wall.
    """
    gravity = positive(gravity, "gravity", or_zero=True, most=LARGEST_UNIT)
    if walls is None and not gravity:
        return packing
    if np.isfinite(packing.box).any():
        raise InputError("walls and gravity apply to open packings: leave out the box")
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
    floor = (left, bottom, right, bottom)
    sides = [(left, bottom, left, top), (right, bottom, right, top)]
    return np.array([floor, *(sides if walls == "box" else [])])
