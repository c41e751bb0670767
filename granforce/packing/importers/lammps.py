"""Packings from LAMMPS: ``dump custom`` of the particles, ``dump local`` of the contacts."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from granforce.cell import Cell
from granforce.packing.importers.geometry import (
    MISFIT,
    OVERLAP_ALLOWED,
    check_disks,
    components,
    distinct_pairs,
    listed_contacts,
)
from granforce.packing.importers.layers import (
    Network,
    Options,
    WallContacts,
    assembled,
    check_walls,
)
from granforce.packing.importers.network import LOAD_MISFIT, refuse_idle_reverse, with_edge
from granforce.packing.importers.notes import packing_noted, with_notes
from granforce.packing.importers.snapshots import Snapshot, Snapshots, with_walls
from granforce.packing.importers.text import (
    Source,
    Table,
    check_grains,
    make_table,
    read_text,
    renamed,
    some_of,
)
from granforce.records import Contacts, InputError, Packing, friction, make_cell
from granforce.types import Floats

# Columns of the contact dump: grains, centre distance, normal and tangential force on atom1.
CONTACT_COLUMNS = ("atom1", "atom2", "distance", "fx", "fy", "px", "py")
# Columns of positions, wrapped and unwrapped, in fractions of the box sides (``dump atom``).
SCALED = ("xs", "ys"), ("xsu", "ysu")
AXES = ("x", "y"), ("xu", "yu"), *SCALED
NAMES = ("id", *itertools.chain(*AXES), "radius", "diameter", *CONTACT_COLUMNS)

# Largest deviation of the normal force from the line of centres, in mean contact forces; beyond,
# the columns are not what their order suggests.
SKEW = 1e-2

# Titles of items that have more than one word.
_TITLES = ("NUMBER OF", "BOX BOUNDS")


class _Item(NamedTuple):
    line: int  # line number of its title
    words: list[str]  # the rest of the title line
    body: list[list[str]]  # the lines below, as lists of words


class _Box(NamedTuple):
    low: Floats  # (2,) origin
    turn: Floats  # (2, 2) rotates row vectors of the dump by v @ turn, so that a lies along x
    vectors: Floats  # (2, 2) its sides after that, in rows, periodic or not
    cell: Cell


class Dump(NamedTuple):
    """A dump, divided into its snapshots."""

    name: str
    lines: list[str]
    at: dict[int, range]  # {timestep: its lines}, in the file's order; the last of equal ones
    ended: bool  # whether the last line ends: of one that does not, the last number may be cut off

    def items(self, step: int) -> dict[str, _Item]:
        """The items of a snapshot by their titles."""
        found: dict[str, _Item] = {}
        item = None
        for k in self.at[step]:
            line = self.lines[k]
            if line.startswith("ITEM:"):
                title, rest = _title(line[5:].strip())
                item = found[title] = _Item(k + 1, rest, [])
            elif item is not None and line.strip():
                item.body.append(line.split())
        return found

    def announced(self, step: int) -> str:
        """The number of rows that a snapshot announces, "" without one."""
        lines = (self.lines[k].strip() for k in self.at[step])
        after = itertools.dropwhile(lambda line: not line.startswith("ITEM: NUMBER OF"), lines)
        return next(filter(None, itertools.islice(after, 1, None)), "")

    def is_cut(self, step: int) -> bool:
        """Whether the file ends before all rows of a snapshot, or within the last."""
        if self.at[step].stop != len(self.lines):
            return False
        if not self.ended:
            return True
        items = self.items(step)
        number = items.get("NUMBER OF")
        item = items.get(" ".join(number.words)) if number else None
        if not (number and number.body and item):
            return True
        count = number.body[0][0]
        rows = item.body
        return count.isdecimal() and (
            len(rows) < int(count) or (bool(rows) and len(rows[-1]) < len(item.words))
        )


@packing_noted
def read_lammps(
    particles: Source,
    contacts: Source,
    mu: Any,
    *,
    frame: int | None = None,
    columns: Mapping[str, str] | None = None,
    walls: str | None = None,
    reverse: bool = False,
    most_grains: int | None = None,
) -> Packing:
    """A Packing from a particle dump and a contact dump, in LAMMPS' units.

    Pairs without force are neighbours, not contacts; pairs listed from both sides (newton off)
    count once. Grains are sorted by id. Coordinates are shifted so that the lower bounds of the box
    are 0. The box may be tilted in the plane (xy). Directions that are not periodic are open;
    unbalanced forces of grains become their load there.

    Parameters
    ----------
    particles : path or open file
        ``dump custom`` with id, x y (or xu yu, xs ys, xsu ysu) and radius (or diameter), in any
        order.
    contacts : path or open file
        ``dump local`` with the two grains, their distance, normal and tangential force on the
        first: columns named atom1 atom2 distance fx fy px py, or seven in this order and possibly
        an index; if they are named, the distance, which is only a check, may be missing, and px and
        py, too, if fx fy are the total force (`force` of LIGGGHTS). Vectors are in LAMMPS' own
        frame, in which the first side of the box lies along x.
    mu : float
        Friction coefficient.
    frame : int, optional
        The timestep, by default the last that is complete in both files.
    columns : mapping, optional
        {name here: name in the dumps} for columns with other names.
    walls : {"held", "pressing"}, optional
        As for `read_yade`, from the columns f_ID[1] … f_ID[8] of ``fix ID … wall/gran … contacts``
        in the particle dump. Each plane is a wall.
    reverse : bool, default False
        Change the sign of tangential forces.
    most_grains : int, optional
        Largest number of grains.

    Returns
    -------
    Packing
        info contains timestep, residual and violation (in ⟨f_n⟩), contacts_skipped and notes, which
        are also InputWarnings.

    Raises
    ------
    InputError
        Naming file and line.
    """
    found = open_lammps(
        *(particles, contacts, mu),
        columns=columns,
        walls=walls,
        reverse=reverse,
        most_grains=most_grains,
    )
    packing = found.chosen(frame).packing
    refuse_idle_reverse(packing.forces, reverse)
    return packing


def open_lammps(
    particles: Source,
    contacts: Source,
    mu: Any,
    *,
    columns: Mapping[str, str] | None = None,
    walls: str | None = None,
    reverse: bool = False,
    most_grains: int | None = None,
) -> Snapshots:
    """The Snapshots in both dumps, by timestep.

    Parameters
    ----------
    particles, contacts, mu, columns, walls, reverse, most_grains
        As for `read_lammps`.

    Returns
    -------
    Snapshots
        Its `read` gives the Snapshot of a number.
    """
    mu = friction(mu)
    check_walls(walls)
    first, second = read_dump(particles), read_dump(contacts)
    steps = [step for step in first.at if step in second.at]
    if not steps:
        raise InputError(
            f"{first.name} and {second.name} have no timestep in common; dump both at the same step"
        )
    # In the contacts' dump, too, a snapshot without atoms has no rows.
    empty = {step: "contacts" for step in steps if second.announced(step) == "0"}
    empty |= {step: "atoms" for step in steps if first.announced(step) == "0"}
    others = any(step not in empty for step in steps[:-1])
    cut = [dump.name for dump in (first, second) if others and dump.is_cut(steps[-1])]

    def read(step: int) -> Snapshot:
        items = first.items(step)
        atoms = _table(first.name, items, "ATOMS")
        entries = second.items(step)
        pairs = _table(second.name, entries, _label(entries))
        atoms, pairs = renamed({} if columns is None else columns, NAMES, atoms, pairs)
        check_grains(len(atoms.rows), most_grains, first.name)
        box = box_of(first.name, items)
        x, r, index = _disks(atoms, box)
        pairs = _with_names(pairs, bool(set(columns or {}) & set(CONTACT_COLUMNS)))
        joined, forces, skipped = _contacts(pairs, x, r, box.cell, index)
        on_walls = _wall_contacts(atoms, x, r, index, box) if walls else None
        found = assembled(
            *(on_walls, Network(x, r, joined, forces)),
            *(Options(mu, box.cell, walls, reverse, most_grains), "lammps"),
            timestep=step,
            contacts_skipped=skipped,
        )
        if "px" not in pairs.header:
            found = with_notes(found, _notes_on_total(forces, mu))
        found = found if walls or np.isfinite(found.volume) else with_edge(found)
        ids = np.sort(atoms.numbers("id"))
        return Snapshot(found, with_walls(ids, len(found.r) - len(ids)))

    whole = steps[:-1] if cut else steps
    empty = {step: empty[step] for step in whole if step in empty}
    filled = [step for step in whole if step not in empty]
    lost = f"timestep {steps[-1]} is cut off in {' and '.join(cut)}" if cut else ""
    # Reading one of them says which table is empty.
    return Snapshots("timestep", filled or whole, read, lost, empty if filled else {})


def read_dump(source: Source) -> Dump:
    """The Dump in a file; InputError if it is not a dump."""
    name, text = read_text(source)
    lines = text.splitlines()
    first = next(k for k, line in enumerate(lines) if line.strip())
    starts = [k for k, line in enumerate(lines) if line.startswith("ITEM: TIMESTEP")]
    if not lines[first].startswith("ITEM:") or not starts:
        raise InputError(f"{name}, line {first + 1}: no 'ITEM: TIMESTEP'; is it a LAMMPS dump?")
    at: dict[int, range] = {}
    for start, end in itertools.pairwise([*starts, len(lines)]):
        number = next((k for k in range(start + 1, end) if lines[k].strip()), None)
        if number is None and at and end == len(lines):
            break  # cut off before the number
        line = start if number is None else number
        step = _whole("" if number is None else lines[line].split()[0], name, line + 1)
        at.pop(step, None)
        at[step] = range(start, end)
    return Dump(name, lines, at, text.endswith("\n"))


def _title(heading: str) -> tuple[str, list[str]]:
    """The title of an item, one word except for _TITLES, and the words after it."""
    for title in (*_TITLES, heading.split(" ")[0]):
        if heading == title or heading.startswith(title + " "):
            return title, heading[len(title) :].split()
    return heading, []


def _label(items: dict[str, _Item]) -> str:
    """The label of rows in a contact dump: ENTRIES, or one set by `dump_modify label`."""
    label = " ".join(items["NUMBER OF"].words) if "NUMBER OF" in items else ""
    return label if label not in ("", "ATOMS") else "ENTRIES"


def _whole(word: str, name: str, line: int) -> int:
    if not word.isdecimal() or len(word) > 18:
        raise InputError(f"{name}, line {line}: {word[:40]!r} is not a whole number")
    return int(word)


def _item(name: str, items: dict[str, _Item], title: str) -> _Item:
    if title not in items:
        raise InputError(f"{name}: no 'ITEM: {title}' in the timestep; is it the right file?")
    return items[title]


def _table(name: str, items: dict[str, _Item], title: str) -> Table:
    item, number = _item(name, items, title), _item(name, items, "NUMBER OF")
    count = _whole(number.body[0][0] if number.body else "", name, number.line + 1)
    if count != len(item.body):
        raise InputError(
            f"{name}, line {item.line}: {len(item.body)} rows, but {count} are announced; "
            "is the file cut off?"
        )
    if count == 0:
        raise InputError(f"{name}, line {item.line}: the table is empty")
    lines = list(range(item.line + 1, item.line + 1 + count))
    return make_table(name, item.words, item.body, lines)


def box_of(name: str, items: dict[str, _Item]) -> _Box:
    """The box, whose cell is open along directions that are not periodic."""
    item = _item(name, items, "BOX BOUNDS")
    place, flags = f"{name}, line {item.line}", item.words
    kind = next((k for k in _SIDES if flags[: len(k)] == list(k)), ())
    flags = flags[len(kind) :]
    if len(flags) > 3 or any(len(flag) != 2 or not set(flag) <= set("pfsm") for flag in flags):
        raise InputError(f"{place}: boxes of kind {' '.join(item.words)!r} are not supported")
    columns, sides_of = _SIDES[kind]
    rows = [row[: len(columns)] for row in item.body[:3]]
    if len(rows) < 3:
        raise InputError(f"{place}: the box bounds are incomplete")
    lines = [item.line + k for k in (1, 2, 3)]
    low, sides = sides_of(make_table(name, columns, rows, lines))
    turn = np.array([[sides[0, 0], -sides[0, 1]], [sides[0, 1], sides[0, 0]]])
    turn /= np.hypot(*sides[0])
    sides = sides @ turn
    # Dumps of old versions have no flags; they were periodic by default.
    is_open = np.array([flag != "pp" for flag in [*flags, "pp", "pp"][:2]])
    try:
        cell = make_cell(np.where(is_open, np.inf, np.diag(sides)), sides[1, 0])
    except InputError as error:
        raise InputError(f"{place}: {error}") from None
    return _Box(low, turn, sides, cell)


def _straight_sides(bounds: Table) -> tuple[Floats, Floats]:
    """The lower corner (2,) and the sides (2, 2) of a box with a along x.

    Bounds of a tilted box (title ``xy xz yz``, tilts in a third column) are those of the rectangle
    around it: x_lo + min(0, xy), x_hi + max(0, xy) (docs.lammps.org, Howto triclinic).
    """
    low, high = bounds.numbers("lo")[:2], bounds.numbers("hi")[:2]
    # The height of the layer does not matter, but its tilts do.
    tilt = bounds.numbers("tilt") if "tilt" in bounds.header else np.zeros(1)
    for k in np.flatnonzero(tilt[1:])[:1] + 1:
        raise InputError(f"{bounds.place(k)}: tilted out of the plane; only xy may differ from 0")
    low[0] -= min(0.0, tilt[0])
    high[0] -= max(0.0, tilt[0])
    for k in np.flatnonzero(high <= low)[:1]:
        raise InputError(f"{bounds.place(k)}: the upper bound of the box is not above the lower")
    (width, height), lean = high - low, tilt[0]
    return low, np.array([[width, 0.0], [lean, height]])


def _general_sides(bounds: Table) -> tuple[Floats, Floats]:
    """The origin (2,) and the sides a, b (2, 2) of a box with any orientation in the plane.

    Rows are a, b, c with a component of the origin each (title ``abc origin``).
    """
    sides = np.column_stack([bounds.numbers(axis) for axis in "xyz"])
    flat = sides.copy()
    flat[:2, :2] = flat[2, 2] = 0.0
    for k in np.flatnonzero(flat.any(axis=1))[:1]:
        raise InputError(f"{bounds.place(k)}: a and b must lie in the x–y plane, and c along z")
    if np.linalg.det(sides) <= 0:
        raise InputError(f"{bounds.place(0)}: the sides a, b, c are not a right-handed system")
    return bounds.numbers("origin")[:2], sides[:2, :2]


# By the first words after BOX BOUNDS: the columns, and what reads the sides from them.
_SIDES: dict[tuple[str, ...], tuple[Sequence[str], Callable[[Table], tuple[Floats, Floats]]]] = {
    ("xy", "xz", "yz"): (("lo", "hi", "tilt"), _straight_sides),
    ("abc", "origin"): (("x", "y", "z", "origin"), _general_sides),
    (): (("lo", "hi"), _straight_sides),
}


def _disks(table: Table, box: _Box) -> tuple[Floats, Floats, dict[int | str, int]]:
    """Centres and radii in order of ids, and the row of each id, {id: row}."""
    order = np.argsort(table.numbers("id"), kind="stable")
    rank = np.argsort(order)
    index = {label: int(rank[row]) for label, row in table.index("id").items()}
    axes = next((pair for pair in AXES if set(pair) <= set(table.header)), AXES[0])
    x = np.column_stack([table.numbers(axis) for axis in axes])
    x = x @ box.vectors if axes in SCALED else (x - box.low) @ box.turn
    if "radius" not in table.header and "diameter" in table.header:
        r = table.numbers("diameter") / 2
    else:
        r = table.numbers("radius")
    x, r = box.cell.wrapped(x[order]), r[order]
    check_disks(x, r, box.cell, lambda g: table.place(order[g]))
    return x, r, index


def _contacts(
    table: Table, x: Floats, r: Floats, cell: Cell, index: Mapping[Any, int]
) -> tuple[Contacts, Floats, int]:
    """Contacts that carry force, their forces (N_c, 2), and the number of pairs without force."""
    i, j = (table.lookup(column, index) for column in ("atom1", "atom2"))
    pairs = [("fx", "fy"), ("px", "py")][: 2 if "px" in table.header else 1]
    # Forces are on atom1 = i; granforce uses those on j.
    parts = -np.array([[table.numbers(column) for column in pair] for pair in pairs])
    parts = np.moveaxis(parts, 1, 2)
    active = np.flatnonzero(parts.any(axis=(0, 2)))
    if not len(active):
        raise InputError(f"{table.name}: no contact carries force; is the packing compressed?")
    on_j = parts.sum(axis=0)[active]
    left = distinct_pairs(i[active], j[active], on_j, LOAD_MISFIT, lambda c: table.place(active[c]))
    skipped, active = len(i) - len(active), active[left]

    def place(c: int) -> str:
        return table.place(active[c])

    joined = listed_contacts(x, r, cell, i[active], j[active], place)
    if "distance" in table.header:
        _check_distances(joined.length, table.numbers("distance")[active], r.max(), place)
    forces = components(on_j[left], joined.normal)
    if len(parts) == 2:
        _check_along(components(parts[0][active], joined.normal), forces, place)
    return joined, forces, skipped


def _notes_on_total(forces: Floats, mu: float) -> list[str]:
    """A note if total forces, as components (N_c, 2), have no tangential part despite friction."""
    if mu == 0 or np.abs(forces[:, 1]).max() > SKEW * np.hypot(*forces.T).mean():
        return []
    return [
        "all forces point along the line of centres: if fx, fy are only the normal force, name the "
        "columns of the tangential force, too, as in --columns px=…,py=… (columns=)"
    ]


def _wall_contacts(
    atoms: Table, x: Floats, r: Floats, index: Mapping[Any, int], box: _Box
) -> WallContacts:
    """The WallContacts in the columns f_ID[1] … f_ID[8] of ``fix ID … wall/gran … contacts``.

    They are whether a grain touches, the force on it, the point of contact and its radius
    (docs.lammps.org, fix wall/gran), in LAMMPS' own frame.
    """
    fixes = [name[:-3] for name in atoms.header if name[:2] == "f_" and name.endswith("[8]")]
    axes = (1, 2, 3, 5, 6)
    values = {fix: np.column_stack([atoms.numbers(f"{fix}[{k}]") for k in axes]) for fix in fixes}
    at = [(fix, row) for fix in fixes for row in np.flatnonzero(values[fix][:, 0])]
    if not at:
        raise InputError(
            f"{atoms.name}: no contact with a wall; dump the columns f_ID[*] of a fix wall/gran "
            "with the keyword contacts, or leave out walls (--walls)"
        )
    names, rows = zip(*at, strict=True)
    force, point = np.hsplit(np.array([values[fix][row, 1:] for fix, row in at]), 2)
    grain = atoms.some(rows).lookup("id", index)
    out = box.cell.nearest(point - box.low - x[grain])
    length = np.hypot(*out.T)
    for c in np.flatnonzero(np.abs(length - r[grain]) > OVERLAP_ALLOWED * r[grain])[:1]:
        raise InputError(
            f"{atoms.place(rows[c])}: by {names[c]}[5], {names[c]}[6] the wall is "
            f"{length[c]:.3g} from the centre, but the radius is {r[grain[c]]:.3g}; are they of a "
            "fix wall/gran with the keyword contacts, and its planes across the layer?"
        )
    normal = out / length[:, None]
    # A fix has up to two parallel planes.
    sides = [
        f"{fix[2:]} ({u:g}, {v:g})"
        for fix, (u, v) in zip(names, np.round(normal) + 0.0, strict=True)
    ]
    planes, wall = np.unique(sides, return_inverse=True)
    return WallContacts(grain, wall, normal, -force, planes.tolist())


def _with_names(table: Table, named: bool) -> Table:
    """The table of contacts with CONTACT_COLUMNS as header, matched by name or else by order.

    By name, the distance may be missing, as it is only a check, and px and py both, if fx and fy
    are the total force.
    """
    is_total = not {"px", "py"} & set(table.header)
    optional = ("distance", "px", "py") if is_total else ("distance",)
    needed = [column for column in CONTACT_COLUMNS if column not in optional]
    if named or set(needed) <= set(table.header):
        table.require(*needed)
        return table
    columns = [column for column in table.header if column != "index"]
    if len(columns) != len(CONTACT_COLUMNS):
        raise InputError(
            f"{table.name}: {len(columns)} columns ({some_of(columns)}); name the seven "
            f"that hold {', '.join(CONTACT_COLUMNS)}, as in --columns atom1={columns[0]},… "
            "(columns=)"
        )
    ours = dict(zip(columns, CONTACT_COLUMNS, strict=True))
    return table._replace(header=tuple(ours.get(column, column) for column in table.header))


def _check_distances(
    length: Floats, distance: Floats, largest: float, place: Callable[[int], str]
) -> None:
    for c in np.flatnonzero(np.abs(length - distance) > MISFIT * largest)[:1]:
        raise InputError(
            f"{place(c)}: centre distance {distance[c]:.6g}, but {length[c]:.6g} by the positions; "
            "are both dumps of the same step and box, and the columns in order?"
        )


def _check_along(normal_force: Floats, forces: Floats, place: Callable[[int], str]) -> None:
    """InputError if a normal force has a tangential component; all (N_c, 2) are components."""
    for c in np.flatnonzero(np.abs(normal_force[:, 1]) > SKEW * np.hypot(*forces.T).mean())[:1]:
        raise InputError(
            f"{place(c)}: the normal force does not point along the line of centres; "
            "name the columns, as in --columns fx=…,fy=… (columns=)"
        )
