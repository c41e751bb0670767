"""Coordinates u of the polytope {y ≥ 0 : A y = b} in which it is nearly round, for sampling it.

The affine hull is found by linear programs, the origin is the analytic centre y° (the largest Π y),
and the metric is that of the barrier −Σ log y there: y = y° (1 + G u) with GᵀG = 1. In these
coordinates the polytope contains the ball |u| ≤ 1 and is contained in the ball |u| < rows of G
(Nesterov, Nemirovskii, Interior-point polynomial algorithms, 1994).
"""

from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse

from granforce.explore.billiard import LANES
from granforce.numerics import certificates
from granforce.numerics import highs as programs
from granforce.records import InputError
from granforce.system import cancelling
from granforce.tolerances import FLAT

# What every coordinate is asked to reach, if it can, in the point the centring starts from.
_AWAY = 0.01
# Rows of A whose remainder, relative to the largest row, is below this follow from the others.
_DEPENDENT = 1e-11
# Rows below this do not follow, but to balance them further than the program did would move the
# point far: frozen boundaries have such rows.
_NEARLY_DEPENDENT = 1e-7
_MOST_NEWTON_STEPS = 200
_CENTRED = 1e-9
# The same for a centre that only has to make a body round: a narrow W bounds what rounding leaves.
_NEAR_CENTRE = 1e-3


class Chart(NamedTuple):
    """y = centre; y[moving] *= 1 + G u. Rows of G beyond those of `moving` are padding (zero)."""

    centre: np.ndarray  # (n,) the analytic centre y°
    moving: np.ndarray  # positions in y of what is not held in all of the polytope
    G: np.ndarray  # (rows, h) slope of each slack y/y°, columns orthonormal
    columns: np.ndarray  # (h, rows) its transpose
    K: np.ndarray  # (rows, rows) G Gᵀ
    turn: np.ndarray  # (rows,) 2/diag K, 0 where a slack cannot change

    @property
    def dimension(self):
        """Dimension h of the affine hull."""
        return self.G.shape[1]

    def points(self, slacks):
        """y (…, n) ≥ 0 of slacks (…, rows)."""
        y = np.broadcast_to(self.centre, (*slacks.shape[:-1], len(self.centre))).copy()
        y[..., self.moving] *= np.maximum(slacks[..., : len(self.moving)], 0.0)
        return y


def chart(A, b, inner=None, pull=None):
    """The Chart of {y ≥ 0 : A y = b}; A sparse (m, n), b (m,), y of order 1.

    inner: a y ≥ 0 well inside, if one is known, 0 only where it is in all of the polytope; found by
    linear programs otherwise, as is what is held at 0. pull: (W, d) for the centre of
    exp(−½ |W y − d|²) cut by the walls, which has the largest Σ log y − ½ |W y − d|², in place of
    the analytic one; W sparse (k, n), d (k,).

    Raises NotJammedError where there is no such y, InputError where the centre lies at infinity,
    UndecidedError where no solver could tell.
    """
    if inner is None:
        y, held = inner_point(A, b)
    else:
        y, held = inner.copy(), inner == 0
    moving = np.flatnonzero(~held)
    inner = y[moving]
    dense = A.tocsc()[:, moving].toarray() * inner
    relative, least = cancelling.apart(_null_space, dense)
    null = inner[:, None] * relative
    # The program's point is balanced to its tolerance only: what is left is spread over all
    # coordinates in proportion.
    for _ in range(3):
        y[moving] *= 1 + least(b - A @ y)
    W, d = (np.zeros((0, len(moving))), np.zeros(0)) if pull is None else _pull_on(moving, y, *pull)
    y[moving] = cancelling.apart(_centred, y[moving], null, W, d)
    G = cancelling.apart(np.linalg.qr, null / y[moving, None])[0]
    G = np.vstack([G, np.zeros((-len(G) % LANES, G.shape[1]))])
    K = cancelling.apart(np.matmul, G, G.T)
    diagonal = np.diagonal(K)
    turn = np.divide(2.0, diagonal, out=np.zeros(len(G)), where=diagonal > 0)
    return Chart(y, moving, G, np.ascontiguousarray(G.T), K, turn)


def inner_point(A, b):
    """A point y (n,) inside the polytope relative to its affine hull, and the mask of what is held.

    Held are coordinates that stay below FLAT in all of the polytope. Each program raises the sum
    of what was not seen above it yet, each coordinate counted up to a small value only.
    """
    n = A.shape[1]
    held = np.ones(n, dtype=bool)
    found = []
    while held.any():
        y = _raised(A, b, np.flatnonzero(held))
        found.append(y)
        newly = held & (y > FLAT)
        if not newly.any():
            break
        held &= ~newly
    return np.mean(found, axis=0), held


def _raised(A, b, low):
    """The y with the largest Σ min(y, _AWAY) over the coordinates `low`."""
    n = A.shape[1]
    upper = np.concatenate([np.full(n, np.inf), np.full(len(low), _AWAY)])
    cost = np.concatenate([np.zeros(n), np.full(len(low), -1.0)])
    both = sparse.hstack([A, A.tocsc()[:, low]])
    model = programs.bounded(both, (b, b), (np.zeros(len(upper)), upper), cost, solver="ipm")
    model.setOptionValue("run_crossover", "off")  # inner points are wanted, not vertices
    solution = programs.optimal(model)
    if solution is None:
        raise certificates.why_unsolved(A, b)
    solution = np.maximum(solution, 0.0)
    y = solution[:n]
    y[low] += solution[n:]
    return y


def _null_space(dense):
    """Orthonormal basis (n, h) of the null space, and r → the least d with (matrix) d = r."""
    Q, R, order = linalg.qr(dense.T, pivoting=True)
    diagonal = np.abs(np.diagonal(R))
    rank = int(np.sum(diagonal > _DEPENDENT * diagonal.max(initial=0.0)))
    sure = int(np.sum(diagonal > _NEARLY_DEPENDENT * diagonal.max(initial=0.0)))
    triangle = R[:sure, :sure]

    def least(r):
        return Q[:, :sure] @ linalg.solve_triangular(triangle, r[order[:sure]], trans="T")

    return Q[:, rank:], least


def _pull_on(moving, y, W, d):
    """W and d for the moving coordinates alone."""
    held = np.ones(len(y), dtype=bool)
    held[moving] = False
    return W[:, moving], d - W[:, np.flatnonzero(held)] @ y[held]


def _centred(y, null, W, d):
    """The y > 0 with the largest Σ log y − ½ |W y − d|² among y + null · z, by damped Newton."""
    if not null.shape[1]:
        return y
    pulled, enough = W @ null, _NEAR_CENTRE if len(d) else _CENTRED
    for _ in range(_MOST_NEWTON_STEPS):
        cancelling.check("uniform sample")
        miss = d - W @ y
        slope = null.T @ (1 / y) + pulled.T @ miss
        scaled = null / y[:, None]
        factor = linalg.cho_factor(scaled.T @ scaled + pulled.T @ pulled)
        move = linalg.cho_solve(factor, slope)
        relative, closer = scaled @ move, pulled @ move
        gain = float(relative.sum() + closer @ miss)  # Newton decrement squared
        if gain < enough**2:
            return y
        step = min(1.0, 0.95 / max(-relative.min(), 1e-300))
        while _rise(step, relative, closer, miss) < 0.1 * step * gain:
            step /= 2
        y = y * (1 + step * relative)
    raise InputError("the forces on these contacts are not bounded: is a pressure or load set?")


def _rise(step, relative, closer, miss):
    """Growth of Σ log y − ½ |W y − d|² along a step."""
    return np.log1p(step * relative).sum() + step * (closer @ miss - 0.5 * step * closer @ closer)
