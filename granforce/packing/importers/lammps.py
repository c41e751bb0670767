"""Packings from LAMMPS: ``dump custom`` of the particles, ``dump local`` of the contacts."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from granforce.packing.importers.geometry import MISFIT, check_disks, components, listed
from granforce.packing.importers.network import adopt
from granforce.packing.importers.text import (
    Source,
    Table,
    check_grains,
    make_table,
    read_text,
    some_of,
)
from granforce.records import (
    Cell,
    Contacts,
    Floats,
    InputError,
    Packing,
    friction,
    make_cell,
    make_packing,
)

# Columns of the contact dump: grains, centre distance, normal and tangential force on atom1.
CONTACT_COLUMNS = ("atom1", "atom2", "distance", "fx", "fy", "px", "py")

# The normal force may point this far beside the line of centres, in the mean force of a contact:
# more, and its columns are not what they are taken for.
SKEW = 1e-2

_TITLES = ("TIMESTEP", "NUMBER OF", "BOX BOUNDS", "ATOMS", "ENTRIES", "UNITS", "TIME")


class _Item(NamedTuple):
    line: int  # line number of its title
    words: list[str]  # what follows the title on its line
    body: list[list[str]]  # the lines below, as lists of words


def read_lammps(
    particles: Source,
    contacts: Source,
    mu: Any,
    *,
    columns: Sequence[str] | None = None,
    most_grains: int | None = None,
) -> Packing:
    """A Packing from a particle dump and a contact dump (paths or open files), in LAMMPS' units.

    particles: ``dump custom`` with id, x y (or xu yu) and radius (or diameter), in any order.
    contacts: ``dump local`` with the two grains, their distance, normal and tangential force on
    the first: columns named atom1 atom2 distance fx fy px py, or seven in this order, or those
    that ``columns`` names in this order. Pairs without force are neighbours, not contacts.

    The last timestep in both files is read; grains are sorted by id. The box may be tilted in the
    plane (xy). Directions that are not periodic are open, what grains lack to balance is their load
    there. packing.info holds timestep, residual and violation (in ⟨f_n⟩), rattlers and
    contacts_skipped. most_grains: how many are taken.

    Raises InputError naming file and line.
    """
    mu = friction(mu)
    first, second = snapshots(particles), snapshots(contacts)
    steps = [step for step in first[1] if step in second[1]]
    if not steps:
        raise InputError(
            f"{first[0]} and {second[0]} have no timestep in common; dump both at the same step"
        )
    step = steps[-1]
    atoms = _table(first[0], first[1][step], "ATOMS")
    check_grains(len(atoms.rows), most_grains, first[0])
    pairs = _table(second[0], second[1][step], "ENTRIES")
    low, cell = cell_of(first[0], first[1][step])
    x, r, index = _disks(atoms, low, cell)
    joined, forces, skipped = _contacts(pairs, columns, x, r, cell, index)
    info = {"source": "lammps"}
    packing = make_packing(x, r, cell.box, joined, forces, mu, info=info, tilt=cell.tilt)
    return adopt(packing, timestep=step, contacts_skipped=skipped)


def snapshots(source: Source) -> tuple[str, dict[int, dict[str, _Item]]]:
    """Name of the file and its snapshots: {timestep: {title: _Item}}, in the file's order."""
    name, text = read_text(source)
    snapshots: dict[int, dict[str, _Item]] = {}
    items: dict[str, _Item] = {}
    item = None
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if line.startswith("ITEM:"):
            title, rest = _title(line[5:].strip())
            if title == "TIMESTEP":
                items = {}
            item = items[title] = _Item(number, rest, [])
        elif item is None:
            raise InputError(f"{name}, line {number}: no 'ITEM: TIMESTEP'; is it a LAMMPS dump?")
        elif words:
            item.body.append(words)
            if item is items.get("TIMESTEP"):
                step = _whole(words[0], name, number)
                snapshots.pop(step, None)
                snapshots[step] = items
    return name, snapshots


def _title(heading: str) -> tuple[str, list[str]]:
    for title in _TITLES:
        if heading == title or heading.startswith(title + " "):
            return title, heading[len(title) :].split()
    return heading, []


def _whole(word: str, name: str, line: int) -> int:
    if not word.isdecimal() or len(word) > 18:
        raise InputError(f"{name}, line {line}: {word[:40]!r} is not a whole number")
    return int(word)


def _item(name: str, items: dict[str, _Item], title: str) -> _Item:
    if title not in items:
        raise InputError(f"{name}: no 'ITEM: {title}' in the timestep; is the right file given?")
    return items[title]


def _table(name: str, items: dict[str, _Item], title: str) -> Table:
    item, number = _item(name, items, title), _item(name, items, "NUMBER OF")
    count = _whole(number.body[0][0] if number.body else "", name, number.line + 1)
    if count != len(item.body):
        raise InputError(
            f"{name}, line {item.line}: {len(item.body)} rows where {count} are announced; "
            "is the file cut off?"
        )
    if count == 0:
        raise InputError(f"{name}, line {item.line}: the table is empty")
    lines = list(range(item.line + 1, item.line + 1 + count))
    return make_table(name, item.words, item.body, lines)


def cell_of(name: str, items: dict[str, _Item]) -> tuple[Floats, Cell]:
    """Origin (2,) and Cell of the box, open along directions that are not periodic.

    Bounds of a tilted box (title ``xy xz yz``, tilts in a third column) are those of the rectangle
    around it: x_lo + min(0, xy), x_hi + max(0, xy) (docs.lammps.org, Howto triclinic).
    """
    item = _item(name, items, "BOX BOUNDS")
    place, flags = f"{name}, line {item.line}", item.words
    tilted = flags[:3] == ["xy", "xz", "yz"]
    flags = flags[3:] if tilted else flags
    if len(flags) > 3 or any(len(flag) != 2 or not set(flag) <= set("pfsm") for flag in flags):
        raise InputError(
            f"{place}: a box of kind {' '.join(item.words)!r}, which is not read; dump it with its "
            "first side along x (without triclinic/general)"
        )
    # The height of the layer does not matter, its tilts do.
    columns = ["lo", "hi", "tilt"] if tilted else ["lo", "hi"]
    rows = [row[: len(columns)] for row in item.body[: len(columns)]]
    if len(rows) < len(columns):
        raise InputError(f"{place}: the box bounds are incomplete")
    bounds = make_table(name, columns, rows, [item.line + 1 + k for k in range(len(rows))])
    low, high = bounds.numbers("lo")[:2], bounds.numbers("hi")[:2]
    tilt = bounds.numbers("tilt") if tilted else np.zeros(1)
    for k in np.flatnonzero(tilt[1:])[:1] + 1:
        raise InputError(f"{bounds.place(k)}: tilted out of the plane; only xy may differ from 0")
    low[0] -= min(0.0, tilt[0])
    high[0] -= max(0.0, tilt[0])
    for k in np.flatnonzero(high <= low)[:1]:
        raise InputError(f"{bounds.place(k)}: the upper bound of the box is not above the lower")
    # Dumps of old versions have no flags, and were periodic by default.
    is_open = np.array([flag != "pp" for flag in [*flags, "pp", "pp"][:2]])
    try:
        return low, make_cell(np.where(is_open, np.inf, high - low), tilt[0])
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def _disks(table: Table, low: Floats, cell: Cell) -> tuple[Floats, Floats, dict[int | str, int]]:
    ids = table.numbers("id")
    order = np.argsort(ids, kind="stable")
    rank = np.argsort(order)
    index = {label: int(rank[row]) for label, row in table.index("id").items()}
    axes = ("xu", "yu") if "x" not in table.header and "xu" in table.header else ("x", "y")
    x = np.column_stack([table.numbers(axis) for axis in axes]) - low
    if "radius" not in table.header and "diameter" in table.header:
        r = table.numbers("diameter") / 2
    else:
        r = table.numbers("radius")
    x, r = cell.wrapped(x[order]), r[order]
    check_disks(x, r, cell, lambda g: table.place(order[g]))
    return x, r, index


def _contacts(
    table: Table,
    columns: Sequence[str] | None,
    x: Floats,
    r: Floats,
    cell: Cell,
    index: Mapping[Any, int],
) -> tuple[Contacts, Floats, int]:
    """Contacts that carry force, their forces (N_c, 2), and how many pairs carry none."""
    names = _force_columns(table, columns)
    i, j = (table.lookup(names[k], index) for k in ("atom1", "atom2"))
    distance = table.numbers(names["distance"])
    normal_force, tangential_force = (
        np.column_stack([table.numbers(names[k]) for k in pair])
        for pair in (("fx", "fy"), ("px", "py"))
    )
    active = np.flatnonzero(normal_force.any(axis=1) | tangential_force.any(axis=1))
    if not len(active):
        raise InputError(f"{table.name}: no contact carries force; is the packing compressed?")

    def place(c: int) -> str:
        return table.place(active[c])

    joined = listed(x, r, cell, i[active], j[active], place)
    _check_distances(joined.length, distance[active], r.max(), place)
    # Forces are on atom1 = i; ours are on j.
    forces = _components(joined.normal, -normal_force[active], -tangential_force[active], place)
    return joined, forces, len(i) - len(active)


def _force_columns(table: Table, columns: Sequence[str] | None) -> dict[str, str]:
    if columns is None:
        columns = CONTACT_COLUMNS if set(CONTACT_COLUMNS) <= set(table.header) else table.header
    if len(columns) != len(CONTACT_COLUMNS):
        raise InputError(
            f"{table.name}: {len(columns)} columns ({some_of(columns)}); name, by columns=, "
            f"the seven that hold {', '.join(CONTACT_COLUMNS)}"
        )
    table.require(*columns)
    return dict(zip(CONTACT_COLUMNS, columns, strict=True))


def _check_distances(
    length: Floats, distance: Floats, largest: float, place: Callable[[int], str]
) -> None:
    for c in np.flatnonzero(np.abs(length - distance) > MISFIT * largest)[:1]:
        raise InputError(
            f"{place(c)}: centre distance {distance[c]:.6g}, but {length[c]:.6g} by the positions; "
            "are both dumps of the same step and box, and the columns in order?"
        )


def _components(
    n: Floats, normal_force: Floats, tangential_force: Floats, place: Callable[[int], str]
) -> Floats:
    total = normal_force + tangential_force
    skew = np.abs(components(normal_force, n)[:, 1])
    for c in np.flatnonzero(skew > SKEW * np.hypot(*total.T).mean())[:1]:
        raise InputError(
            f"{place(c)}: the normal force does not point along the line of centres; "
            "name the columns by columns="
        )
    return components(total, n)
