"""The periodic cell: images of points and of vectors between them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.fields import record
from granforce.types import Floats, Integers


@record
class Cell(NamedTuple):
    """The periodic cell, spanned by a = (L_x, 0) and b = (tilt, L_y); tilt is LAMMPS' ``xy``."""

    box: Annotated[Floats, "(2,) L_x, L_y, length; inf in an open direction"]
    tilt: Annotated[float, "x component of b, length; 0 if a direction is open"]

    @property
    def vectors(self) -> Floats:
        """a and b as rows (2, 2), zero along open directions: images are at x + shift @ vectors."""
        sides = np.where(np.isfinite(self.box), self.box, 0.0)
        return np.array([[sides[0], 0.0], [self.tilt, sides[1]]])

    @property
    def heights(self) -> Floats:
        """Distances (2,) between opposite sides along a and b; inf in open directions."""
        if not self.tilt:
            return self.box
        return self.box * [self.box[1] / np.hypot(self.tilt, self.box[1]), 1.0]

    @property
    def corners(self) -> Floats:
        """Corners (5, 2) of the parallelogram, back to the first; both sides must be periodic."""
        return np.array([(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)]) @ self.vectors

    @property
    def bounding_box(self) -> Floats:
        """Lower left and upper right corners (2, 2) of the bounding box; inf in open directions."""
        lean = np.array([self.tilt, 0.0])
        return np.array([np.minimum(lean, 0.0), self.box + np.maximum(lean, 0.0)])

    @property
    def shortest(self) -> float:
        """Distance of a point from its own nearest image; inf without an image."""
        return float(np.linalg.norm(self.reduced[0]) if self.tilt else self.box.min())

    @property
    def reduced(self) -> Floats:
        """The two shortest vectors (2, 2) that span the lattice, the shortest first (Gauss)."""
        short, long = sorted(self.vectors, key=np.linalg.norm)
        while (times := np.round(short @ long / max(short @ short, np.finfo(float).tiny))) != 0:
            short, long = sorted((short, long - times * short), key=np.linalg.norm)
        return np.array([short, long])

    def parts(self, x: Floats) -> Floats:
        """Points (…, 2) in fractions of a and b, from 0 to 1 inside; both must be periodic."""
        up = x[..., 1] / self.box[1]
        return np.stack([(x[..., 0] - self.tilt * up) / self.box[0], up], axis=-1)

    def across(self, x: Floats) -> Floats:
        """Distances (…, 2) of points from the sides b and a; equal to x and y without tilt."""
        if not self.tilt:
            return np.array(x, dtype=np.float64)
        return self.parts(x) * self.heights

    def images(
        self, low: Floats, high: Floats, margin: float = 0.0
    ) -> Iterator[tuple[Floats, Integers]]:
        """Yield the images that are in the cell, for things that extend from low to high (k, 2).

        low and high are in the coordinates of `across`. margin: width of a strip around the cell
        that also counts. Yields vectors (2,) of whole cells, and the rows (m,) whose image by that
        vector is in the cell.
        """
        periodic = np.isfinite(self.box)
        side = np.where(periodic, self.heights, 1.0)
        first = np.minimum(np.floor(-(margin + high.max(axis=0, initial=0.0)) / side) + 1, 0)
        last = np.maximum(np.ceil(1 + (margin - low.min(axis=0, initial=0.0)) / side) - 1, 0)
        first, last = (np.where(periodic, steps, 0.0).astype(int) for steps in (first, last))
        for step in itertools.product(*(range(a, b + 1) for a, b in zip(first, last, strict=True))):
            moved = step * side
            visible = (high + moved > -margin) & (low + moved < side + margin)
            yield step @ self.vectors, np.flatnonzero(np.all(visible | ~periodic, axis=1))

    def wrapped(self, x: npt.ArrayLike) -> Floats:
        """Points (…, 2) at their image in the parallelogram, unchanged in open directions."""
        inside = np.array(x, dtype=np.float64)
        lean = np.zeros(inside.shape[:-1])
        if np.isfinite(self.box[1]):
            up = _remainder(inside[..., 1], self.box[1])
            if self.tilt:
                crossed = np.round((inside[..., 1] - up) / self.box[1])
                inside[..., 0] -= crossed * self.tilt
                lean = self.tilt * (up / self.box[1])
            inside[..., 1] = up
        if np.isfinite(self.box[0]):
            inside[..., 0] = _remainder(inside[..., 0] - lean, self.box[0]) + lean
        return inside

    def nearest(self, branch: npt.ArrayLike) -> Floats:
        """The shortest image (…, 2) of vectors between two points."""
        branch = np.array(branch, dtype=np.float64)
        if not self.tilt:
            periodic = np.isfinite(self.box)
            side = np.where(periodic, self.box, 1.0)
            return branch - np.where(periodic, side * np.round(branch / side), 0.0)
        # The angle between the two shortest vectors is 60° or more: the shortest image is at most
        # one step along each from the rounded one.
        short = self.reduced
        branch = branch - np.round(branch @ np.linalg.inv(short)) @ short
        steps = [(0, 0), *(s for s in itertools.product((-1, 0, 1), repeat=2) if any(s))]
        images = branch[..., None, :] + np.array(steps) @ short
        pick = np.argmin(np.linalg.norm(images, axis=-1), axis=-1)
        return np.take_along_axis(images, pick[..., None, None], axis=-2)[..., 0, :]


def _remainder(values: Floats, side: float) -> Floats:
    """Numbers modulo a side, in [0, side), even if a tiny negative one rounds to the side."""
    left = np.mod(values, side)
    return np.where(left >= side, 0.0, left)
