"""Packings of simulations by YADE and MercuryDPM, from the text files that they write.

YADE: bodies by `export.textExt` (format x_y_z_r, or x_y_z_r_attrs with a column id in its comment;
without, ids count the lines from 0), and a line for each interaction with id1, id2 and the vectors
phys.normalForce and phys.shearForce, which its documentation (NormShearPhys) gives in global
coordinates, as sustained by particle #2 from particle #1.

MercuryDPM: $name.data and $name.fstat as its documentation ("Output files", docs.mercurydpm.org)
has them: for each time step a line N, time and the domain, then the particles (x, y, z, velocity,
radius, angles, angular velocity, info; in two dimensions x, y, velocity, radius, angle, angular
velocity, info); and comments, then a line for each contact with time, i, j (below 0: a wall), the
contact point, overlap, tangential spring, |f_n|, |f_t|, the unit vectors n and t. n and t are those
of the force on i where n points from j to i, and of the force on j otherwise.

Both are three-dimensional; a layer of disks (spheres) is taken, in the plane in which its centres
lie. What walls and gravity do to grains becomes their load.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from granforce.packing.importers.geometry import check_disks, components, listed
from granforce.packing.importers.network import adopt
from granforce.packing.importers.text import Source, Table, check_grains, make_table, read_text
from granforce.records import (
    Cell,
    Floats,
    InputError,
    Integers,
    Packing,
    friction,
    make_cell,
    make_packing,
)

# Centres lie in a plane where they leave it by less than this part of a radius.
_FLAT = 1e-3
_INTERACTION = ("id1", "id2", "fnx", "fny", "fnz", "fsx", "fsy", "fsz")
_FSTAT = ("time", "i", "j", "x", "y", "z", "delta", "deltat", "fn", "ft")
_FSTAT += ("nx", "ny", "nz", "tx", "ty", "tz")
# Columns of a line of particles by their number, and whether the line before has the domain in 3-D.
_DATA = {
    (14, 8): ("x", "y", "z", "vx", "vy", "vz", "r", "q1", "q2", "q3", "wx", "wy", "wz", "info"),
    (8, 8): ("x", "y", "z", "vx", "vy", "vz", "r", "info"),
    (8, 6): ("x", "y", "vx", "vy", "r", "angle", "w", "info"),
}


def read_yade(
    bodies: Source,
    interactions: Source,
    mu: Any,
    *,
    box: npt.ArrayLike | None = None,
    tilt: float = 0.0,
    most_grains: int | None = None,
) -> Packing:
    """A Packing from YADE's bodies and interactions (paths or open files).

    box: (L_x, L_y) of the plane, inf for an open direction; None: open. tilt: of the cell, whose
    upper side begins at (tilt, L_y). Raises InputError naming file and line.
    """
    grains, links = _yade_bodies(bodies), _lines_of(interactions, _INTERACTION)
    plane = _plane(grains, 3)
    ids = (
        grains.index("id")
        if "id" in grains.header
        else {row: row for row in range(len(grains.rows))}
    )
    i, j = links.lookup("id1", ids), links.lookup("id2", ids)
    force = np.column_stack([links.numbers(f"fn{k}") + links.numbers(f"fs{k}") for k in plane])
    return _packing(
        *(grains, plane, links, i, j, force, friction(mu), _cell(box, tilt), most_grains, "yade")
    )


def read_mercury(
    data: Source,
    fstat: Source,
    mu: Any,
    *,
    step: int | None = None,
    box: npt.ArrayLike | None = None,
    tilt: float = 0.0,
    most_grains: int | None = None,
) -> Packing:
    """A Packing from MercuryDPM's .data and .fstat (paths or open files).

    step: number of the time step in the files, from 0; by default the last. box, tilt: as
    for `read_yade`. Raises InputError naming file and line.
    """
    cell = _cell(box, tilt)
    grains, time = _mercury_particles(data, step)
    links = _mercury_contacts(fstat, time)
    plane = _plane(grains, 3 if "z" in grains.header else 2)
    first, second = links.numbers("i"), links.numbers("j")
    inner = np.flatnonzero((first >= 0) & (second >= 0))
    if not len(inner):
        raise InputError(f"{links.name}: no contact between two particles at time {time:g}")
    links = links.some(inner)
    ids = {row: row for row in range(len(grains.rows))}
    i, j = links.lookup("i", ids), links.lookup("j", ids)
    x = np.column_stack([grains.numbers(axis) for axis in plane])
    normal, tangent = (
        np.column_stack([links.numbers(f"{kind}{axis}") for axis in plane]) for kind in "nt"
    )
    force = links.numbers("fn")[:, None] * normal + links.numbers("ft")[:, None] * tangent
    # That of the grain that n points to.
    to_first = np.sum(normal * cell.nearest(x[j] - x[i]), axis=1) < 0
    force[to_first] *= -1
    once, keep = set(), []
    for k, pair in enumerate(zip(i.tolist(), j.tolist(), strict=True)):
        if tuple(sorted(pair)) not in once:
            once.add(tuple(sorted(pair)))
            keep.append(k)
    return _packing(
        *(grains, plane, links.some(keep), i[keep], j[keep], force[keep]),
        *(friction(mu), cell, most_grains, "mercury"),
    )


def _packing(
    grains: Table,
    plane: str,
    links: Table,
    i: Integers,
    j: Integers,
    force: Floats,
    mu: float,
    cell: Cell,
    most_grains: int | None,
    source: str,
) -> Packing:
    """The packing of disks and of the forces (N_c, 2) on j."""
    check_grains(len(grains.rows), most_grains, grains.name)
    x = cell.wrapped(np.column_stack([grains.numbers(axis) for axis in plane]))
    r = grains.numbers("r")
    check_disks(x, r, cell, grains.place)
    carrying = np.flatnonzero(force.any(axis=1))
    if not len(carrying):
        raise InputError(f"{links.name}: no contact carries force; is the packing compressed?")
    joined = listed(x, r, cell, i[carrying], j[carrying], lambda c: links.place(carrying[c]))
    forces = components(force[carrying], joined.normal)
    info = {"source": source, "contacts_skipped": len(force) - len(carrying)}
    return adopt(
        make_packing(x, r, cell.box, joined, forces, mu, info=info, tilt=cell.tilt), forces="given"
    )


def _cell(box: npt.ArrayLike | None, tilt: float) -> Cell:
    return make_cell((np.inf, np.inf) if box is None else box, tilt)


def _plane(table: Table, dimensions: int) -> str:
    """The two axes of the plane in which centres lie."""
    if dimensions == 2:
        return "xy"
    spread = {axis: float(np.ptp(table.numbers(axis))) for axis in "xyz"}
    thin = min("zyx", key=spread.__getitem__)
    if spread[thin] > _FLAT * table.numbers("r").mean():
        raise InputError(
            f"{table.name}: centres do not lie in a plane (x, y, z reach over "
            f"{', '.join(f'{spread[axis]:.3g}' for axis in 'xyz')}); only a layer is read"
        )
    return "".join(axis for axis in "xyz" if axis != thin)


def _split(source: Source) -> tuple[str, list[tuple[int, list[str]]], list[str]]:
    """Name, [(line number, fields)], and the comments before the first line of numbers."""
    name, text = read_text(source)
    rows, comments = [], []
    for number, line in enumerate(text.splitlines(), start=1):
        if line.lstrip().startswith("#"):
            comments.append(line.lstrip("# \t").lower())
        elif line.strip():
            rows.append((number, line.replace(",", " ").split()))
    if not rows:
        raise InputError(f"{name}: no line with numbers")
    return name, rows, comments


def _lines_of(source: Source, header: Sequence[str]) -> Table:
    """A Table of lines with these columns, a first line with names left out."""
    name, rows, _ = _split(source)
    if not rows[0][1][0].lstrip("+-").replace(".", "").isdigit():
        rows = rows[1:]
    return make_table(name, header, [fields for _, fields in rows], [k for k, _ in rows])


def _yade_bodies(source: Source) -> Table:
    name, rows, comments = _split(source)
    header = ["x", "y", "z", "r"]
    width = len(rows[0][1])
    if width > 4:
        words = comments[-1].split() if comments else []
        words = words if len(words) == width - 4 else words[4:]
        if len(words) != width - 4:
            words = [f"column {k}" for k in range(5, width + 1)]
        header += words
    return make_table(name, header, [fields for _, fields in rows], [k for k, _ in rows])


def _mercury_particles(source: Source, step: int | None) -> tuple[Table, float]:
    """A Table of the particles of one step, and its time."""
    name, rows, _ = _split(source)
    at, steps = 0, []
    while at < len(rows):
        number, fields = rows[at]
        if len(fields) not in (6, 8):
            raise InputError(
                f"{name}, line {number}: N, time and the domain are wanted, and "
                f"{len(fields)} fields are there; is it a .data of MercuryDPM?"
            )
        head = make_table(name, ("n", "time"), [fields[:2]], [number])
        count = head.numbers("n")[0]
        if not (count.is_integer() and 0 < count <= len(rows) - at - 1):
            raise InputError(
                f"{name}, line {number}: {fields[0][:20]} particles are announced, and "
                f"{len(rows) - at - 1} lines follow; is the file cut off?"
            )
        steps.append((head.numbers("time")[0], len(fields), rows[at + 1 : at + 1 + int(count)]))
        at += 1 + int(count)
    if step is not None and not 0 <= step < len(steps):
        raise InputError(f"{name}: no step {step}; there are {len(steps)}, from 0")
    time, domain, lines = steps[-1 if step is None else step]
    header = _DATA.get((len(lines[0][1]), domain))
    if header is None:
        raise InputError(
            f"{name}, line {lines[0][0]}: {len(lines[0][1])} fields of a particle; 8 or 14 are read"
        )
    return make_table(name, header, [f for _, f in lines], [k for k, _ in lines]), time


def _mercury_contacts(source: Source, time: float) -> Table:
    """A Table of the contacts at a time, as nearly as files with few digits have it."""
    name, rows, _ = _split(source)
    table = make_table(name, _FSTAT, [fields for _, fields in rows], [k for k, _ in rows])
    times = table.numbers("time")
    nearest = times[np.argmin(np.abs(times - time))]
    if abs(nearest - time) > 1e-4 * max(abs(time), abs(nearest)):
        raise InputError(
            f"{name}: no contacts at time {time:g}; they are of {times.min():g} … {times.max():g}"
        )
    return table.some(np.flatnonzero(times == nearest))
