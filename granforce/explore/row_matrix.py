"""K of a polytope where weights couple the contacts of a grain, as a measured pressure does.

With weights w on sums R f the stiffness M = Bᵀ B + W + Rᵀ w R is not that of single contacts (see
`wall_matrix`). If the pressures of the sums are unknowns, too, R joins the balance as rows that
give way by 1/w:

    Q q = C (q − Ãᵀ v),   (Ã C Ãᵀ + diag(0, 1/w)) v = Ã C q,   Ã = (A, R),

which is nearly as sparse as A C Aᵀ; SuperLU factors it.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from granforce.numerics.contact_program import balance_matrix
from granforce.numerics.highs import symmetric_factor
from granforce.numerics.wall_matrix import POLISH, WallMatrix
from granforce.system import cancelling
from granforce.types import Floats, Integers

# Added to the diagonal, relative to it, so that rows that follow from others keep a pivot.
_SHIFT = 1e-14


class RowMatrix(NamedTuple):
    """K in factored form; its methods are those of a WallMatrix."""

    walls: sparse.csr_matrix  # B (walls, 2 N_c), of f_n and f_t/μ
    C: sparse.csr_matrix  # (2 N_c, 2 N_c) conductances, with W
    unweighted: sparse.csr_matrix  # without W
    joined: sparse.csr_matrix  # Ã (rows, 2 N_c)
    balance: int  # rows of A in Ã
    solve: Any  # of the factor
    times: int = 1  # how often balance is restored

    @property
    def count(self) -> int:  # type: ignore[override]
        """Number of walls, including padding."""
        return self.walls.shape[0]

    def moved(
        self,
        g: Floats,
        pulls: Floats | None = None,
        times: int = 1,
        C: sparse.csr_matrix | None = None,
    ) -> Floats:
        """As `WallMatrix.moved`."""
        q = self.walls.T @ g.T
        if pulls is not None:
            q = q + (pulls[:, None] if pulls.ndim == 1 else pulls.T)
        f, give = (self.C if C is None else C) @ q, C is None
        for _ in range(times * self.times):
            right = self.joined @ f
            if not give:  # the balance alone is restored
                right[self.balance :] = 0.0
            f, give = f - self._forces(right), False
        return np.ascontiguousarray((self.walls @ f).T)

    def rows(self, walls: Integers) -> Floats:
        """Rows (k, walls) of K for walls (k,)."""
        g = np.zeros((len(walls), self.count))
        g[np.arange(len(walls)), walls] = 1.0
        return self.moved(g)

    def on_hull(self, away: Floats) -> Floats:
        """The nearest point to `away` (k, walls) that satisfies the balance."""
        return self.moved(away, None, POLISH, self.unweighted)

    def balancing(self, rest: Floats) -> Floats:
        """As `WallMatrix.balancing`."""
        right = np.pad(rest, (0, self.joined.shape[0] - len(rest)))[:, None]
        return (self.walls @ self._forces(right))[:, 0]

    def _forces(self, right: Floats) -> Floats:
        """C Ãᵀ v of right-hand sides (rows, k); one by one, as rounding depends on their number."""
        v = np.column_stack([self.solve(column) for column in right.T])
        return self.C @ (self.joined.T @ v)


def with_rows(
    matrix: WallMatrix, diagonal: Floats, rows: sparse.csr_matrix, w: Floats
) -> RowMatrix:
    """The RowMatrix of a WallMatrix with weights w (k,) > 0 on rows (k, 2 N_c) of f_n, f_t/μ.

    diagonal (rows of A,): as for `factored`.
    """
    wall = np.repeat(np.arange(matrix.count), 2)
    force = 2 * matrix.contact[:, None] + [0, 1]
    shape = matrix.count, 2 * len(matrix.C)
    walls = sparse.csr_matrix((matrix.normal.ravel(), (wall, force.ravel())), shape=shape)
    A, C = balance_matrix(matrix.network), _blocks(matrix.C)
    joined = sparse.vstack([A, rows], format="csr")
    square = joined @ C @ joined.T
    give = np.concatenate([diagonal, np.zeros(A.shape[0] - len(diagonal)), 1 / w])
    give += _SHIFT * square.diagonal()
    # Where no force of a global row can change, anything keeps it.
    square = square + sparse.diags(np.where(square.diagonal() + give > 0, give, 1.0))
    solve = cancelling.apart(symmetric_factor, square).solve
    return RowMatrix(walls, C, _blocks(matrix.unweighted), joined, A.shape[0], solve)


def _blocks(C: Floats) -> sparse.csr_matrix:
    """Conductances (N_c, 3) nn, nt, tt as a matrix (2 N_c, 2 N_c)."""
    blocks, count = C[:, [0, 1, 1, 2]].reshape(-1, 2, 2), len(C)
    return sparse.csr_matrix(
        sparse.bsr_matrix((blocks, np.arange(count), np.arange(count + 1)), (2 * count, 2 * count))
    )
