"""Packings from text files written by YADE and MercuryDPM.

YADE: bodies from `export.textExt` (format x_y_z_r, id_x_y_z_r_matId, or x_y_z_r_attrs with a column
id in its comment; without ids, lines are numbered from 0), and a line for each interaction with
id1, id2 and the vectors phys.normalForce and phys.shearForce, which its documentation
(NormShearPhys) defines in global coordinates, as acting on particle #2 from particle #1.

MercuryDPM: $name.data and $name.fstat as documented ("Output files", docs.mercurydpm.org): for each
time step a line with N, time and the domain, then the particles (x, y, z, velocity, radius, angles,
angular velocity, info; in two dimensions x, y, velocity, radius, angle, angular velocity, info);
and comments, then a line for each contact with time, i, j (below 0: a wall), the contact point,
overlap, tangential spring, |f_n|, |f_t|, the unit vectors n and t. n and t are those of the force
on i if n points from j to i, and of the force on j otherwise.

Both are three-dimensional; a layer of disks (spheres) is read, in the plane that contains its
centres. Forces of walls and gravity on grains become their load.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.cell import Cell
from granforce.packing.importers.geometry import check_disks, components, listed, once
from granforce.packing.importers.network import LOAD_MISFIT, adopt, refuse_idle_reverse
from granforce.packing.importers.notes import packing_noted
from granforce.packing.importers.snapshots import Snapshot, Snapshots
from granforce.packing.importers.text import (
    Source,
    Table,
    check_grains,
    is_number,
    make_table,
    read_text,
    renamed,
    some_of,
)
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
# Forces below this are zero and have no direction.
_TINY = 1e-300
# How walls take part, as grains.
WALLS = "held", "pressing"
_BODY = ("x", "y", "z", "r", "id")
_INTERACTION = ("id1", "id2", "fnx", "fny", "fnz", "fsx", "fsy", "fsz")
_FSTAT = ("time", "i", "j", "x", "y", "z", "delta", "deltat", "fn", "ft")
_FSTAT += ("nx", "ny", "nz", "tx", "ty", "tz")
# Columns of a particle line by their number, and whether the line before has the 3-D domain.
_DATA = {
    (14, 8): ("x", "y", "z", "vx", "vy", "vz", "r", "q1", "q2", "q3", "wx", "wy", "wz", "info"),
    (8, 8): ("x", "y", "z", "vx", "vy", "vz", "r", "info"),
    (8, 6): ("x", "y", "vx", "vy", "r", "angle", "w", "info"),
}


class _OnWalls(NamedTuple):
    """Contacts of grains with walls."""

    grain: Integers  # (w,)
    wall: Integers  # (w,) number of the wall
    normal: Floats  # (w, 2) from the grain to the wall
    force: Floats  # (w, 2) on the wall
    names: Sequence[str]  # of the walls in the files


@packing_noted
def read_yade(
    bodies: Source,
    interactions: Source,
    mu: Any,
    *,
    box: npt.ArrayLike | None = None,
    tilt: float = 0.0,
    columns: Mapping[str, str] | None = None,
    walls: str | None = None,
    reverse: bool = False,
    most_grains: int | None = None,
) -> Packing:
    """A Packing from YADE's bodies and interactions.

    Bodies that interact but are not listed are walls, if the list has ids. An InputWarning (also in
    packing.info) reports how they are treated.

    Parameters
    ----------
    bodies, interactions : path or open file
        The two lists.
    mu : float
        Friction coefficient.
    box : (2,) array, optional
        L_x, L_y of the plane, inf for an open direction; by default the set is open.
    tilt : float, default 0
        Of the cell, whose upper side begins at (tilt, L_y).
    columns : mapping, optional
        {name here: name in the files} for columns x, y, z, r, id, id1, id2, fnx … fsz with other
        names.
    walls : {"held", "pressing"}, optional
        By default the walls' forces on grains become the grains' load. With `walls` they become
        contact forces: each wall is then one more grain, "held" (its balance is not required, so it
        takes any force) or "pressing" (its load is its force in the simulation).
    reverse : bool, default False
        Change the sign of shear forces.
    most_grains : int, optional
        Largest number of grains.

    Returns
    -------
    Packing
        With the forces of the simulation.

    Raises
    ------
    InputError
        Naming file and line.
    """
    cell = _cell(box, tilt)
    tables = _yade_bodies(bodies), _yade_links(interactions, bool(columns))
    grains, links = renamed({} if columns is None else columns, _BODY + _INTERACTION, *tables)
    grains.require("x", "y", "z", "r")
    links.require(*_INTERACTION)
    plane = _plane(grains, 3)
    named = "id" in grains.header
    ids = grains.index("id") if named else {row: row for row in range(len(grains.rows))}
    one, two = (links.among(end, ids) for end in ("id1", "id2"))
    if not named and not np.all(one & two):
        k = int(np.flatnonzero(~(one & two))[0])
        raise InputError(
            f"{links.place(k)}: a body is not among the {len(grains.rows)} bodies, whose ids count "
            "lines from 0; if walls are bodies, too, export the ids (format x_y_z_r_attrs)"
        )
    at_wall = np.flatnonzero((one != two) & named)
    on_walls = None
    if len(at_wall):
        wall_links = links.some(at_wall)
        normal, shear = _yade_forces(wall_links, plane)
        # Forces act on the second body.
        wall = one[at_wall].astype(int)
        ends = np.array([wall_links.fields("id1"), wall_links.fields("id2")])
        places = np.arange(len(wall))
        grain = wall_links._replace(header=("id",), rows=[[end] for end in ends[1 - wall, places]])
        names, number = np.unique(ends[wall, places], return_inverse=True)
        sign = np.where(wall, 1.0, -1.0)[:, None]
        unit = np.maximum(np.hypot(*normal.T), _TINY)[:, None]
        on_walls = _OnWalls(
            *(grain.lookup("id", ids), number, sign * normal / unit, sign * (normal + shear)),
            names.tolist(),
        )
    links = links.some(np.delete(np.arange(len(one)), at_wall))
    i, j = links.lookup("id1", ids), links.lookup("id2", ids)
    normal, shear = _yade_forces(links, plane)
    packing = _packing(
        *(grains, plane, links, i, j, normal + shear, friction(mu), cell),
        *(on_walls, walls, reverse, most_grains, "yade"),
    )
    refuse_idle_reverse(packing.forces, reverse)
    return packing


def _yade_forces(links: Table, plane: str) -> tuple[Floats, Floats]:
    """Normal and shear forces (k, 2) on the second body of each interaction."""
    normal, shear = (
        np.column_stack([links.numbers(f"f{kind}{axis}") for axis in plane]) for kind in "ns"
    )
    return normal, shear


@packing_noted
def read_mercury(
    data: Source,
    fstat: Source,
    mu: Any,
    *,
    frame: int | None = None,
    box: npt.ArrayLike | None = None,
    tilt: float = 0.0,
    walls: str | None = None,
    reverse: bool = False,
    most_grains: int | None = None,
) -> Packing:
    """A Packing from MercuryDPM's .data and .fstat.

    Parameters
    ----------
    data, fstat : path or open file
        The two files.
    frame : int, optional
        Number of the time step in the files, from 0; by default the last that is complete in both.
    mu, box, tilt, walls, reverse, most_grains
        As for `read_yade`.

    Returns
    -------
    Packing
        With the forces of the simulation.

    Raises
    ------
    InputError
        Naming file and line.
    """
    found = open_mercury(
        *(data, fstat, mu),
        box=box,
        tilt=tilt,
        walls=walls,
        reverse=reverse,
        most_grains=most_grains,
    )
    packing = found.chosen(frame).packing
    refuse_idle_reverse(packing.forces, reverse)
    return packing


def open_mercury(
    data: Source,
    fstat: Source,
    mu: Any,
    *,
    box: npt.ArrayLike | None = None,
    tilt: float = 0.0,
    walls: str | None = None,
    reverse: bool = False,
    most_grains: int | None = None,
) -> Snapshots:
    """The Snapshots in both files, by number.

    Parameters
    ----------
    data, fstat, mu, box, tilt, walls, reverse, most_grains
        As for `read_mercury`.

    Returns
    -------
    Snapshots
        Its `read` gives the Snapshot of a number.
    """
    mu, cell = friction(mu), _cell(box, tilt)
    steps, lost = _mercury_steps(data)
    contacts, times, cut = _mercury_contacts(fstat)
    stored, step_times = np.unique(times), np.array([step.time for step in steps])
    which = np.array([np.argmin(np.abs(stored - time)) for time in step_times])
    nearest = stored[which]
    both = np.abs(nearest - step_times) <= 1e-4 * np.maximum(np.abs(nearest), np.abs(step_times))
    filled = np.array([len(step.rows) > 0 for step in steps])
    # Of several steps with nearly the time of these contacts, they are of the one nearest to it.
    off = np.where(filled, np.abs(nearest - step_times), np.inf)
    both &= filled & (off <= np.array([off[which == k].min() for k in which]))
    numbers = np.flatnonzero(both).tolist()
    empty = {k: "contacts" if filled[k] else "particles" for k in np.flatnonzero(~both).tolist()}
    if not numbers:
        raise InputError(
            f"{contacts.name}: no contacts at times of particles, the last of which is "
            f"{step_times[-1]:g}; "
            f"they are of {times.min():g} … {times.max():g}"
        )
    if cut and len(numbers) > 1 and nearest[numbers[-1]] == times[-1]:
        lost = lost or f"time step {numbers[-1]} is cut off in {contacts.name}"
        numbers = numbers[:-1]

    def read(number: int) -> Snapshot:
        links = contacts.some(np.flatnonzero(times == nearest[number]))
        arguments = mu, cell, walls, reverse, most_grains
        packing = _mercury_packing(steps[number], links, *arguments)
        info = packing.info | {"time": float(step_times[number])}
        grains, walls_there = len(steps[number].rows), int(info.get("walls", 0))
        ids = np.concatenate([np.arange(grains), -1.0 - np.arange(walls_there)])
        return Snapshot(packing._replace(info=info), ids)

    return Snapshots("time step", numbers, read, lost, empty)


class _TimeStep(NamedTuple):
    """The particles of one time step."""

    name: str
    time: float
    domain: int  # number of fields of the line before
    rows: list[tuple[int, list[str]]]  # line numbers and fields

    def table(self) -> Table:
        """A Table of the particles."""
        header = _DATA.get((len(self.rows[0][1]), self.domain))
        if header is None:
            number, fields = self.rows[0]
            raise InputError(
                f"{self.name}, line {number}: {len(fields)} fields for a particle; expected 8 or 14"
            )
        return make_table(self.name, header, [f for _, f in self.rows], [k for k, _ in self.rows])


def _mercury_packing(
    step: _TimeStep,
    links: Table,
    mu: float,
    cell: Cell,
    walls: str | None,
    reverse: bool,
    most_grains: int | None,
) -> Packing:
    grains = step.table()
    plane = _plane(grains, 3 if "z" in grains.header else 2)
    ids = {row: row for row in range(len(grains.rows))}
    x = np.column_stack([grains.numbers(axis) for axis in plane])
    first, second = links.numbers("i"), links.numbers("j")
    at_wall = np.flatnonzero((first >= 0) & (second < 0))
    on_walls = None
    if len(at_wall):
        wall_links = links.some(at_wall)
        grain = wall_links.lookup("i", ids)
        point = np.column_stack([wall_links.numbers(axis) for axis in plane])
        out = cell.nearest(point - x[grain])
        normal, force = _mercury_forces(wall_links, plane)
        names, number = np.unique(wall_links.fields("j"), return_inverse=True)
        # The force acts on the grain if n points to it, away from the wall.
        sign = np.where(np.sum(normal * out, axis=1) < 0, -1.0, 1.0)[:, None]
        on_walls = _OnWalls(grain, number, sign * normal, sign * force, names.tolist())
    links = links.some(np.flatnonzero((first >= 0) & (second >= 0)))
    i, j = links.lookup("i", ids), links.lookup("j", ids)
    normal, force = _mercury_forces(links, plane)
    # The force acts on the grain that n points to.
    to_first = np.sum(normal * cell.nearest(x[j] - x[i]), axis=1) < 0
    force[to_first] *= -1
    return _packing(
        *(grains, plane, links, i, j, force, mu, cell, on_walls, walls, reverse, most_grains),
        "mercury",
    )


def _mercury_forces(links: Table, plane: str) -> tuple[Floats, Floats]:
    """The unit vectors n (k, 2), and the forces along n and t."""
    normal, tangent = (
        np.column_stack([links.numbers(f"{kind}{axis}") for axis in plane]) for kind in "nt"
    )
    force = links.numbers("fn")[:, None] * normal + links.numbers("ft")[:, None] * tangent
    return normal, force


def _packing(
    grains: Table,
    plane: str,
    links: Table,
    i: Integers,
    j: Integers,
    force: Floats,
    mu: float,
    cell: Cell,
    on_walls: _OnWalls | None,
    walls: str | None,
    reverse: bool,
    most_grains: int | None,
    source: str,
) -> Packing:
    """The packing of disks with forces (k, 2) on j, and with walls or their forces."""
    check_grains(len(grains.rows), most_grains, grains.name)
    x = cell.wrapped(np.column_stack([grains.numbers(axis) for axis in plane]))
    r = grains.numbers("r")
    check_disks(x, r, cell, grains.place)
    if walls not in (None, *WALLS):
        raise InputError(f"walls are {' or '.join(WALLS)}, got {walls!r:.40}")
    if walls and on_walls is None:
        raise InputError(f"{links.name}: no contact with a wall; leave out walls (--walls)")
    carrying = np.flatnonzero(force.any(axis=1))
    if not len(carrying) and not walls:
        raise InputError(
            f"{links.name}: no contact of two grains carries force; is the packing compressed?"
        )
    skipped = len(force) - len(carrying)
    on_j = force[carrying]
    left = once(i[carrying], j[carrying], on_j, LOAD_MISFIT, lambda c: links.place(carrying[c]))
    on_j, carrying = on_j[left], carrying[left]
    joined = listed(x, r, cell, i[carrying], j[carrying], lambda c: links.place(carrying[c]))
    forces = components(on_j, joined.normal)
    info: dict[str, Any] = {"forces": "given", "contacts_skipped": skipped}
    if on_walls is not None:
        info["notes"] = [_note_of(on_walls, walls, cell)]
    if walls and on_walls is not None:
        x, r, of_walls, forces_on_walls = _as_grains(on_walls, x, r)
        joined, forces = joined.joined(of_walls), np.concatenate([forces, forces_on_walls])
        info["walls"] = len(r) - len(grains.rows)
    packing = make_packing(
        x, r, cell.box, joined, forces, mu, info={"source": source}, tilt=cell.tilt
    )
    packing = adopt(packing, reverse=reverse, **info)
    if walls == "held":
        load = packing.load.copy()
        load[len(grains.rows) :] = np.nan
        packing = packing._replace(load=load)
    return packing


def _note_of(on_walls: _OnWalls, walls: str | None, cell: Cell) -> str:
    """A note on contacts with walls; InputError for walls in a periodic box."""
    count, names = len(on_walls.grain), some_of(on_walls.names)
    if not np.isinf(cell.box).any():
        if walls:
            raise InputError("a box that is periodic in both directions has no walls")
        return f"{count} contacts with walls ({names}) are left out: the box is periodic"
    if walls:
        return f"{count} contacts with walls ({names}) are contacts of the packing"
    return (
        f"{count} contacts with walls ({names}) count as loads on the grains; --walls {WALLS[0]} "
        f"or {WALLS[1]} makes them contacts"
    )


def _as_grains(on_walls: _OnWalls, x: Floats, r: Floats) -> tuple[Floats, Floats, Contacts, Floats]:
    """Centres and radii of grains and walls, the contacts of walls, and their forces (w, 2).

    A wall is a grain behind the places where it is touched; forces on it have no lever arm, so its
    torque does not count.
    """
    # Walls parallel to the plane exert no force in it.
    pressed = np.flatnonzero(on_walls.normal.any(axis=1) & on_walls.force.any(axis=1))
    grain, normal = on_walls.grain[pressed], on_walls.normal[pressed]
    walls, wall = np.unique(on_walls.wall[pressed], return_inverse=True)
    radius = r.mean()
    behind = x[grain] + (r[grain] + 2 * radius)[:, None] * normal
    places = np.zeros((len(walls), 2))
    np.add.at(places, wall, behind / np.bincount(wall)[wall][:, None])
    radii = np.concatenate([r, np.full(len(walls), radius)])
    contacts = make_contacts(grain, len(r) + wall, normal, r[grain] + radius, radii)
    contacts = contacts._replace(arm_i=r[grain], arm_j=np.zeros(len(grain)))
    forces = components(on_walls.force[pressed], normal)
    return np.concatenate([x, places]), radii, contacts, forces


def _cell(box: npt.ArrayLike | None, tilt: float) -> Cell:
    return make_cell((np.inf, np.inf) if box is None else box, tilt)


def _plane(table: Table, dimensions: int) -> str:
    """The two axes of the plane that contains the centres."""
    if dimensions == 2:
        return "xy"
    spread = {axis: float(np.ptp(table.numbers(axis))) for axis in "xyz"}
    thin = min("zyx", key=spread.__getitem__)
    if spread[thin] > _FLAT * table.numbers("r").mean():
        raise InputError(
            f"{table.name}: centres do not lie in a plane (x, y, z reach over "
            f"{', '.join(f'{spread[axis]:.3g}' for axis in 'xyz')}); only a single layer can be "
            "read"
        )
    return "".join(axis for axis in "xyz" if axis != thin)


def _split(source: Source) -> tuple[str, list[tuple[int, list[str]]], list[str], bool]:
    """Name, [(line number, fields)], the comments before the first line of numbers, and whether the
    last line ends: of one that does not, the last number may be cut off.
    """
    name, text = read_text(source)
    rows, comments = [], []
    for number, line in enumerate(text.splitlines(), start=1):
        if line.lstrip().startswith("#"):
            comments.append(line.lstrip("# \t").lower())
        elif line.strip():
            rows.append((number, line.replace(",", " ").split()))
    if not rows:
        raise InputError(f"{name}: no line with numbers")
    return name, rows, comments, text.endswith("\n") or line.lstrip().startswith("#")


def _yade_links(source: Source, named: bool) -> Table:
    """A Table of interactions, with the names of the file if valid, otherwise the standard ones."""
    name, rows, comments, _ = _split(source)
    words = [word.lower() for word in rows[0][1]]
    if is_number(words[0]):
        words = comments[-1].split() if comments else []
    else:
        rows = rows[1:]
    if not rows:
        raise InputError(f"{name}: no line with numbers")
    if len(words) != len(rows[0][1]) or not (named or set(_INTERACTION) <= set(words)):
        words = list(_INTERACTION)
    return make_table(name, words, [fields for _, fields in rows], [k for k, _ in rows])


def _yade_bodies(source: Source) -> Table:
    """A Table of bodies, with columns given by the format and the last comment."""
    name, rows, comments, _ = _split(source)
    formats = [words[-1] for words in map(str.split, comments) if words[:1] == ["format"]]
    header = (formats[0] if formats else "x_y_z_r").removesuffix("_attrs").split("_")
    more = len(rows[0][1]) - len(header)
    if more > 0:
        others = [line.split() for line in comments if not line.startswith("format")]
        words = others[-1] if others else []
        words = words if len(words) == more else words[len(header) :]
        if len(words) != more:
            words = [f"column {len(header) + k + 1}" for k in range(more)]
        header += ["id" if word == "b.id" else word for word in words]
    return make_table(name, header, [fields for _, fields in rows], [k for k, _ in rows])


def _mercury_steps(source: Source) -> tuple[list[_TimeStep], str]:
    """The complete time steps, at least one, and a description of one that is cut off."""
    name, rows, _, ended = _split(source)
    at = 0
    steps: list[_TimeStep] = []
    while at < len(rows):
        number, fields = rows[at]
        lost = f"time step {len(steps)} is cut off in {name}"
        is_empty = fields[0] == "0" and len(fields) in (6, 8) and (ended or at < len(rows) - 1)
        if steps and at == len(rows) - 1 and not is_empty:
            return steps, lost
        if len(fields) not in (6, 8):
            raise InputError(
                f"{name}, line {number}: expected N, time and the domain, got "
                f"{len(fields)} fields; is it a .data file of MercuryDPM?"
            )
        head = make_table(name, ("n", "time"), [fields[:2]], [number])
        count, left = head.numbers("n")[0], rows[at + 1 :]
        if not (count.is_integer() and (count > 0 or is_empty)):
            raise InputError(f"{name}, line {number}: {fields[0][:20]} particles are announced")
        left = left[: int(count)]
        whole = is_empty or (ended and len(left) == count and len(left[-1][1]) >= len(left[0][1]))
        if steps and at + 1 + len(left) == len(rows) and not whole:
            return steps, lost
        if len(left) < count:
            raise InputError(
                f"{name}, line {number}: {fields[0][:20]} particles are announced, and "
                f"{len(left)} lines follow; is the file cut off?"
            )
        steps.append(_TimeStep(name, float(head.numbers("time")[0]), len(fields), left))
        at += 1 + int(count)
    return steps, ""


def _mercury_contacts(source: Source) -> tuple[Table, Floats, bool]:
    """A Table of the contacts, their times, and whether the last line is cut off."""
    name, rows, _, ended = _split(source)
    short = len(rows) > 1 and len(rows[-1][1]) < len(_FSTAT)
    whole = rows[:-1] if short else rows
    table = make_table(name, _FSTAT, [fields for _, fields in whole], [k for k, _ in whole])
    times = table.numbers("time")
    if short and len(np.unique(times)) == 1:
        number, fields = rows[-1]
        raise InputError(
            f"{name}, line {number}: {len(fields)} fields where there should be {len(_FSTAT)}; is "
            "the file cut off?"
        )
    return table, times, short or not ended
