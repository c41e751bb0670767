"""Packings from tables of grains and contacts (CSV)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from granforce.cell import Cell
from granforce.packing.importers.disks import clumped, enclosed
from granforce.packing.importers.geometry import (
    check_disks,
    components,
    listed_contacts,
    touching_contacts,
    with_doubts_noted,
)
from granforce.packing.importers.network import (
    refuse_idle_reverse,
    with_edge,
    with_given_forces,
    with_nearest_network,
)
from granforce.packing.importers.notes import packing_noted
from granforce.packing.importers.text import (
    Source,
    Table,
    check_grains,
    of_frame,
    read_csv,
    renamed,
)
from granforce.records import (
    Contacts,
    InputError,
    Packing,
    friction,
    make_cell,
    make_packing,
    positive,
)
from granforce.tolerances import LISTED_TOUCHING
from granforce.types import Floats

# Columns of grains.
NAMES = ("id", "x", "y", "r", "fx", "fy", "torque", "open", "body")
_LOADS = {"fx", "fy", "torque", "open"}
NAMES += ("i", "j", "nx", "ny", "length", "f_n", "f_t")
_SHORT = {"fn": "f_n", "ft": "f_t"}  # names that many tables have
_TOTAL = ("fx", "fy")  # the force on j, instead of its components f_n, f_t


@packing_noted
def read_table(
    grains: Source | Any,
    contacts: Source | Any | None = None,
    *,
    mu: Any,
    box: npt.ArrayLike | None = None,
    tilt: float = 0.0,
    columns: Mapping[str, str] | None = None,
    forces: bool | None = None,
    reverse: bool = False,
    pressure: float | None = None,
    walls: str | npt.ArrayLike | None = None,
    gravity: float = 0.0,
    tolerance: float | None = None,
    most_grains: int | None = None,
) -> Packing:
    """A Packing from a table of grains and, optionally, a table of contacts.

    Parameters
    ----------
    grains : path, open file or DataFrame
        CSV with columns x, y, r; optionally id; fx, fy, torque (external load in an open set);
        open, 1 if the balance of a grain is not required and 0 otherwise; and body, the label of
        a rigid body that disks are joined to, as for `from_disks`.
    contacts : path, open file or DataFrame, optional
        Columns i, j (ids, or row numbers from 0 without an id column); optionally nx, ny, length
        (otherwise nearest images are joined) and f_n, f_t (or fn, ft), or the total force on j as
        fx, fy. Without contacts, grains closer than the tolerance touch.
    mu : float
        Friction coefficient.
    box : (2,) array, optional
        L_x, L_y, inf for an open direction; by default the set is open.
    tilt : float, default 0
        Of the cell, whose upper side begins at (tilt, L_y).
    columns : mapping, optional
        {name here: name in the files} for columns with other names.
    forces : bool, optional
        Whether to read f_n, f_t, by default if present; they then determine the pressure (in an
        open set: the loads). Without forces, the network nearest to equal normal forces at the
        pressure (in an open set: under the loads) is computed.
    reverse : bool, default False
        Change the sign of f_t.
    pressure : float, optional
        P0, force per length; by default 1.
    walls : str or (k, 4) array, optional
        "floor", "box" or segments, as for `from_disks`; only without forces.
    gravity : float, default 0
        As for `from_disks`; only without forces.
    tolerance : float, optional
        In largest radii, by default 10⁻⁶.
    most_grains : int, optional
        Largest number of grains.

    Returns
    -------
    Packing
        InputWarnings, whose texts are also in info["notes"], report forces that do not balance,
        overlaps, and pairs in doubt, which info["nearly_touching"] lists [i, j, gap]: gaps within a
        factor of 100 of the tolerance and below 0.1, and far above those of other contacts.

    Raises
    ------
    InputError
        Naming file and line.
    NotJammedError
        If no network exists.
    """
    mu, cell = friction(mu), make_cell((np.inf, np.inf) if box is None else box, tilt)
    if tolerance is None:
        tolerance = LISTED_TOUCHING
    elif contacts is not None and walls is None:
        raise InputError("tolerance has no effect with a table of contacts: leave it out")
    prescribed = pressure is not None
    pressure = positive(1.0 if pressure is None else pressure, "pressure")
    table, pairs = _tables(grains, contacts, columns)
    check_grains(len(table.rows), most_grains, table.name)
    if "body" in table.header:
        if pairs is not None or forces or reverse or prescribed or _LOADS & set(table.header):
            raise InputError(
                "a column body joins disks that touch to rigid bodies under gravity: leave out "
                "contacts, forces, loads, open and the pressure"
            )
        x, y, r = (table.numbers(name) for name in "xyr")
        labels, given = np.array(table.fields("body")), (walls, gravity, tolerance)
        return clumped(np.column_stack([x, y]), r, mu, cell, labels, *given, table.place)
    x, r = _disks(table, cell)
    load = _loads(table, cell)
    if pairs is not None:
        touching, given = _contacts_and_forces(pairs, table, x, r, cell, forces, mu)
    elif forces:
        raise InputError("forces need a table of contacts with columns i, j, f_n, f_t")
    else:
        touching, given = touching_contacts(x, r, cell, tolerance), None
    closed = bool(np.all(np.isfinite(cell.box)))
    if prescribed and not (closed and given is None):
        raise InputError(
            "pressure applies to periodic boxes without forces (f_n, f_t): leave it out"
        )
    packing = make_packing(
        x,
        r,
        cell.box,
        touching,
        np.zeros((len(touching.i), 2)) if given is None else given,
        mu,
        pressure if closed else np.nan,
        load,
        {"source": "table"},
        cell.tilt,
    )
    packing = with_doubts_noted(packing, tolerance if pairs is None else None)
    if given is not None:
        if walls is not None or gravity:
            raise InputError(
                "walls and gravity (--walls and --gravity, or walls=, gravity=) apply to tables "
                "without forces: leave out f_n and f_t"
            )
        return _with_forces(packing, reverse)
    packing = enclosed(packing, walls, gravity, tolerance)
    if reverse:
        raise InputError(
            "--reverse (reverse=True) applies to tables with forces (f_n, f_t): leave it out"
        )
    return with_nearest_network(packing, forces="found")


def _with_forces(packing: Packing, reverse: bool) -> Packing:
    """The packing with its forces as given, and the pressure or the loads that balance them."""
    refuse_idle_reverse(packing.forces, reverse)
    found = with_given_forces(packing, reverse=reverse, forces="given")
    if np.isfinite(packing.volume) or packing.load.any():
        return found
    return with_edge(
        found,
        "; for walls and weights instead, leave out the forces and give walls and gravity "
        "(--walls and --gravity, or walls=, gravity=)",
    )


def _tables(
    grains: Source | Any, contacts: Source | Any | None, columns: Mapping[str, str] | None
) -> tuple[Table, Table | None]:
    """The tables of grains and of contacts, if any, with the columns that they need."""
    sources = {"grains": grains} | ({} if contacts is None else {"contacts": contacts})
    files = [
        of_frame(source, name) if hasattr(source, "columns") else read_csv(source)
        for name, source in sources.items()
    ]
    table, *pairs = renamed(_full({} if columns is None else columns), NAMES, *files)
    pairs = [_with_full_names(one) for one in pairs]
    _check_columns(table, "x", "y", "r")
    for one in pairs:
        _check_columns(one, "i", "j")
    return table, pairs[0] if pairs else None


def _full(columns: Mapping[str, str]) -> Mapping[str, str]:
    """The given columns with the names f_n and f_t for fn and ft."""
    if not isinstance(columns, Mapping) or not _SHORT.keys() & columns.keys():
        return columns
    return {_SHORT.get(name, name): theirs for name, theirs in columns.items()}


def _with_full_names(table: Table) -> Table:
    """The table with forces called f_n and f_t, without their unit."""
    named = table.named([_SHORT.get(name, name) for name in table.header])
    return named.in_packing_unit((*_SHORT.values(), *_TOTAL))


def _disks(table: Table, cell: Cell) -> tuple[Floats, Floats]:
    r = table.numbers("r")
    x = cell.wrapped(np.column_stack([table.numbers("x"), table.numbers("y")]))
    check_disks(x, r, cell, table.place)
    return x, r


def _loads(table: Table, cell: Cell) -> Floats:
    load = np.zeros((len(table.rows), 3))
    for k, column in enumerate(("fx", "fy", "torque")):
        if column in table.header:
            load[:, k] = table.numbers(column)
    loaded = np.flatnonzero(load.any(axis=1))
    if "open" in table.header:
        left_open = table.whole("open")
        for row in np.flatnonzero(left_open > 1)[:1]:
            raise InputError(f"{table.place(row)}: open must be 0 or 1")
        load[left_open == 1] = np.nan
    if len(loaded) and np.all(np.isfinite(cell.box)):
        raise InputError(
            f"{table.place(loaded[0])}: a load in a periodic box; "
            "remove fx, fy, torque, or leave out the box"
        )
    return load


def _contacts_and_forces(
    table: Table, grains: Table, x: Floats, r: Floats, cell: Cell, forces: bool | None, mu: float
) -> tuple[Contacts, Floats | None]:
    """Contacts of a table and their forces (N_c, 2), or None without forces."""
    joined = _contacts(table, grains, x, r, cell)
    header = set(table.header)
    is_total = not header & {"f_n", "f_t"} and bool(header & set(_TOTAL))
    if forces is None:
        forces = is_total or bool(header & {"f_n", "f_t"})
    if not forces:
        return joined, None
    if is_total:
        total = np.column_stack([table.numbers(column) for column in _TOTAL])
        return joined, components(total, joined.normal)
    normal = table.numbers("f_n")
    without_friction = mu == 0 and "f_t" not in table.header
    tangential = np.zeros(len(normal)) if without_friction else table.numbers("f_t")
    return joined, np.column_stack([normal, tangential])


def _contacts(table: Table, grains: Table, x: Floats, r: Floats, cell: Cell) -> Contacts:
    """The contacts of a table; the InputError for those that count grains from 1 says so."""

    def counted(index: Mapping[Any, int]) -> Contacts:
        i, j = table.lookup("i", index), table.lookup("j", index)
        return listed_contacts(x, r, cell, i, j, table.place, _given_branches(table))

    if "id" in grains.header:
        return counted(grains.index("id"))
    rows = range(len(grains.rows))
    try:
        return counted({row: row for row in rows})
    except InputError as error:
        try:
            counted({row + 1: row for row in rows})
        except InputError:
            raise error from None
        raise InputError(
            f"{error}; i and j seem to count the rows of {grains.name} from 1: without ids they "
            f"count from 0, so give it a column id with 1 … {len(rows)}"
        ) from None


def _given_branches(table: Table) -> Floats | None:
    """Branch vectors (N_c, 2) from columns nx, ny, length, or None if they are missing."""
    if not {"nx", "ny", "length"} & set(table.header):
        return None
    normal = np.column_stack([table.numbers("nx"), table.numbers("ny")])
    length = table.numbers("length")
    norm = np.hypot(*normal.T)
    for c in np.flatnonzero((np.abs(norm - 1) > 1e-3) | (length <= 0))[:1]:
        raise InputError(
            f"{table.place(c)}: the normal must have length 1 and the centre distance be > 0, "
            f"got {norm[c]:.4g} and {length[c]:.4g}"
        )
    return normal * (length / norm)[:, None]


def _check_columns(table: Table, *names: str) -> None:
    """InputError with what to do unless a table has all these columns."""
    try:
        table.require(*names)
    except InputError as error:
        missing = next(name for name in names if name not in table.header)
        raise InputError(
            f"{error}; if it has another name, give --columns {missing}=NAME (columns= in Python)"
        ) from None
