"""The order in which contacts are drawn, and the selection of them."""

from typing import NamedTuple

import numpy as np

from granforce.types import Floats, Integers

from ....packing.legend import Bounds
from ....results.replays import Replay
from ....state.known import Narrowed
from ....state.view_settings import SORTS

MOST_BARS = 3000  # more than the pixels; of more contacts, evenly spaced ones are drawn
SOME = 16  # number of bars distinguishable at a glance
USUAL = "original"


class Order(NamedTuple):
    """Contacts (N_c,) as positions in the backbone, and their order in words."""

    contacts: Integers
    words: str


def ordered(
    replay: Replay, exact: Bounds, by: str, narrowed: Narrowed | None = None, coming: bool = False
) -> Order:
    """All contacts in the order `by`, one of SORTS, as far as it is known.

    narrowed: intervals given known forces; coming: whether exact bounds are being computed.
    """
    value = _value(replay, exact, by, narrowed)
    if value is None:
        why = "exact bounds are being computed" if coming else f"no {SORTS[by]} yet"
        if by == "shortened":
            why = "no force is held"
        return Order(replay.order, f"{SORTS[USUAL]}: {why}")
    order = replay.order if by == USUAL else np.argsort(value, kind="stable")
    given = " given the held forces" if by in ("exact", "position") and narrowed else ""
    given = ", held first, then the largest" if by == "shortened" else given
    return Order(order, SORTS[by] + given)


def _value(replay: Replay, exact: Bounds, by: str, narrowed: Narrowed | None) -> Floats | None:
    """The values for sorting contacts, ascending; None if unknown."""
    if by == USUAL:
        return replay.normal[0]
    if by == "extent":
        return replay.high[:, 0] - replay.low[:, 0]
    if by == "shortened":
        if narrowed is None:
            return None
        value = -narrowed.shortened
        value[[one.contact for one in narrowed.known]] = -np.inf  # all of their interval is gone
        return value
    if not exact:
        return None
    extent = exact["high"] - exact["low"]
    if by == "exact":
        return extent
    with np.errstate(invalid="ignore", divide="ignore"):
        return (replay.normal[0] - exact["low"]) / extent


def picked(order: Integers, most: int, named: list[int]) -> Integers:
    """Ranks (k,) of contacts to draw: evenly spaced, at most `most`, and the named ones."""
    step = -(-len(order) // most)
    return np.union1d(np.arange(0, len(order), step), np.flatnonzero(np.isin(order, named)))
