"""Files that visitors save, and tables in them."""

from typing import NamedTuple

import numpy as np
import pandas as pd

Columns = dict[str, np.ndarray]


class File(NamedTuple):
    """A file to hand over."""

    name: str
    mime: str
    content: bytes


def csv(columns: Columns, head: str = "") -> bytes:
    """Columns {name: array} as a table below the head."""
    table = pd.DataFrame(columns) + 0  # no −0
    return (head + table.to_csv(index=False, float_format="%.9g", na_rep="nan")).encode()
