"""The declared fields of records, and how records describe themselves with them."""

import importlib
import typing
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import numpy as np

from granforce.quantities import Field

C = TypeVar("C", bound=type)
F = TypeVar("F", bound=Callable[..., Any])


def record(kind: C) -> C:
    """A decorator of records (named tuples and dataclasses): a short repr, and help on all fields.

    Named tuples are equal if all their fields are, arrays by their elements; also to plain tuples.

    Fields are Annotated with a Field or, if neither labelled nor stored, with a text alone.
    """
    kind.__repr__ = _short  # type: ignore[assignment, method-assign]
    if hasattr(kind, "_fields"):
        kind.__eq__, kind.__ne__ = _same, _differ  # type: ignore[assignment, method-assign]
    declared = fields(kind)
    texts = {name: declared[name].text for name in _names(kind) if name in declared}
    if hasattr(kind, "_fields"):
        for name, text in texts.items():
            getattr(kind, name).__doc__ = text
    make = kind.__new__ if hasattr(kind, "_fields") else kind.__init__  # type: ignore[misc]
    make.__annotations__ = {}  # the signature in `help` has names only
    lines = (f"    {name}: {text}" for name, text in texts.items())
    kind.__doc__ = "\n".join([(kind.__doc__ or "").rstrip(), "", *lines])
    if any(label_of(name, field) for name, field in declared.items()):
        methods = {name: _method(name) for name in ("to_dataset", "to_dataframe")}
        if declared.keys() & {"states", "forces", "high"}:
            methods["plot"] = _method("plot") if kind.__name__ == "Packing" else _plot
        for name, method in methods.items():
            setattr(kind, name, method)
    return kind


def label_of(name: str, field: Field) -> str:
    """The name of a field in datasets and tables, by default of arrays only; empty: not there."""
    return field.label if field.label is not None else name if field.dims else ""


def _method(name: str) -> Callable[..., Any]:
    """The public function of this name as a method; it stands above all records."""

    def method(record: Any, *arguments: Any, **options: Any) -> Any:
        return getattr(importlib.import_module("granforce"), name)(record, *arguments, **options)

    method.__name__, method.__doc__ = name, f"`gf.{name}` of this record."
    return method


def _plot(record: Any, ensemble: Any, **options: Any) -> Any:
    """`gf.plot` of this record in the packing of its ensemble S."""
    return ensemble.packing.plot(record, contacts=ensemble.index, **options)


def derived(field: Field) -> Callable[[F], F]:
    """A decorator of a property's function: a field that is computed from others."""

    def declare(function: F) -> F:
        function.field = field  # type: ignore[attr-defined]
        function.__doc__ = function.__doc__ or f"{field.text}."
        return function

    return declare


def fields(kind: Any) -> dict[str, Field]:
    """The declared fields of a record, then its derived ones, by name."""
    hints = typing.get_type_hints(kind, None, {kind.__name__: kind}, include_extras=True)
    found = {name: _declared(getattr(hint, "__metadata__", ())) for name, hint in hints.items()}
    for base in reversed(kind.__mro__):
        for name, value in vars(base).items():
            function = value.fget if isinstance(value, property) else None
            found[name] = getattr(function, "field", found.get(name))
    return {name: field for name, field in found.items() if field is not None}


def _declared(metadata: Iterable[Any]) -> Field | None:
    """The Field, or text, of a type's metadata; None without."""
    for told in metadata:
        if isinstance(told, (Field, str)):
            return Field("", "", told, label="") if isinstance(told, str) else told
    return None


def _names(kind: Any) -> Iterable[str]:
    """The fields of a named tuple or a dataclass, in order."""
    return getattr(kind, "_fields", None) or kind.__dataclass_fields__


def _same(record: Any, other: Any) -> bool:
    alike = type(other) in (type(record), tuple) and len(record) == len(other)
    return alike and all(map(_equal, record, other))


def _differ(record: Any, other: Any) -> bool:
    return not _same(record, other)


def _equal(one: Any, other: Any) -> bool:
    """Whether two fields are equal; NaN equals NaN."""
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        one, other = np.asarray(one), np.asarray(other)
        numbers = one.dtype.kind in "fc" and other.dtype.kind in "fc"
        return np.array_equal(one, other, equal_nan=numbers)
    if isinstance(one, (list, tuple)) and not hasattr(one, "_fields"):
        same = type(one) is type(other) and len(one) == len(other)
        return same and all(map(_equal, one, other))
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_equal(one[key], other[key]) for key in one)
    return bool(one == other or (one != one and other != other))


def _short(record: Any) -> str:
    """A record in a line: arrays by their shape, records and tables by their type."""
    parts = []
    for name in _names(type(record)):
        value = getattr(record, name)
        if isinstance(value, np.ndarray):
            parts.append(f"{name}{list(value.shape)}")
        elif value is None or isinstance(value, (bool, str)):
            parts.append(
                f"{name}={str(value)[:40]!r}" if isinstance(value, str) else f"{name}={value}"
            )
        elif isinstance(value, (int, float, np.number)):
            parts.append(f"{name}={value:.6g}")
        else:
            parts.append(f"{name}: {type(value).__name__}")
    return f"{type(record).__name__}({', '.join(parts)})"
