"""K of a thin S by singular values, for S whose rows the pivots of A C Aᵀ cannot distinguish.

Those pivots are squares: at μ = 10⁻⁷, the contribution of friction to a row that otherwise follows
from others (such as the rows of the stress) is 10⁻¹⁴ of it, which is rounding. With the columns of
N orthonormal in the null space of the balance of relative slacks, and H = 1 + Nᵀ Lᵀ W L N for
forces L w of slacks 1 + w and a weight W on them, K = N H⁻¹ Nᵀ.
"""

from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse

from granforce.numerics.lanes import LANES
from granforce.system import cancelling
from granforce.types import Floats, Integers


class ThinMatrix(NamedTuple):
    """K of w walls, dense; walls beyond them are padding."""

    null: Floats  # (w, h) N
    root: Floats  # (w, h) G: K = G Gᵀ
    levers: Floats  # (2 N_c, w) L, f_n and f_t/μ
    inverse: Floats  # (w, rows) of the balance of relative slacks
    count: int  # type: ignore[assignment]  # number of walls, padding included

    def moved(self, g: Floats, pulls: Floats | None = None) -> Floats:
        """K (g + Lᵀ p), (k, count), of g (k, count) and p (2 N_c,) or (k, 2 N_c)."""
        push = g[:, : len(self.root)] + (0.0 if pulls is None else pulls @ self.levers)
        return self._padded(push @ self.root @ self.root.T)

    def rows(self, walls: Integers) -> Floats:
        """Rows (k, walls) of K for walls (k,).

        The rounding of products depends on the shapes of matrices: each row is computed with the
        same others.
        """
        rows = np.zeros((len(walls), self.count))
        for at, wall in enumerate(walls.tolist()):
            if wall >= len(self.root):  # padding
                continue
            first = wall - wall % LANES
            some = np.eye(min(LANES, len(self.root) - first), self.count, first)
            rows[at] = self.moved(some)[wall - first]
        return rows

    def on_hull(self, away: Floats) -> Floats:
        """The nearest point to `away` (k, count) that satisfies the balance."""
        return self._padded(away[:, : len(self.null)] @ self.null @ self.null.T)

    def _padded(self, slacks: Floats) -> Floats:
        return np.pad(slacks, ((0, 0), (0, self.count - slacks.shape[1])))


class Basis(NamedTuple):
    """The null space of a balance and the correction that restores it, before weighting by y."""

    free: Floats  # (w, h) orthonormal
    inverse: Floats  # (w, rows) the least change of y that removes an unbalance


def basis(balance: Floats, dimension: int) -> Basis:
    """The Basis of a balance (rows, w) that leaves this many dimensions."""
    left, values, right = cancelling.apart(np.linalg.svd, balance)
    rank = min(len(values), len(right) - dimension)
    inverse = (right[:rank].T / values[:rank]) @ left[:, :rank].T
    return Basis(right[len(right) - dimension :].T, inverse)


def thin_matrix(
    basis: Basis, y: Floats, levers: Floats, weight: sparse.csr_matrix, count: int
) -> ThinMatrix:
    """The ThinMatrix at y (w,), which may be as small as FLAT; weight (2 N_c, 2 N_c): W."""
    null = cancelling.apart(_orthonormal, basis.free / y[:, None])
    along = levers @ null
    H = np.eye(null.shape[1]) + np.asarray(along.T @ (weight @ along), dtype=np.float64)
    root = np.linalg.solve(np.linalg.cholesky(H), null.T).T
    return ThinMatrix(null, root, levers, basis.inverse / y[:, None], count)


def _orthonormal(columns: Floats) -> Floats:
    """Columns (w, h) of the same span, orthonormal, to rounding in every row separately.

    Householder's method is so stable with pivoting and rows in order of their size (Cox, Higham,
    in Numerical Analysis 1997, 57).
    """
    order = np.argsort(-np.abs(columns).max(axis=1, initial=0.0))
    basis = np.empty_like(columns)
    basis[order] = linalg.qr(columns[order], mode="economic", pivoting=True)[0]
    return basis


def null_space(dense: Floats, dimension: int) -> Floats:
    """Orthonormal (n, dimension) vectors that a matrix (rows, n) maps closest to zero."""
    _, _, rows = cancelling.apart(np.linalg.svd, dense)
    return rows[len(rows) - dimension :].T
