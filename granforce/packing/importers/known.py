"""Known forces from a table: bounds on the forces of single contacts."""

from __future__ import annotations

import numpy as np

from granforce.forces.knowledge import Known
from granforce.packing.importers.text import Source, Table, make_table, read_csv
from granforce.records import InputError
from granforce.tolerances import REVERSED
from granforce.types import Floats

_COMPONENTS = "f_n", "f_t"
_COLUMNS = [f"{name}{side}" for name in _COMPONENTS for side in ("", "_low", "_high")]
_EARLIER = {
    f"{name}_{old}": f"{name}_{new}"
    for name in _COMPONENTS
    for old, new in (("min", "low"), ("max", "high"))
}


def read_known(source: Source) -> Known:
    """A Known from CSV with a column `contact` (numbers in the packing).

    Parameters
    ----------
    source : path or open file
        Any of the columns f_n, f_t: exact values; f_n_low, f_n_high, f_t_low, f_t_high: bounds, as
        written by `granforce intervals --out` (earlier versions: f_n_min, f_n_max, f_t_min,
        f_t_max). Forces are in the packing's unit, which names may end with: ``f_n [packing]``.
        Columns `i` and `j`, if there are any, are the grains of each contact, checked where the
        Known is used. Empty fields, nan, infinite bounds and other columns are ignored.

    Returns
    -------
    Known
        For `ensemble`.

    Raises
    ------
    InputError
        Naming the offending line, also for an exact value outside its bounds, and for a column in
        another unit.
    """
    table = _renamed(read_csv(source).in_packing_unit([*_COLUMNS, *_EARLIER]))
    contacts = table.whole("contact")
    low, high = np.full((2, len(contacts), 2), np.inf)
    low *= -1
    if not set(_COLUMNS) & set(table.header):
        raise InputError(f"{table.name}: none of the columns {', '.join(_COLUMNS)}")
    for k, name in enumerate(_COMPONENTS):
        for column, side, unknown in ((f"{name}_low", low, "-inf"), (f"{name}_high", high, "inf")):
            given, values = _numbers(table, column, unknown)
            side[given, k] = values
        for row, value in zip(*_numbers(table, name), strict=True):
            bounds = low[row, k], high[row, k]
            largest = max(abs(number) for number in (value, *bounds) if np.isfinite(number))
            if not bounds[0] - REVERSED * largest <= value <= bounds[1] + REVERSED * largest:
                raise InputError(
                    f"{table.place(row)}: {name} is {value:.9g}, outside its bounds "
                    f"{bounds[0]:.9g} … {bounds[1]:.9g}; correct or remove one of them"
                )
            low[row, k] = high[row, k] = value
    ends = [table.whole(name) for name in "ij"] if {"i", "j"} <= set(table.header) else []
    return Known(contacts, low, high, np.column_stack(ends) if ends else None)


def _renamed(table: Table) -> Table:
    """The table with earlier names of bounds replaced; InputError if both names are present."""
    header = [_EARLIER.get(name, name) for name in table.header]
    return make_table(table.name, header, table.rows, table.lines)


def _numbers(table: Table, column: str, unknown: str = "") -> tuple[list[int], Floats]:
    """Rows with an entry in a column, and their numbers; without the column none."""
    if column not in table.header:
        return [], np.empty(0)
    fields = enumerate(table.fields(column))
    given = [row for row, text in fields if text.lower() not in ("", "nan", unknown)]
    return given, table.some(given).numbers(column)
