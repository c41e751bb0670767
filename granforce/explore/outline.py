"""The outline of S in a plane: its exact projection between an inner and an outer polygon.

The projection of S on two axes u1, u2 of force space is a convex polygon. Its support function h(θ)
= max {(cos θ u1 + sin θ u2)·F : F in S} is one linear program per direction. Each program gives a
state, whose projection is on the outline, and a certified half plane that contains all of S. New
directions are the normals of those inner edges whose neighbouring half planes still meet too far
away, so that the polygons converge from both sides (Kamenev, Comput. Math. Math. Phys. 32, 114,
1992).
"""

from __future__ import annotations

from contextlib import suppress
from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.fields import derived, record
from granforce.forces.contact_problem import cone_costs, forces_of, known_part, make_system
from granforce.forces.ensemble import Ensemble
from granforce.numerics.certified_values import Solver
from granforce.numerics.linear_programs import Program
from granforce.quantities import MEAN, Field, quantity
from granforce.records import Cancelled, InputError, float_array, moderate, positive, takes
from granforce.system import cancelling
from granforce.types import Cancel, Floats, Mask, Progress

_FIRST = 16  # directions to begin with
_MOST = 4096  # largest number of directions
# Directions closer than this (in radians) count as one: the corner of two half planes known to
# INTERVAL_GAP would not meet the tolerances required here.
_CLOSEST = 1e-5
# Smallest gap that can be requested, in units of the axes: that of the programs is 1e-8.
_FLOOR = 1e-7


@record
class Outline(NamedTuple):
    """The projection of S on two axes, in ⟨f_n⟩ times the axes' length.

    Polygons are anticlockwise.
    """

    inner: Annotated[
        Floats, quantity("inner", label="", note="corners: projections of states of S")
    ]
    outer: Annotated[Floats, quantity("outer", label="", note="corners of certified half planes")]
    gap: Annotated[float, quantity("outline_gap")]
    converged: Annotated[bool, "the gap is within the tolerance"]
    counts: Annotated[dict[str, int], "directions, programs, again, iterations as in `Intervals`"]

    @property
    def shortfall(self) -> str:
        """Why the outline is less accurate than requested, and what to do; empty if it is not."""
        return "" if self.converged else "the outline is less accurate than requested: see its gap"

    @property
    @derived(Field("corner direction", MEAN, "corners of both polygons"))
    def corners(self) -> Floats:
        """Corners (k + m, 2) of the inner polygon, then of the outer one."""
        return np.concatenate([self.inner, self.outer])

    @property
    @derived(Field("corner", "", "inner or outer"))
    def polygon(self) -> npt.NDArray[Any]:
        """The polygon (k + m,) of each of the `corners`."""
        return np.repeat(np.array(["inner", "outer"], object), [len(self.inner), len(self.outer)])


class _Support(NamedTuple):
    """Directions d with their points and bounds, in order of their angles."""

    d: Floats  # (n, 2) unit vectors
    point: Floats  # (n, 2) projection of a state farthest along d
    bound: Floats  # (n,) d·x ≤ bound for all x of the projection


@takes(Ensemble)
@cancelling.cancellable
def outline(
    ensemble: Ensemble,
    axes: Floats,
    *,
    tolerance: float = 1e-3,
    workers: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Outline:
    """The outline of S on two axes: points (axes[0]·F, axes[1]·F)/⟨f_n⟩ over S.

    Parameters
    ----------
    ensemble : Ensemble
        S, bounded.
    axes : (2, N_c, 2) array
        The axes.
    tolerance : float, default 0.001
        Largest distance of the outer polygon from the inner one, relative to the extent of the
        outline.
    workers : int, default 1
        Threads. The result does not depend on their number.
    progress : callable, optional
        progress(done, total) counts directions; total is the number known so far.
    cancel : callable, optional
        Polled; returning True ends early, with ``converged`` False and the polygons found so far.

    Returns
    -------
    Outline
        Polygons inside and around the outline, in ⟨f_n⟩.

    Raises
    ------
    InputError
        For axes of another shape or of zeros and if S is not bounded.
    NotJammedError
        If S is empty.
    Cancelled
        If cancelled before the first program.
    """
    axes = float_array(axes, (2, len(ensemble.index), 2), "axes")
    tolerance = positive(tolerance, "tolerance")
    largest = np.abs(axes).max(initial=0.0)
    if largest == 0:
        raise InputError("the axes are zero; give two directions of force space")
    moderate(largest, "the largest component of the axes")
    length = np.sqrt((axes**2).sum(axis=(1, 2)).max())
    solver = Solver(make_system(ensemble), workers=workers)
    plane = cone_costs(ensemble, axes / length).T, known_part(ensemble, axes / length)
    angle = 2 * np.pi * np.arange(_FIRST) / _FIRST
    new = np.column_stack([np.cos(angle), np.sin(angle)])
    support = _Support(np.empty((0, 2)), np.empty((0, 2)), np.empty(0))
    with suppress(Cancelled):
        while len(new) and len(support.d) + len(new) <= _MOST:
            support = _merged(support, solved(solver, plane, new, len(support.d))[1])
            corners, gap = _corners(support)
            allowed = max(tolerance * np.ptp(support.point, axis=0).max(), _FLOOR)
            new = _normals(support, gap > allowed)
            if progress:
                progress(len(support.d), len(support.d) + len(new))
    counts = {"directions": len(support.d), **solver.counts}
    if not len(support.d):
        return Outline(np.empty((0, 2)), np.empty((0, 2)), np.inf, False, counts)
    far, inner, outer = float(gap.max()), _hull(support.point), _hull(corners)
    return Outline(inner * length, outer * length, far * length, bool(far <= allowed), counts)


def supports(
    ensemble: Ensemble, axes: Floats, angles: npt.ArrayLike, *, workers: int = 1
) -> tuple[Floats, Floats]:
    """Largest cos θ u1·F + sin θ u2·F over S, F in ⟨f_n⟩, and duality gaps: (k,) for angles (k,).

    axes (2, N_c, 2): u1, u2.
    """
    axes = float_array(axes, (2, len(ensemble.index), 2), "axes")
    solver = Solver(make_system(ensemble), workers=workers)
    plane = cone_costs(ensemble, axes).T, known_part(ensemble, axes)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    _, solutions = solved(solver, plane, directions)
    inner = (solutions.point * solutions.d).sum(axis=1)
    return inner, np.abs(solutions.bound - inner)


def extremes(ensemble: Ensemble, axes: Floats, directions: Floats) -> Floats:
    """Networks of S (k, N_c, 2), force, that go farthest along directions (k, 2) of the axes.

    axes (2, N_c, 2). Raises Cancelled, and InputError if a program fails.
    """
    axes = float_array(axes, (2, len(ensemble.index), 2), "axes")
    plane = cone_costs(ensemble, axes).T, known_part(ensemble, axes)
    return forces_of(ensemble, solved(Solver(make_system(ensemble)), plane, directions)[0])


def solved(
    solver: Solver, plane: Any, directions: Floats, first: int = 0
) -> tuple[Floats, _Support]:
    """(y (k, n) farthest along new directions (k, 2), their _Support); keys start at first.

    plane: the axes in cone coordinates (n, 2), and the contribution of known forces (2,).
    """
    across, origin = plane
    keys = list(range(first, first + len(directions)))
    costs = -(across @ directions.T)
    columns = list(range(len(costs)))
    points: dict[int, Floats] = {}
    tasks = [Program(columns, cost.tolist(), -1) for cost in costs.T]
    bounds = solver.solve(keys, tasks, points)
    cancelling.check("outline")
    y = np.stack([points[key] for key in keys])
    attained, bound = -np.array([bounds[key] for key in keys]).T
    if not np.all(np.isfinite(attained) & np.isfinite(bound)):
        raise InputError("the outline cannot be certified: linear programs over S fail")
    point = y[:, : len(across)] @ across + origin
    return y, _Support(directions, point, bound + directions @ origin)


def _merged(support: _Support, new: _Support) -> _Support:
    both = _Support(*(np.concatenate(pair) for pair in zip(support, new, strict=True)))
    order = np.argsort(np.arctan2(both.d[:, 1], both.d[:, 0]), kind="stable")
    return _Support(*(field[order] for field in both))


def _corners(support: _Support) -> tuple[Floats, Floats]:
    """Corners (n, 2) of neighbouring half planes, and their distances (n,) from the inner edges.

    Corner and edge k belong to directions k and k + 1.
    """
    d, after = support.d, np.roll(support.d, -1, axis=0)
    h, h_after = support.bound, np.roll(support.bound, -1)
    sine = _cross(d, after)
    corner = np.column_stack(
        [h * after[:, 1] - h_after * d[:, 1], h_after * d[:, 0] - h * after[:, 0]]
    )
    corner /= sine[:, None]
    begin, end = support.point, np.roll(support.point, -1, axis=0)
    edge = end - begin
    size = np.maximum((edge**2).sum(axis=1), np.finfo(float).tiny)
    along = np.clip(((corner - begin) * edge).sum(axis=1) / size, 0, 1)
    return corner, np.linalg.norm(corner - begin - along[:, None] * edge, axis=1)


def _normals(support: _Support, wide: Mask) -> Floats:
    """Outward normals of the inner edges (mask wide), or the middle between their directions."""
    d, after = support.d[wide], np.roll(support.d, -1, axis=0)[wide]
    edge = (np.roll(support.point, -1, axis=0) - support.point)[wide]
    normal = np.column_stack([edge[:, 1], -edge[:, 0]])
    size = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(size, np.finfo(float).tiny)[:, None]
    # The normal of an edge shorter than rounding error may point anywhere.
    between = (_cross(d, normal) > _CLOSEST) & (_cross(normal, after) > _CLOSEST)
    middle = d + after
    middle /= np.linalg.norm(middle, axis=1)[:, None]
    new = np.where((between & (size > _FLOOR))[:, None], normal, middle)
    return new[_cross(d, after) > 2 * _CLOSEST]


def _cross(a: Floats, b: Floats) -> Floats:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _hull(points: Floats) -> Floats:
    """Corners of the convex hull of points (n, 2), anticlockwise (Andrew's monotone chain)."""
    chain: list[Any] = []
    for ordered in (np.unique(points, axis=0), np.unique(points, axis=0)[::-1]):
        begin = len(chain)
        for x, y in ordered.tolist():
            while len(chain) > begin + 1:
                (ax, ay), (bx, by) = chain[-2:]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0:
                    break
                chain.pop()
            chain.append((x, y))
        chain.pop()  # the first point of either half
    return np.array(chain or points[:1].tolist())
