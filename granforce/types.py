"""Type aliases: what arrays hold, tables, and the callbacks that long computations take.

Shapes are given in comments and docstrings.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.integer[Any]]
Mask = npt.NDArray[np.bool_]

Rows = Sequence[dict[str, Any]]  # a table: a line is plain values by name
Progress = Callable[[float, float | None], object]  # progress(done, total), as work goes on
Cancel = Callable[[], bool]  # polled; True ends the computation
