"""The inner part of a packing, surrounded by contacts frozen at their original forces."""

from collections.abc import Sequence

import numpy as np

from granforce.records import InputError, Packing
from granforce.types import Mask


def edges(given: Sequence[float]) -> list[float]:
    """x0, x1, y0, y1 of a slice as floats; InputError unless 0 ≤ x0 < x1 ≤ 1, y alike."""
    try:
        x0, x1, y0, y1 = (float(edge) for edge in given)
    except (TypeError, ValueError):
        raise InputError.of("slice", given, "must be four numbers x0,x1,y0,y1") from None
    if not (0 <= x0 < x1 <= 1 and 0 <= y0 < y1 <= 1):
        words = f"{x0:g},{x1:g},{y0:g},{y1:g} must satisfy 0 ≤ x0 < x1 ≤ 1 and 0 ≤ y0 < y1 ≤ 1"
        raise InputError.of("slice", given, words)
    return [x0, x1, y0, y1]


def outside(packing: Packing, slice_: Sequence[float]) -> Mask:
    """Mask (N_c,) of contacts with a grain centre outside x0 … x1, y0 … y1 (fractions of a and b).

    Raises InputError unless 0 ≤ x0 < x1 ≤ 1 and 0 ≤ y0 < y1 ≤ 1, and if the box is open.
    """
    x0, x1, y0, y1 = edges(slice_)
    if not np.isfinite(packing.volume):
        words = "is in fractions of the sides of a periodic box, and this box is open; leave it out"
        raise InputError.of("slice", slice_, words)
    cell, contacts = packing.cell, packing.contacts
    x = cell.wrapped(packing.x)
    place = cell.parts(x)
    inside = np.all((place >= (x0, y0)) & (place <= (x1, y1)), axis=1)
    # A contact across the cell's edge is outside the slice even if both grains are inside.
    step = x[contacts.j] - x[contacts.i] - contacts.normal * contacts.length[:, None]
    crossing = np.any(np.abs(cell.parts(step)) > 0.5, axis=1)
    return ~(inside[contacts.i] & inside[contacts.j]) | crossing
