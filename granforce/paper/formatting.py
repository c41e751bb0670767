"""Numbers with their errors as text."""

from collections.abc import Sequence

import numpy as np

from granforce.system.markdown import RAISED
from granforce.types import Floats

NOTHING = 1e-9  # η below this is rounding
_MOST_DIGITS = 6  # after the point; smaller values are written with a power of ten


def short(value: float) -> str:
    """Three decimals, none of large values, or two digits of small ones."""
    if abs(value) < NOTHING:
        return "< 10⁻⁹"
    if abs(value) >= 1000:
        return f"{value:.0f}"
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
    """Mean and standard error of some values, as `concise`."""
    error = values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else np.nan
    return concise(float(values.mean()), float(error))


def concise(mean: float, error: float) -> str:
    """A mean with its standard error in units of its last digits: 0.0473(25) is 0.0473 ± 0.0025."""
    if not error >= NOTHING or abs(mean) < NOTHING:
        return short(mean)
    digits = max(0, 1 - int(f"{error:.1e}".partition("e")[2]))  # two of the rounded error
    if digits <= _MOST_DIGITS:
        return f"{mean:.{digits}f}({round(error * 10**digits)})"
    power = int(np.floor(np.log10(abs(mean))))
    scaled = concise(mean / 10.0**power, error / 10.0**power)
    return f"{scaled}·10{str(power).translate(RAISED)}"
