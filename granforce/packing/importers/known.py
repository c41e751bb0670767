"""Known forces from a table: bounds on the forces of single contacts."""

import numpy as np

from granforce.forces.knowledge import Known
from granforce.packing.importers.text import Source, Table, read_csv
from granforce.records import InputError
from granforce.types import Floats

_COMPONENTS = "f_n", "f_t"


def read_known(source: Source) -> Known:
    """A Known from CSV with a column `contact` (numbers in the packing) and any of these.

    f_n, f_t: known exactly; f_n_min, f_n_max, f_t_min, f_t_max: bounds, as `granforce intervals
    --csv` writes them. Forces in the packing's units; empty fields say nothing, and neither do
    other columns. source: a path or an open file. Raises InputError naming the line of what is
    wrong.
    """
    table = read_csv(source)
    contacts = table.whole("contact")
    low, high = np.full((2, len(contacts), 2), np.inf)
    low *= -1
    told = False
    for k, name in enumerate(_COMPONENTS):
        for column, sides in (
            (name, (low, high)),
            (f"{name}_min", (low,)),
            (f"{name}_max", (high,)),
        ):
            if column in table.header:
                told = True
                given, values = _numbers(table, column)
                for side in sides:
                    side[given, k] = values
    if not told:
        raise InputError(
            f"{table.name}: no column f_n, f_t, f_n_min, f_n_max, f_t_min or f_t_max: nothing "
            "would be known"
        )
    return Known(contacts, low, high)


def _numbers(table: Table, column: str) -> tuple[list[int], Floats]:
    """Rows with an entry in a column, and their numbers."""
    given = [row for row, text in enumerate(table.fields(column)) if text]
    return given, table.some(given).numbers(column)
