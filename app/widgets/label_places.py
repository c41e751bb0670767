"""Places for labels next to the points of a plot, such that all labels are legible."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from granforce.types import Floats

# Pixels of the smallest plot with labels (between its axes), of a letter, and of a point.
SMALLEST, LETTER, POINT = (270.0, 190.0), (6.0, 11.0), 4.0
Pair = tuple[float, float]
Box = tuple[float, float, float, float]  # left, top, right, bottom, in pixels
# Possible places of a label around its point.
CORNERS = (
    (5, -4, "left", "bottom"),
    (-5, -4, "right", "bottom"),
    (5, 4, "left", "top"),
    (-5, 4, "right", "top"),
)


def labels(x: Floats, y: Floats, words: Sequence[str], span: Pair) -> dict[str, list[Any]]:
    """Places of labels next to points, without collisions, as columns of a text glyph.

    span: range of the axes. Plots larger than SMALLEST have more room between labels. Labels
    without a place are left out.
    """
    scale = [0.9 * room / (part or 1.0) for room, part in zip(SMALLEST, span, strict=True)]
    places = np.column_stack([x * scale[0], -y * scale[1]])
    taken = [(px - POINT, py - POINT, px + POINT, py + POINT) for px, py in places]
    joined = [(px, py, px, py) for px, py in _along(places)]
    ends = _ends(places)
    names = "x", "y", "text", "right", "down", "align", "baseline"
    rows = []
    for k, (px, py) in enumerate(places):
        size = LETTER[0] * len(words[k]), LETTER[1]
        found = [(corner, _box((px, py), corner, size)) for corner in CORNERS]
        free = [
            (corner, box)
            for corner, box in found
            if _within(box, ends) and not any(_meet(box, other) for other in taken)
        ]
        clear = [one for one in free if not any(_meet(one[1], point) for point in joined)]
        if free:
            corner, box = (clear or free)[0]
            taken.append(box)
            rows.append((x[k], y[k], words[k], *corner))
    columns = zip(*rows, strict=True) if rows else ((),) * len(names)
    return {name: list(column) for name, column in zip(names, columns, strict=True)}


def _box(place: Pair, corner: tuple[float, float, str, str], size: Pair) -> Box:
    """Pixels (left, top, right, bottom) of a label of this size at a corner of a point."""
    (px, py), (right, down, align, baseline), (width, height) = place, corner, size
    left = px + right - (width if align == "right" else 0)
    top = py + down - (height if baseline == "bottom" else 0)
    return left, top, left + width, top + height


def _along(places: Floats) -> Floats:
    """Pixels of the line that joins points, closely spaced."""
    if len(places) < 2:
        return places
    part = np.linspace(0, 1, 24)[:, None, None]
    return ((1 - part) * places[:-1] + part * places[1:]).reshape(-1, 2)


def _ends(places: Floats) -> Box:
    """The frame of a plot, whose axes extend a twentieth beyond the data."""
    room = 0.05 * np.array(SMALLEST)
    return (*(places.min(axis=0) - room), *(places.max(axis=0) + room))


def _within(box: Box, ends: Box) -> bool:
    return ends[0] <= box[0] and ends[1] <= box[1] and box[2] <= ends[2] and box[3] <= ends[3]


def _meet(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
