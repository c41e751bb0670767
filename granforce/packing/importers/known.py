"""Known forces from a table: bounds on the forces of single contacts."""

from __future__ import annotations

import numpy as np

from granforce.forces.knowledge import Known
from granforce.packing.importers.text import MISSING, Source, Table, read_csv
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
    return known_in(read_csv(source))


def known_in(table: Table) -> Known:
    """The Known in a table with the columns of `read_known`."""
    table = table.in_packing_unit([*_COLUMNS, *_EARLIER])
    table = table.named([_EARLIER.get(name, name) for name in table.header])
    contacts = table.whole("contact")
    if not set(_COLUMNS) & set(table.header):
        raise InputError(f"{table.name}: none of the columns {', '.join(_COLUMNS)}")
    low, high = (
        np.column_stack([_bounds(table, f"{name}_{side}", unknown) for name in _COMPONENTS])
        for side, unknown in (("low", -np.inf), ("high", np.inf))
    )
    for k, name in enumerate(_COMPONENTS):
        exact = _numbers(table, name)
        _check_inside(table, name, exact, low[:, k], high[:, k])
        given = np.isfinite(exact)
        low[given, k] = high[given, k] = exact[given]
    ends = [table.whole(name) for name in "ij"] if {"i", "j"} <= set(table.header) else []
    return Known(contacts, low, high, np.column_stack(ends) if ends else None)


def _bounds(table: Table, column: str, unknown: float) -> Floats:
    """Bounds (rows,), `unknown` where there is none."""
    values = _numbers(table, column, str(unknown))
    return np.where(np.isnan(values), unknown, values)


def _numbers(table: Table, column: str, *missing: str) -> Floats:
    """A column (rows,), NaN for missing values and without the column."""
    if column not in table.header:
        return np.full(len(table.rows), np.nan)
    return table.numbers(column, (*MISSING, *missing))


def _check_inside(table: Table, name: str, exact: Floats, low: Floats, high: Floats) -> None:
    """InputError naming a row whose exact value is outside its bounds."""
    for row in np.flatnonzero(np.isfinite(exact)).tolist():
        value, bounds = exact[row], (low[row], high[row])
        largest = max(abs(number) for number in (value, *bounds) if np.isfinite(number))
        if not bounds[0] - REVERSED * largest <= value <= bounds[1] + REVERSED * largest:
            raise InputError(
                f"{table.place(row)}: {name} is {value:.9g}, outside its bounds "
                f"{bounds[0]:.9g} … {bounds[1]:.9g}; correct or remove one of them"
            )
