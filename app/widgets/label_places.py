"""Places for labels next to the points of a plot, such that all labels are legible."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from granforce.types import Floats

# Pixels of the smallest plot with labels (between its axes), of a letter, and of a point.
SMALLEST, LETTER, POINT = (270.0, 190.0), (6.0, 11.0), 4.0
COLUMNS = "x", "y", "text", "right", "down", "align", "baseline"
AWAY = 5, 4  # pixels from a point to its label, across and up


def labels(
    x: Floats, y: Floats, words: Sequence[str], span: tuple[float, float]
) -> dict[str, list[Any]]:
    """Places of labels next to points, without collisions, as columns of a text glyph.

    span: range of the axes. Plots larger than SMALLEST have more room between labels. Labels
    without a place are left out.
    """
    places = np.column_stack([x, y]) * [
        0.9 * room / (part or 1.0) for room, part in zip(SMALLEST, span, strict=True)
    ]
    room = 0.05 * np.array(SMALLEST)  # by which the axes extend beyond the data
    low, high = places.min(axis=0) - room, places.max(axis=0) + room
    taken = [(place - POINT, place + POINT) for place in places]
    columns: dict[str, list[Any]] = {name: [] for name in COLUMNS}
    for k, place in enumerate(places):
        size = LETTER[0] * len(words[k]), LETTER[1]
        for right, up in product((1, -1), repeat=2):
            begin = place + np.multiply(AWAY, (right, up)) - np.multiply(size, (right < 0, up < 0))
            end = begin + size
            met = any((begin < b).all() and (a < end).all() for a, b in taken)
            if met or (begin < low).any() or (end > high).any():
                continue
            taken.append((begin, end))
            row = x[k], y[k], words[k], right * AWAY[0], -up * AWAY[1]
            side = "left" if right > 0 else "right", "bottom" if up > 0 else "top"
            for column, value in zip(columns.values(), (*row, *side), strict=True):
                column.append(value)
            break
    return columns
