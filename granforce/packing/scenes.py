"""Scenes: small sets of disks, walls and weights with an S small enough to see and count by hand.

Disks rest on each other and on straight walls. Behind each place where a disk touches a wall is a
grain whose balance is not required (load NaN). Weight is a load on each disk, r² in units of that
of the largest disk; no pressure is prescribed, and the box is open on all sides. A pressing wall is
one grain, touched by all its disks, with the force on it as a load: it may slide along itself, so
its forces f_t sum to 0, and it does not tilt, since f_n act on its centre. Such a set is a Packing
like any other, and nothing else in granforce depends on scenes.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.forces.build import ensemble
from granforce.packing import masonry
from granforce.packing.assemblies import with_network
from granforce.packing.compaction import pack
from granforce.packing.pouring import STUD
from granforce.records import (
    InputError,
    NotJammedError,
    Packing,
    UndecidedError,
    brief,
    float_array,
    friction,
    make_contacts,
    make_packing,
    positive,
    whole,
)
from granforce.types import Floats, Integers, Mask

# Default gap (in largest radii) below which a disk touches a wall or another disk.
SNAPPED = 1e-9
MOST_SEEDS = 100  # tried for a packing with the dimension of a scene


class Sketch(NamedTuple):
    """Disks and walls of a scene."""

    x: Floats  # (N, 2) centres
    r: Floats  # (N,) radii
    walls: Floats  # (k, 4) both ends x, y, x, y of each wall
    load: Floats  # (N, 3) force and torque on each disk
    pressing: Floats | None = None  # (k,) force of each pressing wall; 0 for held walls


class _Scene(NamedTuple):
    title: str  # on screen
    mu: float  # default friction coefficient
    make: Callable[..., Sketch | Packing]  # make(mu, **options) returns a Sketch or a Packing
    packed: bool = False  # whether its disks are compressed first, which takes a while


def scene(name: str, mu: float | None = None, **options: Any) -> Packing:
    """The Packing of a named scene, with the admissible network nearest to equal f_n.

    Parameters
    ----------
    name : str
        One of SCENES, or of BLOCKS.
    mu : float, optional
        Friction coefficient, by default the scene's.
    **options
        Of the scene: angle (degrees) of the opening of the "groove" and of the lines of centres
        with the vertical in the "pyramid" and the "column"; disks in the "column"; those of the
        functions in `masonry`.

    Returns
    -------
    Packing
        With this network as its forces.

    Raises
    ------
    InputError
        For an unknown name, option or geometry.
    NotJammedError
        If nothing balances.
    """
    return with_network(sketched(name, mu, **options))


def sketched(name: str, mu: float | None = None, **options: Any) -> Packing:
    """The Packing of a scene, even if nothing balances; its forces are 0, or those at another μ."""
    if not isinstance(name, str) or name not in EVERY:
        raise InputError(f"unknown scene {brief(name)}; choose one of {', '.join(EVERY)}")
    kind = EVERY[name]
    mu = kind.mu if mu is None else friction(mu)
    known_options = list(inspect.signature(kind.make).parameters)[1:]
    for unknown in sorted(options.keys() - set(known_options)):
        has = (
            f"its options are {', '.join(known_options)}" if known_options else "it has no options"
        )
        raise InputError(f"the scene {name} has no option {brief(unknown)}: {has}")
    sketch = kind.make(mu, **options)
    if isinstance(sketch, Sketch):
        sketch = assembled(*sketch[:4], mu, pressing=sketch.pressing)
    return sketch._replace(info=sketch.info | {"scene": name})


def assembled(
    x: npt.ArrayLike,
    r: npt.ArrayLike,
    walls: npt.ArrayLike,
    load: npt.ArrayLike,
    mu: Any,
    *,
    pressing: npt.ArrayLike | None = None,
    tolerance: float = SNAPPED,
) -> Packing:
    """The Packing of a Sketch, with contacts where disks and walls touch, without a network.

    Its info contains the walls, as lists of four numbers, and which of them press; its grains are
    the disks, the pressing walls, and the grains behind held walls. tolerance: gap (in largest
    radii) up to which a disk touches.

    Raises InputError if disks overlap each other or a wall, or lie on both sides of a pressing wall
    or at its end, and as `make_packing`.
    """
    r = float_array(r, (-1,), "radii")
    x = float_array(x, (len(r), 2), "centres")
    walls = float_array(np.reshape(walls, (-1, 4)), (-1, 4), "walls")
    load = float_array(load, (len(r), 3), "loads")
    pressing = np.zeros(len(walls)) if pressing is None else pressing
    pressing = float_array(pressing, (len(walls),), "forces of walls")
    if not len(r):
        raise InputError("there are no disks; add one")
    i, j = np.triu_indices(len(r), 1)
    branch, reach = x[j] - x[i], r[i] + r[j]
    between = _touching(np.hypot(*branch.T) - reach, r, "two disks", tolerance)
    branch, reach = branch[between], reach[between]
    behind = _behind(x, r, walls, pressing, tolerance)
    radii = np.concatenate([r, behind.r])
    contacts = make_contacts(
        np.concatenate([i[between], behind.disk]),
        np.concatenate([j[between], len(r) + behind.grain]),
        np.concatenate([branch / np.hypot(*branch.T)[:, None], behind.away]),
        np.concatenate([reach, r[behind.disk] + behind.r[behind.grain]]),
        radii,
    )
    return make_packing(
        np.concatenate([x, behind.x]),
        radii,
        [np.inf, np.inf],
        contacts,
        np.zeros((len(contacts.i), 2)),
        mu,
        load=np.concatenate([load, behind.load]),
        info={"walls": walls.tolist(), "disks": len(r), "pressing": behind.lids.tolist()},
    )


def weights(r: npt.ArrayLike) -> Floats:
    """Loads (N, 3) of gravity: r² for radii r (N,), downwards."""
    r = np.asarray(r)
    load = np.zeros((len(r), 3))
    load[:, 1] = -(r**2)
    return load


def _touching(gap: Floats, r: Floats, what: str, tolerance: float) -> Mask:
    scale = r.max()
    for value in gap[gap < -tolerance * scale][:1]:
        raise InputError(f"{what} overlap by {-value / scale:.2g} of the largest radius")
    return gap <= tolerance * scale


class _Touched(NamedTuple):
    """Places where disks touch walls."""

    disk: Integers  # (k,)
    wall: Integers  # (k,)
    place: Floats  # (k, 2) the nearest point of the wall
    away: Floats  # (k, 2) unit vector from the disk's centre to the place


def _touched(x: Floats, r: Floats, walls: Floats, tolerance: float) -> _Touched:
    """The places where disks touch walls, each once.

    Where walls meet, several may have the same nearest point; and the end of a wall that lies on
    another wall is not a place of its own.
    """
    place, is_end = _nearest(x, walls)
    away = place - x[:, None]
    distance = np.hypot(*away.T).T
    disk, wall = np.nonzero(_touching(distance - r[:, None], r, "a disk and a wall", tolerance))
    near, once = tolerance * r.max(), np.ones(len(disk), dtype=bool)
    for k in np.flatnonzero(np.bincount(disk)[disk] > 1)[::-1]:
        others = np.flatnonzero(once & (disk == disk[k]))
        others = others[others != k]
        here = place[disk[k], wall[k]]
        same = np.hypot(*(place[disk[others], wall[others]] - here).T) <= near
        if is_end[disk[k], wall[k]]:
            on_wall = _nearest(here[None], walls[wall[others]])[0][0]
            same |= np.hypot(*(on_wall - here).T) <= near
        once[k] = not same.any()
    disk, wall = disk[once], wall[once]
    return _Touched(disk, wall, place[disk, wall], away[disk, wall] / distance[disk, wall][:, None])


def _nearest(x: Floats, walls: Floats) -> tuple[Floats, Mask]:
    """The point of each wall nearest to each of x, (N, k, 2), and whether it is an end (N, k)."""
    begin, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    size = (along**2).sum(axis=1)
    if np.any(size == 0):
        raise InputError(f"wall {int(np.argmax(size == 0))} has no length")
    share = ((x[:, None] - begin) * along).sum(axis=-1) / size
    place = begin + np.clip(share, 0, 1)[..., None] * along
    return place, (share <= 0) | (share >= 1)


class Behind(NamedTuple):
    """Grains behind walls: one per pressing wall, then one per touched place of the other walls."""

    disk: Integers  # (k,) touching disk
    grain: Integers  # (k,) the grain that it touches, among these
    away: Floats  # (k, 2) unit vector from disk to grain
    x: Floats  # (m, 2) centres
    r: Floats  # (m,) radii
    load: Floats  # (m, 3) force of pressing walls, otherwise NaN
    lids: Integers  # (l,) indices of pressing walls


def places_behind(x: Floats, r: Floats, walls: Floats, tolerance: float) -> Behind:
    """Grains behind the places where disks touch held walls."""
    return _behind(x, r, walls, np.zeros(len(walls)), tolerance)


def _behind(x: Floats, r: Floats, walls: Floats, pressing: Floats, tolerance: float) -> Behind:
    """Grains behind the places where disks touch walls, of which some press."""
    disk, wall, place, away = _touched(x, r, walls, tolerance)
    lids = np.flatnonzero(pressing)
    is_held = pressing[wall] == 0
    grain = np.empty(len(disk), dtype=np.int64)
    grain[~is_held] = np.searchsorted(lids, wall[~is_held])
    grain[is_held] = len(lids) + np.arange(is_held.sum())
    inward = np.reshape([inwards(x, walls[k], away[wall == k]) for k in lids], (-1, 2))
    lid_radius, held_radii = STUD * r.max(), STUD * r[disk[is_held]]
    lid_centres = (walls[lids, :2] + walls[lids, 2:]) / 2 - inward * lid_radius
    held_centres = place[is_held] + away[is_held] * held_radii[:, None]
    load = np.full((len(lids) + len(held_radii), 3), np.nan)
    load[: len(lids)] = np.column_stack([inward * pressing[lids, None], np.zeros(len(lids))])
    return Behind(
        disk=disk,
        grain=grain,
        away=away,
        x=np.concatenate([lid_centres, held_centres]),
        r=np.concatenate([np.full(len(lids), lid_radius), held_radii]),
        load=load,
        lids=lids,
    )


def inwards(x: Floats, wall: Floats, away: Floats) -> Floats:
    """Unit vector (2,) in which a wall presses: towards the bodies, which touch it along away."""
    along = wall[2:] - wall[:2]
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    side = -away @ across
    if np.any(np.abs(side) < 1 - SNAPPED):
        raise InputError("a body touches the end of a wall that presses: make the wall longer")
    if np.any(side < 0) and np.any(side > 0):
        raise InputError("bodies lie on both sides of a wall that presses: move them to one")
    if not len(side):
        side = (x - wall[:2]).mean(axis=0, keepdims=True) @ across
    return across * np.copysign(1.0, side[0])


# The scenes: centres from elementary geometry, radius 1.


def _resting(x: Sequence[Any] | Floats, walls: npt.ArrayLike) -> Sketch:
    r = np.ones(len(x))
    return Sketch(np.array(x, dtype=float), r, np.array(walls, dtype=float), weights(r))


def _degrees(angle: float, least: float, most: float) -> float:
    angle = positive(angle, "angle")
    if not least <= angle < most:
        raise InputError(f"angle must lie between {least:g} and {most:g} degrees, got {angle:g}")
    return np.radians(angle)


def _groove(mu: float, angle: float = 90.0) -> Sketch:
    half = _degrees(angle, 10, 180) / 2
    side = 2 / np.tan(half) + 1.2 * np.sin(half)
    left, height = side * np.sin(half), side * np.cos(half)
    return _resting([[0, 1 / np.sin(half)]], [[-left, height, 0, 0], [0, 0, left, height]])


def _box(mu: float) -> Sketch:
    offset = np.sqrt(2)  # the line of centres at 45°
    width = 2 + offset
    walls = [[0, 4.2, 0, 0], [0, 0, width, 0], [width, 0, width, 4.2]]
    return _resting([[1, 1], [1 + offset, 1 + offset]], walls)


def _pyramid(mu: float, angle: float = 30.0) -> Sketch:
    half = _degrees(angle, 30, 90)
    side, height = 2 * np.sin(half), 2 * np.cos(half)
    if angle == 30:
        side, height = 1.0, np.sqrt(3)
    return _resting([[-side, 1], [side, 1], [0, 1 + height]], [[-side - 1.8, 0, side + 1.8, 0]])


def _press(mu: float) -> Sketch:
    """The close pyramid without weight, under a wall that presses with force 1."""
    pyramid = _pyramid(mu)
    lid = 2 + np.sqrt(3)
    walls = [*pyramid.walls.tolist(), [-1.6, lid, 1.6, lid]]
    return pyramid._replace(
        walls=np.array(walls), load=0 * pyramid.load, pressing=np.array([0, 1.0])
    )


def _leaning(mu: float) -> Sketch:
    pyramid = _pyramid(mu)
    return pyramid._replace(walls=np.array([[-2, 4.2, -2, 0], [-2, 0, 2.8, 0]], dtype=float))


def _column(mu: float, disks: int = 10, angle: float = 30.0) -> Sketch:
    disks = whole(disks, "disks", 1, 1000)
    slope = _degrees(angle, 1, 60)
    number = np.arange(disks)
    step = 2 * np.sin(slope)
    x = np.column_stack([1 + step * (number % 2), 1 + 2 * np.cos(slope) * number[::-1]])
    width, height = 2 + step, x[0, 1] + 1.2
    return _resting(x, [[0, height, 0, 0], [0, 0, width, 0], [width, 0, width, height]])


def _pressed(disks: int, packed_mu: float, dimension: int) -> Callable[[float], Packing]:
    """Makes disks compressed in a periodic box: the first seed with this dimension h."""

    def make(mu: float) -> Packing:
        for seed in range(1, MOST_SEEDS + 1):
            try:
                packing = pack(disks, mu=packed_mu, seed=seed)
                if ensemble(packing).dimension == dimension:
                    return packing._replace(mu=mu, info=packing.info | {"packed_mu": packed_mu})
            except (NotJammedError, UndecidedError):
                continue
        raise InputError(f"no {disks} disks of {MOST_SEEDS} seeds have h = {dimension}")

    return make


def _many(mu: float) -> Packing:
    return pack(400, mu=mu, seed=1)


# In order of size, as lists show them.
SCENES = {
    "groove": _Scene("One disk in a groove", 0.5, _groove),
    "box": _Scene("Two disks in a box", 0.3, _box),
    "pyramid": _Scene("Three disks as a pyramid", 0.4, _pyramid),
    "press": _Scene("Three disks under a press", 0.4, _press),
    "leaning": _Scene("A pyramid against a wall", 0.4, _leaning),
    "six": _Scene(
        "Six disks under pressure", 0.5,
        _pressed(disks=6, packed_mu=0.3, dimension=2), packed=True,
    ),
    "solid": _Scene(
        "Six disks, S a solid body", 0.5,
        _pressed(disks=6, packed_mu=0.3, dimension=3), packed=True,
    ),
    "column": _Scene("Ten disks in a column", 0.3, _column),
    "thirteen": _Scene(
        "Thirteen disks under pressure", 0.3,
        _pressed(disks=13, packed_mu=0.1, dimension=8), packed=True,
    ),
    "many": _Scene("Disks under pressure", 0.1, _many),
}  # fmt: skip

# Scenes of blocks, which need not be disks.
BLOCKS = {
    "slope": _Scene("A block on a slope", 0.5, masonry.slope),
    "ladder": _Scene("A ladder against a wall", 0.4, masonry.ladder),
    "books": _Scene("Books over the edge of a table", 0.5, masonry.books),
    "stones": _Scene("An arch of three stones", 0.6, partial(masonry.arch, voussoirs=3)),
    "arch": _Scene("An arch of voussoirs", 0.6, masonry.arch),
    "wall": _Scene("A dry-stone wall", 0.65, masonry.wall),
}
EVERY = SCENES | BLOCKS
