"""The name of a result in a store: its kind, its parameters in canonical form, and their hash."""

import hashlib
import json
import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from granforce.study.relaxations import as_stored, from_stored
from granforce.tolerances import MU_DIGITS

Parameters = dict[str, Any]  # plain values by name, from which a key is made

# Raised when the meaning of a stored array changes; entries of another schema are ignored.
SCHEMA_VERSION = 1

KEY_DIGITS = 20  # 80 bits: no collision among as many entries as fit on a disk
ENTRY = re.compile(rf"[a-z][a-z0-9_]*-[0-9a-f]{{{KEY_DIGITS}}}")


def canonical(value: Any) -> str:
    """Canonical JSON of parameters: equal values give equal text.

    Floats are rounded to 15 significant digits and 1.0 equals 1; numpy scalars, tuples and nested
    dicts are accepted. Raises TypeError for anything else, including non-finite numbers.
    """
    return json.dumps(_plain(value, "parameters"), sort_keys=True, separators=(",", ":"))


def _plain(value: Any, where: str) -> Any:
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return _quantised(value, where)
    if isinstance(value, (list, tuple)):
        return [_plain(item, f"{where}[{k}]") for k, item in enumerate(value)]
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return {key: _plain(item, f"{where}[{key!r}]") for key, item in value.items()}
    raise TypeError(
        f"{where} cannot be part of a key: {type(value).__name__} {value!r:.60} (use numbers, "
        "strings, None, lists, or dicts with string keys)"
    )


def _quantised(value: float | np.floating[Any], where: str) -> int | float:
    # By its shortest text: a float32 0.1 means 0.1, not 0.100000001.
    number = float(str(value)) if isinstance(value, np.floating) else float(value)
    if not math.isfinite(number):
        raise TypeError(f"{where} cannot be part of a key: {value} is not finite")
    number = float(f"{number:.{MU_DIGITS}g}")
    return int(number) if number.is_integer() and abs(number) < 2**53 else number


def described(params: Mapping[str, Any]) -> str:
    """The text of parameters in the attributes of an entry; TypeError as for `canonical`."""
    return canonical(as_stored(params))


def parameters(text: str) -> Parameters:
    """The parameters in such a text."""
    return from_stored(json.loads(text))


def entry_name(kind: str, params: Mapping[str, Any], version: int | str, schema: int) -> str:
    """Name of an entry: <kind>-<20 hexadecimal digits>; TypeError as for `canonical`."""
    named = {"kind": kind, "params": as_stored(params), "version": version, "schema": schema}
    content = canonical(named)
    name = f"{kind}-{hashlib.sha256(content.encode()).hexdigest()[:KEY_DIGITS]}"
    if not ENTRY.fullmatch(name):
        raise ValueError(f"kind must be a lower-case word, got {kind!r}")
    return name
