"""The contents of the files of one photoelastic frame, before any check or repair."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NamedTuple, Protocol, SupportsIndex

import numpy as np

from granforce.types import Floats, Integers, Mask

# Largest gap of two grains that may touch, in mean radii: centres and radii are known only to some
# tenths of a radius.
FAR = 1.0


class Listing(NamedTuple):
    """Grains and contacts of one frame as listed; NaN for fields that are not finite numbers."""

    ids: Floats  # (N,) ids of the grains
    x: Floats  # (N, 2) centres
    r: Floats  # (N,) radii
    flag: Floats  # (N,) not 0 for grains at a wall
    ends: Floats  # (k, 2) ids of the two grains of each line; below 0: a wall
    forces: Floats  # (k, 2) f_n, f_t
    beta: Floats  # (k,) angle from the first grain to the contact, rad; NaN: not listed
    weight: Floats  # (k,) 1/σ² of the line's forces relative to a usual line
    names: tuple[str, str]  # of the two files
    lines: tuple[Integers, Integers]  # (N,), (k,): their line numbers
    both_ways: bool  # whether two lines of one contact are independent measurements
    frame: float
    description: str  # the recognised columns, in words
    pressure: Floats | None = None  # (N,) G², or pressure, of the grains; None: not listed

    def place(self, kind: int, row: SupportsIndex) -> str:
        """'file, line n' of a grain (kind 0) or a contact (1)."""
        return f"{self.names[kind]}, line {int(self.lines[kind][row])}"

    def with_grains(self, rows: Integers | Mask) -> Listing:
        """The listing with a selection of its grains, in this order."""
        columns = {name: getattr(self, name)[rows] for name in ("ids", "x", "r", "flag")}
        if self.pressure is not None:
            columns["pressure"] = self.pressure[rows]
        return self._replace(**columns, lines=(self.lines[0][rows], self.lines[1]))

    def with_contacts(self, rows: Integers | Mask) -> Listing:
        """The listing with a selection of its contacts, in this order."""
        columns = {name: getattr(self, name)[rows] for name in ("ends", "forces", "beta", "weight")}
        return self._replace(**columns, lines=(self.lines[0], self.lines[1][rows]))

    @property
    def rows(self) -> Integers:
        """Rows (k, 2) of the grains in contacts; −1 for a wall, −2 for a missing grain."""
        order = np.argsort(self.ids, kind="stable")
        place = np.searchsorted(self.ids, self.ends, sorter=order)
        rows = order[np.minimum(place, len(order) - 1)]
        rows = np.where(self.ids[rows] == self.ends, rows, -2)
        return np.where(self.ends < 0, -1, rows)

    @property
    def gaps(self) -> Floats:
        """Gaps (k,) of the disks joined by contacts; NaN if one is a wall or missing."""
        rows = self.rows
        listed = np.all(rows >= 0, axis=1)
        i, j = np.where(listed[:, None], rows, 0).T
        gap = np.hypot(*(self.x[j] - self.x[i]).T) - self.r[i] - self.r[j]
        return np.where(listed, gap, np.nan)

    @property
    def mean_radius(self) -> float:
        """The mean of the radii that can be read, NaN without any."""
        good = self.r[np.isfinite(self.r) & (self.r > 0)]
        return float(good.mean()) if len(good) else np.nan

    @property
    def fit(self) -> float:
        """Fraction of the contacts between grains that join existing, close grains."""
        inner = np.all(self.ends >= 0, axis=1)
        return float(np.mean(self.gaps[inner] <= FAR * self.mean_radius)) if inner.any() else 1.0

    def renumbered(self) -> Iterator[tuple[str, int, Listing]]:
        """The listing with ids that count its grains: in which order, from which number."""
        count = len(self.ids)
        orders = {
            "as they are listed": np.arange(count),
            "by id": np.argsort(self.ids, kind="stable"),
            "by x": np.argsort(self.x[:, 0], kind="stable"),
            "by y": np.argsort(self.x[:, 1], kind="stable"),
        }
        for (words, order), first in itertools.product(orders.items(), (1, 0)):
            ids = np.empty(count)
            ids[order] = np.arange(first, first + count)
            yield words, first, self._replace(ids=ids)


class Frames(Protocol):
    """A source of frames: their numbers, and the Listing of one, by default the last."""

    @property
    def frames(self) -> Floats: ...

    def listing(self, frame: float | None = None) -> Listing: ...


def plain(number: float) -> int | float:
    """The number as an int if it is whole."""
    return int(number) if float(number).is_integer() else float(number)
