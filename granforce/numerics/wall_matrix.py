"""How a push at one wall of a polytope changes the speed at which all others are approached.

In {f : A f = b, f_c in a polygon of its own for every contact c} the slack of a wall, relative to
that at a centre f°, is s = 1 + B (f − f°), where each row of B is one wall of one contact. With a
stiffness M = Bᵀ B + W of each contact (the barrier's at the centre, and any added stiffness W) and
its inverse, the conductance C, forces that keep the balance move by

    Q = C − C Aᵀ (A C Aᵀ)⁻¹ A C,

and slacks by the matrix K = B Q Bᵀ. If W = 0, K is the projection I − D Ãᵀ (Ã D² Ãᵀ)⁻¹ Ã D onto the
feasible changes of all slacks, in slacks y = D s with Ã y = b̃. It needs no basis, only the sparse
factor of A C Aᵀ (`cholesky`). One factor serves eight right-hand sides in lanes.
"""

from typing import Any, NamedTuple

import numpy as np

from granforce.numerics import cholesky, contact_matrix
from granforce.numerics.blocks import NO_PIVOT
from granforce.numerics.contact_matrix import Factors, Network, clear, pull, push
from granforce.numerics.contact_program import PINNED
from granforce.numerics.lanes import (
    LANES,
    MANY,
    ONE,
    compiled,
    fma,
    load,
    room,
    shared,
    store,
    within,
)
from granforce.system import cancelling
from granforce.types import Floats, Integers, Mask

# Rows whose pivot is below this, relative to the diagonal, follow from others.
DEPENDENT = 1e-13
# Number of random forces that show which slacks vary in S.
PROBES = 8
# Factor on the number of balance restorations where only rounding may remain.
POLISH = 3
# Most restorations of the balance; they end once the slacks of random forces change by less than
# _STEADY relative to the largest. Usually the first leaves 10⁻⁹ or less, otherwise 10⁻⁵ and more.
_MOST_TIMES, _STEADY = 12, 1e-7


class WallMatrix(NamedTuple):
    """K in factored form; walls are padded with walls that no force reaches."""

    network: Network  # A, for forces (f_n, f_t/μ)
    contact: Integers  # (walls,) contact of each wall
    normal: Floats  # (walls, 2) B: change of its slack per unit f_n, f_t/μ
    C: Floats  # (N_c, 3) nn, nt, tt of each conductance
    unweighted: Floats  # (N_c, 3) the same without W, which gives f − f° from the slacks
    factors: Factors  # of A C Aᵀ, one number for all lanes
    times: int = 1  # how often balance is restored

    @property
    def count(self) -> int:  # type: ignore[override]
        """Number of walls, including padding."""
        return len(self.contact)

    def moved(
        self, g: Floats, pulls: Floats | None = None, times: int = 1, C: Floats | None = None
    ) -> Floats:
        """B Q (Bᵀ g + p), (k, walls), of g (k, walls) and p (2 N_c,) or (k, 2 N_c).

        times: multiplies the number of balance restorations; with one, the remaining unbalance is
        that of rounding and of the weights. C (N_c, 3): conductances to use instead of the matrix's
        own.
        """
        moved = np.empty_like(g)
        for first in range(0, len(g), LANES):
            part = slice(first, first + LANES)
            count = len(g[part])
            lanes = ONE if count == 1 else MANY
            at = make_scratch(self, len(lanes))
            at.g[:, :count] = g[part].T
            if pulls is not None:
                at.f[:, :count] = pulls[:, None] if pulls.ndim == 1 else pulls[part].T
            _move(self, self.C if C is None else C, times * self.times, at, lanes)
            moved[part] = at.out[:, :count].T
        return moved

    def rows(self, walls: Integers) -> Floats:
        """Rows (k, walls) of K for walls (k,)."""
        g = np.zeros((len(walls), len(self.contact)))
        g[np.arange(len(walls)), walls] = 1.0
        return self.moved(g)

    def on_hull(self, away: Floats) -> Floats:
        """The nearest point to `away` (k, walls) that satisfies the balance."""
        return self.moved(away, None, POLISH, self.unweighted)

    def balancing(self, rest: Floats) -> Floats:
        """The change of slacks (walls,) by the forces of least weight that remove an unbalance.

        rest: of the rows of the network, then of the global ones.
        """
        at = make_scratch(self, 1)
        at.x[:, 0], at.y[:, 0] = np.split(rest, [len(at.x)])
        _balance(self, at, ONE)
        return at.out[:, 0].copy()


class Scratch(NamedTuple):
    """Storage for W right-hand sides."""

    f: Floats  # (2 N_c, W) forces
    x: Floats  # (rows, W)
    y: Floats  # (m, W)
    g: Floats  # (walls, W)
    out: Floats  # (walls, W)


def conductances(d: Floats, k: Floats) -> tuple[Floats, Floats, Integers]:
    """(C (N_c, 3), ln det M (N_c,) on the free components, free (N_c,)) of contacts.

    M is given as in `contact_program`: d (N_c, 2) along y₁, y₂ = f_n ± f_t/μ and k (N_c, 2) along
    f_n, f_t/μ, each PINNED if fixed; free: number of free dimensions.
    """
    (d0, d1), (k_n, k_t) = d.T, k.T
    det = 0.25 * (k_n + k_t) * (d0 + d1) + d0 * d1 + 0.25 * k_n * k_t
    C = np.stack([d0 + d1 + k_t, d1 - d0, d0 + d1 + k_n], axis=1) * (0.25 / det)[:, None]
    held = np.sum(d >= PINNED, axis=1) + np.sum(k >= PINNED, axis=1)
    free = np.maximum(0, 2 - held)
    C[free == 0] = 0.0
    one = np.where(free == 1, C[:, 0] + C[:, 2], 1.0)
    return C, np.where(free == 2, np.log(4 * det), -np.log(one)), free


def factored(network: Network, C: Floats, diagonal: Floats, least: float) -> tuple[Factors, Mask]:
    """(Factors of A C Aᵀ + diag(diagonal), mask (rows,) of rows without a pivot above `least`).

    least: relative to the diagonal of A C Aᵀ.
    """
    factors = contact_matrix.make_factors(network, 1)
    _begin(network, C, diagonal, factors, ONE)
    bound = least * factors.lower[cholesky.diagonals(network), 0].ravel()
    bound = np.maximum(bound, NO_PIVOT)
    m = network.border.shape[1] // 2
    weight = np.diag(factors.corner.reshape(m, m)).copy()
    cholesky.factor(network, bound, factors, cancelling.flag(), ONE)
    cancelling.check()
    _without_dependent(factors.corner.reshape(m, m), weight)
    out = cholesky.left_out(network, factors)
    return Factors(*(shared(part) for part in factors)), out


def _without_dependent(corner: Floats, weight: Floats) -> None:
    """Remove, in place, global rows whose pivot is only rounding of their weight (m,) in A C Aᵀ.

    Known forces may imply the pressure.
    """
    inverse = np.diag(corner)
    kept = inverse > 0
    pivot = np.where(kept, 1 / np.where(kept, inverse, 1.0), 0.0)
    if np.all(pivot[kept] ** 2 > DEPENDENT * weight[kept]):
        return
    factor = np.tril(corner, -1) + np.diag(pivot)
    rest = factor @ factor.T
    for a in range(len(corner)):
        independent = rest[a, a] > DEPENDENT * weight[a]
        column = rest[a:, a] / np.sqrt(rest[a, a]) if independent else np.zeros(len(corner) - a)
        rest[a:, a:] -= np.outer(column, column)
        corner[a:, a] = column
        corner[a, a] = 1 / column[0] if independent else 0.0


def global_rows(network: Network, factors: Factors) -> int:
    """Number of global rows that do not follow from others."""
    return int(np.sum(factors.corner[:: network.border.shape[1] // 2 + 1] > 0))


def log_determinant(network: Network, factors: Factors) -> float:
    """ln det A C Aᵀ from its factors, without rows that lack a pivot."""
    m = network.border.shape[1] // 2
    diagonal = factors.lower[cholesky.diagonals(network)].ravel()
    corner = factors.corner[:: m + 1].ravel() if m else np.zeros(0)
    pivots = np.concatenate([diagonal[diagonal > 1e-30], corner[corner > 0]])
    return -2 * np.log(pivots).sum()


def restored(matrix: Any) -> Any:
    """The WallMatrix, or RowMatrix, with enough balance restorations that one more changes nothing.

    If rows of A nearly follow from others, as those of the stress do at μ < 10⁻⁵, each restoration
    removes only part of the unbalance; otherwise one is enough.
    """
    g = np.random.default_rng(0).standard_normal((PROBES, matrix.count))
    before = matrix.moved(g)
    for times in range(1, _MOST_TIMES):
        after = matrix.moved(g, None, times + 1)
        if np.abs(after - before).max(initial=0.0) <= _STEADY * np.abs(after).max(initial=0.0):
            return matrix._replace(times=times)
        before = after
    return matrix._replace(times=_MOST_TIMES)


def make_scratch(matrix: WallMatrix, width: int) -> Scratch:
    """Scratch for `width` right-hand sides, all zero."""
    grains, m = len(matrix.network.layout.position), matrix.network.border.shape[1] // 2
    walls = len(matrix.contact)
    return Scratch(
        f=room(2 * len(matrix.C), width),
        x=room(3 * grains, width),
        y=room(m, width),
        g=room(walls, width),
        out=room(walls, width),
    )


@compiled
def _begin(network, C, diagonal, factors, lanes):
    contact_matrix.begin(network, diagonal, factors, lanes)
    for c in range(len(C)):
        contact_matrix.add(network, c, C[c, 0], C[c, 1], C[c, 2], factors, lanes)


@compiled
def _move(matrix, C, times, at, lanes):
    """out ← B Q (f + Bᵀ g)."""
    f = at.f
    for k in range(len(matrix.contact)):
        c, g = 2 * matrix.contact[k], load(at.g, k, lanes)
        store(f, c, lanes, fma(matrix.normal[k, 0], g, load(f, c, lanes)))
        store(f, c + 1, lanes, fma(matrix.normal[k, 1], g, load(f, c + 1, lanes)))
    for c in range(len(C)):
        normal, tangential = _through(C, c, load(f, 2 * c, lanes), load(f, 2 * c + 1, lanes))
        store(f, 2 * c, lanes, normal)
        store(f, 2 * c + 1, lanes, tangential)
    for _ in range(times):
        clear(at.x, lanes)
        clear(at.y, lanes)
        for c in range(len(C)):
            normal, tangential = -load(f, 2 * c, lanes), -load(f, 2 * c + 1, lanes)
            push(matrix.network, c, normal, tangential, at.x, at.y, lanes)
        _answer(matrix, at, lanes)
    _slacks(matrix, at, lanes)


@compiled
def _balance(matrix, at, lanes):
    _answer(matrix, at, lanes)
    _slacks(matrix, at, lanes)


@within
def _answer(matrix, at, lanes):
    """f ← f + C Aᵀ (A C Aᵀ)⁻¹ (x, y)."""
    cholesky.solve(matrix.network, matrix.factors, at.x, at.y, lanes)
    for c in range(len(matrix.C)):
        normal, tangential = pull(matrix.network, c, at.x, at.y, lanes)
        normal, tangential = _through(matrix.C, c, normal, tangential)
        store(at.f, 2 * c, lanes, load(at.f, 2 * c, lanes) + normal)
        store(at.f, 2 * c + 1, lanes, load(at.f, 2 * c + 1, lanes) + tangential)


@within
def _slacks(matrix, at, lanes):
    """out ← B f."""
    for k in range(len(matrix.contact)):
        c = 2 * matrix.contact[k]
        value = matrix.normal[k, 0] * load(at.f, c, lanes)
        store(at.out, k, lanes, fma(matrix.normal[k, 1], load(at.f, c + 1, lanes), value))


@within
def _through(C, c, normal, tangential):
    """C times the forces of a contact."""
    nn, nt, tt = C[c]
    return fma(nn, normal, nt * tangential), fma(nt, normal, tt * tangential)
