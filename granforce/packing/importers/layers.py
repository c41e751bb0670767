"""Packings from layers of spheres, as three-dimensional simulations write them.

A layer of spheres (disks) is read in the plane that contains its centres. Forces of walls and
gravity on grains become their load, or walls become grains.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.cell import Cell
from granforce.packing.importers.geometry import (
    check_disks,
    components,
    distinct_pairs,
    listed_contacts,
)
from granforce.packing.importers.network import LOAD_MISFIT, with_given_forces
from granforce.packing.importers.text import Table, check_grains, some_of
from granforce.records import (
    Contacts,
    InputError,
    Packing,
    friction,
    make_cell,
    make_contacts,
    make_packing,
)
from granforce.types import Floats, Integers

# Centres lie in a plane if they leave it by less than this fraction of a radius.
_FLAT = 1e-3
# How walls take part, as grains.
WALLS = "held", "pressing"


class Options(NamedTuple):
    """What a packing is made of besides the files."""

    mu: float
    cell: Cell
    walls: str | None  # one of WALLS, None for loads
    reverse: bool  # whether shear forces change sign
    most_grains: int | None


class WallContacts(NamedTuple):
    """Contacts of grains with walls."""

    grain: Integers  # (w,)
    wall: Integers  # (w,) number of the wall
    normal: Floats  # (w, 2) from the grain to the wall
    force: Floats  # (w, 2) on the wall
    names: Sequence[str]  # of the walls in the files


class Layer(NamedTuple):
    """Grains in a plane, and the forces between them."""

    grains: Table  # with a column for each axis of the plane, and r
    plane: str  # its two axes
    links: Table  # a row for each contact of two grains
    i: Integers  # (k,) first grain
    j: Integers  # (k,) second grain
    force: Floats  # (k, 2) on j
    on_walls: WallContacts | None  # None without contacts with walls


class Network(NamedTuple):
    """Grains, their contacts that carry force, and the forces."""

    x: Floats  # (N, 2)
    r: Floats  # (N,)
    contacts: Contacts
    forces: Floats  # (N_c, 2) f_n, f_t


def make_options(
    mu: Any,
    box: npt.ArrayLike | None,
    tilt: float,
    walls: str | None,
    reverse: bool,
    most_grains: int | None,
) -> Options:
    """The Options of a reader, checked but for `walls`; box: None if the set is open."""
    cell = make_cell((np.inf, np.inf) if box is None else box, tilt)
    return Options(friction(mu), cell, walls, reverse, most_grains)


def packing_of(layer: Layer, options: Options, source: str) -> Packing:
    """The packing of a layer with the simulation's forces; source: name of the program."""
    check_grains(len(layer.grains.rows), options.most_grains, layer.grains.name)
    x, r = _disks(layer, options.cell)
    check_walls(options.walls)
    if options.walls and layer.on_walls is None:
        raise InputError(f"{layer.links.name}: no contact with a wall; leave out walls (--walls)")
    skipped = int(np.sum(~layer.force.any(axis=1)))
    network = _network(layer, x, r, options)
    return assembled(
        layer.on_walls, network, options, source, forces="given", contacts_skipped=skipped
    )


def assembled(
    on_walls: WallContacts | None, network: Network, options: Options, source: str, **info: Any
) -> Packing:
    """The packing of a network and, if requested, its walls; source: name of the program."""
    count = len(network.r)
    if on_walls is not None:
        info["notes"] = [_note_of(on_walls, options)]
    if options.walls and on_walls is not None:
        network = _with_walls(network, on_walls)
        info["walls"] = len(network.r) - count
    packing = make_packing(
        *(network.x, network.r, options.cell.box, network.contacts, network.forces, options.mu),
        info={"source": source},
        tilt=options.cell.tilt,
    )
    packing = with_given_forces(packing, reverse=options.reverse, **info)
    if options.walls == "held":
        load = packing.load.copy()
        load[count:] = np.nan
        packing = packing._replace(load=load)
    return packing


def plane_of(grains: Table) -> str:
    """The two axes of the plane that contains the centres (x, y, z); InputError without one."""
    spread = {axis: float(np.ptp(grains.numbers(axis))) for axis in "xyz"}
    thin = min("zyx", key=spread.__getitem__)
    if spread[thin] > _FLAT * grains.numbers("r").mean():
        raise InputError(
            f"{grains.name}: centres do not lie in a plane (x, y, z reach over "
            f"{', '.join(f'{spread[axis]:.3g}' for axis in 'xyz')}); only a single layer can be "
            "read"
        )
    return "".join(axis for axis in "xyz" if axis != thin)


def vectors_in(table: Table, plane: str, prefix: str = "") -> Floats:
    """Vectors (rows, 2) in a plane, of columns whose names are a prefix and an axis."""
    return np.column_stack([table.numbers(f"{prefix}{axis}") for axis in plane])


def _disks(layer: Layer, cell: Cell) -> tuple[Floats, Floats]:
    """Centres (N, 2) in the cell and radii (N,)."""
    x, r = cell.wrapped(vectors_in(layer.grains, layer.plane)), layer.grains.numbers("r")
    check_disks(x, r, cell, layer.grains.place)
    return x, r


def check_walls(walls: str | None) -> None:
    """InputError unless walls take part in one of the ways of WALLS, or none."""
    if walls not in (None, *WALLS):
        raise InputError(f"walls are {' or '.join(WALLS)}, got {walls!r:.40}")


def _network(layer: Layer, x: Floats, r: Floats, options: Options) -> Network:
    """The network of the contacts of two grains that carry force, each once."""
    carrying = np.flatnonzero(layer.force.any(axis=1))
    if not len(carrying) and not options.walls:
        raise InputError(
            f"{layer.links.name}: no contact of two grains carries force; is the packing "
            "compressed?"
        )
    left = distinct_pairs(
        *(layer.i[carrying], layer.j[carrying], layer.force[carrying], LOAD_MISFIT),
        lambda c: layer.links.place(carrying[c]),
    )
    rows = carrying[left]
    contacts = listed_contacts(
        *(x, r, options.cell, layer.i[rows], layer.j[rows]), lambda c: layer.links.place(rows[c])
    )
    return Network(x, r, contacts, components(layer.force[rows], contacts.normal))


def _note_of(on_walls: WallContacts, options: Options) -> str:
    """A note on contacts with walls; InputError for walls in a periodic box."""
    count, names = len(on_walls.grain), some_of(on_walls.names)
    if not np.isinf(options.cell.box).any():
        if options.walls:
            raise InputError("a box that is periodic in both directions has no walls")
        return f"{count} contacts with walls ({names}) are left out: the box is periodic"
    if options.walls:
        return f"{count} contacts with walls ({names}) are contacts of the packing"
    return (
        f"{count} contacts with walls ({names}) count as loads on the grains; --walls {WALLS[0]} "
        f"or {WALLS[1]} makes them contacts"
    )


def _with_walls(network: Network, on_walls: WallContacts) -> Network:
    """The network with a grain for each wall, behind the places where it is touched.

    Forces on it have no lever arm, so its torque does not count.
    """
    # Walls parallel to the plane exert no force in it.
    pressed = np.flatnonzero(on_walls.normal.any(axis=1) & on_walls.force.any(axis=1))
    grain, normal = on_walls.grain[pressed], on_walls.normal[pressed]
    walls, wall = np.unique(on_walls.wall[pressed], return_inverse=True)
    x, r = network.x, network.r
    radius = r.mean()
    behind = x[grain] + (r[grain] + 2 * radius)[:, None] * normal
    places = np.zeros((len(walls), 2))
    np.add.at(places, wall, behind / np.bincount(wall)[wall][:, None])
    radii = np.concatenate([r, np.full(len(walls), radius)])
    contacts = make_contacts(grain, len(r) + wall, normal, r[grain] + radius, radii)
    contacts = contacts._replace(arm_i=r[grain], arm_j=np.zeros(len(grain)))
    return Network(
        np.concatenate([x, places]),
        radii,
        network.contacts.joined(contacts),
        np.concatenate([network.forces, components(on_walls.force[pressed], normal)]),
    )
