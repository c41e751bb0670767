"""Type aliases: contents of arrays, tables, and the callbacks of long computations.

Shapes are given in comments and docstrings.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.integer[Any]]
Mask = npt.NDArray[np.bool_]

Rows = Sequence[dict[str, Any]]  # a table: a row is plain values by name
# progress(done, total), called repeatedly; functions for people also take True, which shows a bar.
Progress = Callable[[float, float | None], object]
Cancel = Callable[[], bool]  # polled; True ends the computation
