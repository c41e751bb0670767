"""Notes of importers on input that can be used, but is probably wrong, as warnings."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Mapping
from typing import Any, ParamSpec, TypeVar

from granforce.records import InputWarning

P = ParamSpec("P")
T = TypeVar("T")


def noted(info: Callable[[Any], Mapping[str, Any]]) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """A decorator: each text in info(result)["notes"] is also an InputWarning at the call."""

    def wrapped(reader: Callable[P, T]) -> Callable[P, T]:
        @functools.wraps(reader)
        def read(*arguments: P.args, **options: P.kwargs) -> T:
            found = reader(*arguments, **options)
            for note in info(found).get("notes", []):
                warnings.warn(note, InputWarning, stacklevel=2)
            return found

        return read

    return wrapped


packing_noted = noted(lambda packing: packing.info)
