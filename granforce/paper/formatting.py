"""Numbers with their errors, and tables, as text."""

import re
from collections.abc import Sequence

import numpy as np

from granforce.types import Floats

NOTHING = 1e-9  # η below this is rounding
_MOST_DIGITS = 6  # after the point; smaller values are written with a power of ten
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def short(value: float) -> str:
    """Three decimals, or two digits of smaller values."""
    if abs(value) < NOTHING:
        return "< 10⁻⁹"
    return f"{value:.3f}" if abs(value) >= 0.01 else f"{value:.2g}"


def between(
    value: float,
    low: float,
    high: float,
    ends: str = "({} to {})",
    digits: Sequence[int] = (2, 3, 4),
) -> str:
    """A number with its interval, to the first of some numbers of digits that shows both ends."""
    if not np.isfinite([low, high]).all():
        return f"{value:.{digits[0]}g}"
    if low == high:
        return f"{value:.{digits[0]}g} (no scatter)"
    numbers = value, low, high
    known = len({f"{number:.9g}" for number in numbers})
    for count in digits:
        texts = [_to_digits(number, count) for number in numbers]
        if len(set(texts)) == known:
            break
    return f"{texts[0]} {ends.format(*texts[1:])}"


def _to_digits(number: float, digits: int) -> str:
    """A number to this many digits, with zeros at its end; 0 as it is."""
    return f"{number:#.{digits}g}".rstrip(".") if number else "0"


def listed(words: Sequence[str]) -> str:
    """Words joined by commas, and the last one by "and"."""
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def with_error(values: Floats) -> str:
    """Mean ± standard error, to two digits of the error."""
    mean = float(values.mean())
    if len(values) < 2 or abs(mean) < NOTHING:
        return short(mean)
    error = float(values.std(ddof=1) / np.sqrt(len(values)))
    if error < NOTHING:
        return short(mean)
    digits = 1 - int(f"{error:.1e}".partition("e")[2])  # of the rounded error
    if digits <= _MOST_DIGITS:
        return f"{mean:.{max(0, digits)}f} ± {error:.{max(0, digits)}f}"
    power = int(np.floor(np.log10(abs(mean))))
    digits = max(0, power + digits)
    scaled = f"({mean / 10.0**power:.{digits}f} ± {error / 10.0**power:.{digits}f})"
    return f"{scaled}·10{str(power).translate(RAISED)}"


def typeset(text: str) -> str:
    """Text with true minus signs, and powers of ten instead of 1e-05."""
    text = _POWER.sub(_raised, text)
    return _MINUS.sub("−", text)


_POWER = re.compile(r"(?<![\w.])(\d(?:\.\d+)?)e([+-]\d+)")
_MINUS = re.compile(r"(?<![\w|])-(?=\d)")


def _raised(found: re.Match[str]) -> str:
    digits, power = found[1], f"10{str(int(found[2])).translate(RAISED)}"
    return power if digits == "1" else f"{digits}·{power}"


def markdown_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown with escaped cells."""
    rows = [[cell.replace("|", "\\|") for cell in row] for row in rows]
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
