"""Values in JSON (RFC 8259), which has neither NaN nor infinities, and in words."""

import json
import math
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


def counted(count: int, one: str, several: str) -> str:
    """A number with the words for one or for several: 1 pair, 2 pairs."""
    return f"{count} {one if count == 1 else several}"


def spaced(name: str) -> str:
    """A name in words; symbols such as f_n keep their form."""
    return name.replace("_", " ").replace("f n", "f_n").replace("f t", "f_t")
