"""Run times of function calls."""

import time
from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")


def timed(
    action: Callable[..., T],
    *arguments: Any,
    clock: Callable[[], float] = time.perf_counter,
    **options: Any,
) -> tuple[float, T]:
    """Seconds that action(…) takes, by a clock, and its return value."""
    begin = clock()
    result = action(*arguments, **options)
    return clock() - begin, result
