"""Notes of importers on input that can be used, but is probably wrong, as warnings."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ParamSpec, TypeVar

from granforce.records import InputWarning, Packing

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


def with_notes(packing: Packing, notes: Sequence[str]) -> Packing:
    """The packing with more notes in its info."""
    if not notes:
        return packing
    return packing._replace(info=packing.info | {"notes": [*packing.info.get("notes", []), *notes]})


packing_noted = noted(lambda packing: packing.info)
