"""Files that visitors save, and tables in them."""

import io
from typing import NamedTuple

import numpy as np

Columns = dict[str, np.ndarray]


class File(NamedTuple):
    """A file to hand over."""

    name: str
    mime: str
    content: bytes


def csv(columns: Columns, head: str = "") -> bytes:
    """Columns {name: array} as a table below the head; whole numbers stay whole."""
    file = io.StringIO()
    file.write(head)
    whole = [np.issubdtype(values.dtype, np.integer) for values in columns.values()]
    np.savetxt(
        file,
        np.column_stack(list(columns.values())) + 0.0,  # no −0
        fmt=["%d" if w else "%.9g" for w in whole],
        delimiter=",",
        header=",".join(columns),
        comments="",
    )
    return file.getvalue().encode()
