"""Packings from text files written by MercuryDPM.

$name.data and $name.fstat are as documented ("Output files", docs.mercurydpm.org). The first has
for each time step a line with N, time and the domain, then the particles (x, y, z, velocity,
radius, angles, angular velocity, info; in two dimensions x, y, velocity, radius, angle, angular
velocity, info). The second has comments, then a line for each contact with time, i, j (below 0: a
wall), the contact point, overlap, tangential spring, |f_n|, |f_t|, the unit vectors n and t. n and
t are those of the force on i if n points from j to i, and of the force on j otherwise.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.cell import Cell
from granforce.packing.importers.layers import (
    Layer,
    WallContacts,
    make_options,
    packing_of,
    plane_of,
    vectors_in,
)
from granforce.packing.importers.network import refuse_idle_reverse
from granforce.packing.importers.notes import packing_noted
from granforce.packing.importers.snapshots import Snapshot, Snapshots, with_walls
from granforce.packing.importers.text import Source, Table, read_rows
from granforce.records import InputError, Packing
from granforce.system.files import path_text
from granforce.system.series import numbered_files
from granforce.types import Floats, Integers

_CONTACT = ("time", "i", "j", "x", "y", "z", "delta", "deltat", "fn", "ft")
_CONTACT += ("nx", "ny", "nz", "tx", "ty", "tz")
# Columns of a particle line by their number, and whether the line before has the 3-D domain.
_PARTICLE = {
    (14, 8): ("x", "y", "z", "vx", "vy", "vz", "r", "q1", "q2", "q3", "wx", "wy", "wz", "info"),
    (8, 8): ("x", "y", "z", "vx", "vy", "vz", "r", "info"),
    (8, 6): ("x", "y", "vx", "vy", "r", "angle", "w", "info"),
}
# Times differ by less than this fraction if they are the same.
_SAME_TIME = 1e-4


class _Step(NamedTuple):
    """The particles of one time step."""

    time: float
    particles: Table  # without names of columns; no rows in an empty step
    domain: int  # number of fields of the line before

    def grains(self) -> Table:
        """The particles with names of columns."""
        count = len(self.particles.rows[0])
        header = _PARTICLE.get((count, self.domain))
        if header is None:
            raise InputError(
                f"{self.particles.place(0)}: {count} fields for a particle; expected 8 or 14"
            )
        return self.particles.named(header)


class _Steps(NamedTuple):
    """The time steps of the particles."""

    name: str  # of the file
    steps: list[_Step]  # those with all particles, at least one
    lost: str  # a description of one that is cut off, or ""
    is_cut: bool  # whether the last line may be cut off

    @property
    def times(self) -> Floats:
        return np.array([step.time for step in self.steps])

    @property
    def are_filled(self) -> npt.NDArray[np.bool_]:
        return np.array([bool(step.particles.rows) for step in self.steps])


class _ContactList(NamedTuple):
    """The contacts of all time steps."""

    table: Table
    times: Floats  # (rows,)
    is_cut: bool  # whether the last line may be cut off

    def of(self, time: float) -> Table:
        """The contacts of one time."""
        return self.table.some(np.flatnonzero(self.times == time))


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
        The two files; without a file of this name, the files NAME.0000, NAME.0001, … (or NAME.0,
        NAME.1, …) that hold one step each.
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
    options = make_options(mu, box, tilt, walls, reverse, most_grains)
    particles, contacts = _read_steps(data), _read_contacts(fstat)
    times = _times_of_contacts(particles, contacts)
    numbers = np.flatnonzero(np.isfinite(times)).tolist()
    if not numbers:
        raise InputError(
            f"{contacts.table.name}: no contacts at times of particles, the last of which is "
            f"{particles.times[-1]:g}; "
            f"they are of {contacts.times.min():g} … {contacts.times.max():g}"
        )
    empty, lost = _missing(particles, times), particles.lost
    if len(numbers) > 1 and (name := _cut_file(particles, contacts, numbers[-1], times)):
        lost = lost or f"time step {numbers[-1]} is cut off in {name}"
        numbers = numbers[:-1]

    def read(number: int) -> Snapshot:
        step = particles.steps[number]
        layer = _layer(step.grains(), contacts.of(times[number]), options.cell)
        packing = packing_of(layer, options, "mercury")
        info = packing.info | {"time": step.time}
        ids = with_walls(np.arange(float(len(layer.grains.rows))), info.get("walls", 0))
        return Snapshot(packing._replace(info=info), ids)

    return Snapshots("time step", numbers, read, lost, empty)


def _times_of_contacts(particles: _Steps, contacts: _ContactList) -> Floats:
    """The time (steps,) that the contacts of each step have in their file, NaN without contacts.

    Of several steps with nearly the time of some contacts, these are of the one nearest to it.
    """
    times, stored = particles.times, np.unique(contacts.times)
    which = np.array([np.argmin(np.abs(stored - time)) for time in times])
    nearest = stored[which]
    off = np.where(particles.are_filled, np.abs(nearest - times), np.inf)
    same = off <= _SAME_TIME * np.maximum(np.abs(nearest), np.abs(times))
    same &= off <= np.array([off[which == k].min() for k in which])
    return np.where(same, nearest, np.nan)


def _missing(particles: _Steps, times: Floats) -> dict[int, str]:
    """What is missing in the empty time steps; times: of the contacts, NaN without them."""
    filled = particles.are_filled
    return {
        k: "contacts" if filled[k] else "particles"
        for k in np.flatnonzero(np.isnan(times)).tolist()
    }


def _cut_file(particles: _Steps, contacts: _ContactList, number: int, times: Floats) -> str:
    """The name of a file that is cut off within this time step, "" if none is."""
    if particles.is_cut and number == len(particles.steps) - 1:
        return particles.name
    return contacts.table.name if contacts.is_cut and times[number] == contacts.times[-1] else ""


def _layer(grains: Table, links: Table, cell: Cell) -> Layer:
    """The Layer of particles and contacts of one time step."""
    plane = plane_of(grains) if "z" in grains.header else "xy"
    ids = {row: row for row in range(len(grains.rows))}
    x = vectors_in(grains, plane)
    first, second = links.numbers("i"), links.numbers("j")
    at_wall = np.flatnonzero((first >= 0) & (second < 0))
    on_walls = None
    if len(at_wall):
        wall_links = links.some(at_wall)
        grain = wall_links.lookup("i", ids)
        on_walls = _wall_contacts(wall_links, grain, x[grain], plane, cell)
    links = links.some(np.flatnonzero((first >= 0) & (second >= 0)))
    i, j = links.lookup("i", ids), links.lookup("j", ids)
    normal, force = _forces(links, plane)
    # The force acts on the grain that n points to.
    to_first = np.sum(normal * cell.nearest(x[j] - x[i]), axis=1) < 0
    force[to_first] *= -1
    return Layer(grains, plane, links, i, j, force, on_walls)


def _wall_contacts(
    links: Table, grain: Integers, x: Floats, plane: str, cell: Cell
) -> WallContacts:
    """The WallContacts of grains (w,) with centres x (w, 2)."""
    out = cell.nearest(vectors_in(links, plane) - x)
    normal, force = _forces(links, plane)
    names, wall = np.unique(links.fields("j"), return_inverse=True)
    # The force acts on the grain if n points to it, away from the wall.
    sign = np.where(np.sum(normal * out, axis=1) < 0, -1.0, 1.0)[:, None]
    return WallContacts(grain, wall, sign * normal, sign * force, names.tolist())


def _forces(links: Table, plane: str) -> tuple[Floats, Floats]:
    """The unit vectors n (k, 2), and the forces along n and t."""
    normal, tangent = vectors_in(links, plane, "n"), vectors_in(links, plane, "t")
    force = links.numbers("fn")[:, None] * normal + links.numbers("ft")[:, None] * tangent
    return normal, force


def _read_parts(source: Source) -> Table:
    """The rows of a file, or of all its numbered files."""
    return read_rows(*([source] if hasattr(source, "read") else numbered_files(path_text(source))))


def _read_steps(source: Source) -> _Steps:
    """The time steps of a .data file."""
    table = _read_parts(source)
    steps: list[_Step] = []
    at = 0
    while at < len(table.rows):
        lost = f"time step {len(steps)} is cut off in {table.name}"
        is_empty = _is_empty(table, at)
        if steps and at == len(table.rows) - 1 and not is_empty:
            return _Steps(table.name, steps, lost, False)
        count = _announced(table, at, is_empty)
        particles = table.some(range(at + 1, min(at + 1 + count, len(table.rows))))
        is_last = at + 1 + len(particles.rows) == len(table.rows)
        if steps and is_last and not (is_empty or _has_all(particles, count)):
            return _Steps(table.name, steps, lost, False)
        if len(particles.rows) < count:
            raise InputError(
                f"{table.place(at)}: {table.rows[at][0][:20]} particles are announced, and "
                f"{len(particles.rows)} lines follow; is the file cut off?"
            )
        time = float(_head(table, at).numbers("time")[0])
        steps.append(_Step(time, particles, len(table.rows[at])))
        at += 1 + count
    return _Steps(table.name, steps, "", not table.complete)


def _head(table: Table, at: int) -> Table:
    """The number of particles and the time in the first line of a step."""
    return table.some([at])._replace(rows=[table.rows[at][:2]]).named(("n", "time"))


def _is_empty(table: Table, at: int) -> bool:
    """Whether a step that begins in a row has no particles; a 0 may be the rest of a number."""
    fields, is_last = table.rows[at], at == len(table.rows) - 1
    return fields[0] == "0" and len(fields) in (6, 8) and (table.complete or not is_last)


def _announced(table: Table, at: int, is_empty: bool) -> int:
    """The number of particles that the first line of a step announces; InputError if invalid."""
    fields = table.rows[at]
    if len(fields) not in (6, 8):
        raise InputError(
            f"{table.place(at)}: expected N, time and the domain, got "
            f"{len(fields)} fields; is it a .data file of MercuryDPM?"
        )
    count = _head(table, at).numbers("n")[0]
    if not (count.is_integer() and (count > 0 or is_empty)):
        raise InputError(f"{table.place(at)}: {fields[0][:20]} particles are announced")
    return int(count)


def _has_all(particles: Table, count: int) -> bool:
    """Whether there are as many particles as announced, the last with all its fields."""
    rows = particles.rows
    return len(rows) == count and len(rows[-1]) >= len(rows[0])


def _read_contacts(source: Source) -> _ContactList:
    """The contacts of an .fstat file."""
    table = _read_parts(source)
    last = table.some([len(table.rows) - 1])
    is_short = len(table.rows) > 1 and len(last.rows[0]) < len(_CONTACT)
    if is_short:
        table = table.some(range(len(table.rows) - 1))
    table = table.named(_CONTACT)
    times = table.numbers("time")
    if is_short and len(np.unique(times)) == 1:
        raise InputError(
            f"{last.place(0)}: {len(last.rows[0])} fields where there should be {len(_CONTACT)}; "
            "is the file cut off?"
        )
    return _ContactList(table, times, is_short or not table.complete)
