"""Values as text: in JSON (RFC 8259), which has neither NaN nor infinities, and in words; numbers
read from text.
"""

import json
import math
import re
from typing import Any


def json_text(value: Any, *, ascii_only: bool = True) -> str:
    """JSON text of plain values; numbers that are not finite become null."""
    return json.dumps(_finite(value), indent=1, ensure_ascii=ascii_only, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def number(text: str) -> float:
    """The number that a text is, as `float`; but ValueError for 1_5, which is not 15."""
    return float(_without_underscores(text))


def integer(text: str) -> int:
    """The integer that a text is, as `int`; ValueError for 1_5."""
    return int(_without_underscores(text))


def _without_underscores(text: str) -> str:
    if "_" in text:
        raise ValueError(f"could not convert string to a number: {text!r}")
    return text


def counted(count: int, one: str, several: str) -> str:
    """A number with the words for one or for several: 1 pair, 2 pairs."""
    return f"{count} {one if count == 1 else several}"


# Lines of reports whose names in JSON say too little to a reader.
_LABELS = {
    "again": "linear programs solved twice",
    "programs": "linear programs",
    "turns": "reflections",
    "held": "coordinates always zero",
    "refused": "paths discarded",
    "dropped": "warm-up states",
    "grains_left_open": "walls and fixed grains",
}


def spaced(name: str) -> str:
    """A name in words, as reports show it; symbols such as f_n keep their form."""
    words = _LABELS.get(name, name.replace("_", " "))
    return re.sub(r"\bf ([nt])\b", r"f_\1", words)
