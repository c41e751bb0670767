"""Changes of parameters: observed by name, and announced together."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import reduce
from typing import Any

import param


def observe(act: Callable[..., object], root: Any, *names: str) -> None:
    """Call act(*events) after changes of these parameters of root, or of its parts: "looks.tab"."""
    by_owner: dict[tuple[str, ...], list[str]] = {}
    for name in names:
        *path, last = name.split(".")
        by_owner.setdefault(tuple(path), []).append(last)
    for path, parameters in by_owner.items():
        reduce(getattr, path, root).param.watch(act, parameters)


@contextmanager
def as_one(*parts: param.Parameterized) -> Iterator[None]:
    """Announce changes of these parts together, when all are set; the last part announces first."""
    with ExitStack() as stack:
        for part in parts:
            stack.enter_context(param.parameterized.batch_call_watchers(part))
        yield
