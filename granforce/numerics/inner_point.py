"""A point inside a polytope {y ≥ 0 : A y = b} relative to its affine hull, however thin it is.

Coordinates of a thin polytope may be as small as 10⁻¹², but linear-programming solvers balance only
to 10⁻¹⁰. So a program is solved in units of 1, and coordinates that stayed at 0 once more in units
of 10⁻⁴, as a change from a point balanced to rounding (iterative refinement of linear programs:
Gleixner, Steffy, Wolter, INFORMS J. Comput. 28, 449 (2016)).
"""

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from granforce.numerics import certificates
from granforce.numerics import highs as programs
from granforce.records import NotJammedError, UndecidedError
from granforce.system import cancelling
from granforce.tolerances import FLAT
from granforce.types import Floats, Mask

# Units of the programs. In the last one, solvers distinguish FLAT from 0 reliably.
_UNITS = 1.0, 1e-4
# The value that every coordinate should reach, if it can, in each unit.
_AWAY = 0.01
# Number of balancing steps, and the shift of the diagonal for rows that follow from others.
_BALANCING, _SHIFT = 6, 1e-14
# The last of these steps measure rounding; the resolution is this many times as large.
_LAST, _BEYOND = 3, 10.0


class InnerPoint(NamedTuple):
    """A point of a polytope, and the coordinates that cannot move."""

    y: Floats  # (n,)
    held: Mask  # (n,) bool, coordinates that stay below `resolution` in all of the polytope
    resolution: float  # FLAT, or the rounding error of the balance in y if larger


def inner_point(A: sparse.csr_matrix, b: Floats) -> InnerPoint:
    """The InnerPoint of {y ≥ 0 : A y = b}, rows of A of order 1; y > 0 for all that is not held.

    Each program raises the sum of the coordinates not yet above the resolution, each counted up to
    a small value only. Only points balanced to rounding count.

    Raises NotJammedError if the polytope is empty, UndecidedError if no solver succeeds.
    """
    A, point = sparse.csc_matrix(A), _nowhere(A)
    for unit in _UNITS:
        point = _searched(A, b, unit, point)
    y, held, resolution = point
    y = np.maximum(y, 0.0)
    free, rest = A[:, ~held], b - A[:, held] @ y[held]
    y[~held], _ = cancelling.apart(balanced, free, rest, y[~held])
    return InnerPoint(y, held | (y <= 0), resolution)


def away_from_walls(A: sparse.csr_matrix, b: Floats) -> Floats | None:
    """A balanced y (n,) found by the first program alone; None, or some y ≤ 0, if it finds none."""
    A, start = sparse.csc_matrix(A), _nowhere(A)
    try:
        y = _raised(A, b, _UNITS[0], start, start.held)
    except (NotJammedError, UndecidedError):
        return None
    return None if y is None else cancelling.apart(balanced, A, b, y)[0]


def _nowhere(A: sparse.csc_matrix) -> InnerPoint:
    """Where the search begins: every coordinate is at 0."""
    return InnerPoint(np.zeros(A.shape[1]), np.ones(A.shape[1], dtype=bool), FLAT)


def _searched(A: sparse.csc_matrix, b: Floats, unit: float, start: InnerPoint) -> InnerPoint:
    """The InnerPoint reached by programs in this unit, from one in a larger unit."""
    held, resolution = start.held.copy(), start.resolution
    points: list[Floats] = []
    wanted, untried, last = held, held, unit == _UNITS[-1]
    while wanted.any():
        point = _raised(A, b, unit, start, wanted)
        if point is None:
            break
        point, noise = cancelling.apart(balanced, A, b, point)
        resolution = max(resolution, _BEYOND * noise)
        # The first unit covers everything that would reach the limit of the last one.
        least = resolution if last else max(resolution, _AWAY * _UNITS[-1])
        if last and point.min() < -least:
            break
        points.append(point)
        newly = held & (point > least)
        if newly.any():
            held = held & ~newly
            wanted = untried = held
            continue
        if not last:
            break
        # Both sides of a narrow band may be above the threshold together, but neither alone.
        untried = untried & ~wanted if wanted.sum() == 1 else untried
        rest = np.where(untried, point, 0.0)
        wanted = (np.arange(len(rest)) == np.argmax(rest)) & (rest.sum() > least)
    y = np.mean(points, axis=0) if points else start.y
    return InnerPoint(y, held, resolution)


def _raised(
    A: sparse.csc_matrix, b: Floats, unit: float, start: InnerPoint, wanted: Mask
) -> Floats | None:
    """A nearly balanced y with the largest Σ min(y, _AWAY unit) over the wanted coordinates.

    After the first unit y is searched around the start, a balanced point whose held coordinates may
    be negative within the solvers' tolerance; no other coordinate falls below half its value. None
    if not found.
    """
    first, n, some = unit == _UNITS[0], len(start.y), np.flatnonzero(start.held)
    # Held coordinates count from 0, all others from the start.
    origin = np.where(start.held, 0.0, start.y)
    lower = np.zeros(n) if first else -0.5 * origin / unit
    right = b if first else A[:, some] @ (start.y[some] / unit)
    cost = np.append(np.zeros(n), -wanted[some].astype(float))
    columns = (
        np.append(lower, np.zeros(len(some))),
        np.append(np.full(n, np.inf), np.full(len(some), _AWAY)),
    )
    both = sparse.hstack([A, A[:, some]])
    # Inner points are wanted, but after the first unit only vertices are accurate enough.
    model = programs.bounded(
        both, (right, right), columns, cost, solver="ipm" if first else "simplex"
    )
    model.setOptionValue("run_crossover", "off")
    solution = programs.optimal(model)
    if solution is None and first:
        raise certificates.why_unsolved(A, b)
    if solution is None:
        return None
    solution = np.maximum(solution, columns[0])
    y = solution[:n]
    y[some] += solution[n:]
    return origin + unit * y


def balanced(A: sparse.csc_matrix, b: Floats, y: Floats) -> tuple[Floats, float]:
    """y (n,) with A y = b restored by the least change, and the rounding error of y."""
    rows, n = A.shape
    if not rows:
        return y, 0.0
    one, shift = sparse.identity(n), -_SHIFT * sparse.identity(rows)
    factors = splu(sparse.bmat([[one, A.T], [A, shift]], format="csc"))
    steps = []
    for _ in range(_BALANCING):
        steps.append(factors.solve(np.append(np.zeros(n), b - A @ y))[:n])
        y = y + steps[-1]
    return y, float(np.abs(steps[-_LAST:]).max(initial=0.0))
