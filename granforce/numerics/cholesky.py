"""L Lᵀ = A K Aᵀ + δ for conductances K that are symmetric, and what follows from it.

Panel by panel: each column's diagonal block is factored, what is below is divided by it, and the
products are taken from later columns (see `blocks`).

One grain alone, with rows x, y and torque, shows what becomes of nine numbers:

    4 2 0        the root of the first pivot, 4, is 2, and what is below is divided by it: 1, 0;
    2 5 4        the second pivot has lost 1·1 by then: 5 − 1 = 4, its root is 2; below it
    0 4 5        (4 − 0·1)/2 = 2; the third, 5 − 0·0 − 2·2 = 1, is its own root.

So L = (2; 1 2; 0 2 1) by rows. The diagonal is kept inverted: ½, ½, 1. To solve for (6, 11, 9) is
to go down, 6·½ = 3, (11 − 1·3)·½ = 4, (9 − 0·3 − 2·4)·1 = 1, and up again: 1·1 = 1, (4 − 2·1)·½ =
1, (3 − 1·1 − 0·1)·½ = 1. The solution is (1, 1, 1).

Global rows s, of the pressure or the stress, meet every contact: eliminated first they would fill
everything. They come last, as a border. With B = L Lᵀ that of the grains and C the corner,

    (B s; sᵀ C) = (L 0; tᵀ R) (Lᵀ t; 0 Rᵀ),    t = L⁻¹ s,    R Rᵀ = C − tᵀ t,

so that the border is one more sweep (`sides` ← t) and R the factor of a matrix of three rows at
most (`corner`).
"""

import numpy as np

from granforce.numerics.blocks import (
    LOWER,
    NO_PIVOT,
    backward,
    divide,
    forward,
    less_product,
    subtract_column,
    subtract_panel,
)
from granforce.numerics.contact_matrix import Factors, Network
from granforce.numerics.lanes import compiled, fma, load, pick, root, store, within
from granforce.types import Integers, Mask

# What stands for a pivot that is none: its row gets no weight.
_NO_WEIGHT = 1e64


@compiled
def factor(network, least, factors, stop, lanes):
    """Cholesky factors of the matrix in place, and of the global rows' Schur complement.

    Rows with a pivot up to `least` (rows,) are left out; see `left_out`. Ends early, with the
    matrix half done, once stop[0] is raised.
    """
    layout, L, sides, corner = network.layout, factors.lower, factors.sides, factors.corner
    start, panel = layout.start, layout.panel
    m, rows = network.border.shape[1] // 2, 3 * (len(start) - 1)
    number = 0
    for p in range(len(panel) - 1):
        if stop[0]:
            return
        end = panel[p + 1]
        for k in range(panel[p], end):
            first, last = start[k] + 1, start[k + 1]
            _factor_diagonal(L, 9 * start[k], least, 3 * k, lanes)
            for a in range(first, last):
                divide(L, 9 * a, 9 * start[k], LOWER, lanes)
            for q in range(k + 1, end):
                a = start[k] + q - k
                subtract_column(L, 9 * start[q], L, 9 * a, last - a, L, 9 * a, lanes)
        # Now, while these columns are at hand: what is larger than the caches takes its time.
        for a in range(m):
            forward(layout, panel[p], end, L, LOWER, L, sides, rows * a, lanes)
        number = subtract_panel(layout, p, number, L, L, 0, L, lanes)
    for a in range(m):
        for b in range(a + 1):
            value = load(corner, m * a + b, lanes)
            value = less_product(value, sides, rows * a, sides, rows * b, rows, lanes)
            store(corner, m * a + b, lanes, value)
    _factor_corner(corner, m, lanes)


@within
def _pivot(value, least):
    """One over the root of a pivot."""
    return 1.0 / root(pick(value, least, value, _NO_WEIGHT))


@within
def _factor_diagonal(L, d, least, k, lanes):
    """Cholesky factor of the diagonal block of rows k to k + 2; its own diagonal is inverted."""
    r0 = _pivot(load(L, d, lanes), least[k])
    l10 = load(L, d + 3, lanes) * r0
    l20 = load(L, d + 6, lanes) * r0
    r1 = _pivot(fma(l10, -l10, load(L, d + 4, lanes)), least[k + 1])
    l21 = fma(l20, -l10, load(L, d + 7, lanes)) * r1
    p2 = fma(l21, -l21, fma(l20, -l20, load(L, d + 8, lanes)))
    store(L, d, lanes, r0)
    store(L, d + 3, lanes, l10)
    store(L, d + 4, lanes, r1)
    store(L, d + 6, lanes, l20)
    store(L, d + 7, lanes, l21)
    store(L, d + 8, lanes, _pivot(p2, least[k + 2]))


@within
def _factor_corner(corner, m, lanes):
    """Cholesky factor of the m × m corner in place, its diagonal inverted (0 without pivot)."""
    for a in range(m):
        for b in range(a):
            value = load(corner, m * a + b, lanes)
            value = less_product(value, corner, m * a, corner, m * b, b, lanes)
            store(corner, m * a + b, lanes, value * load(corner, m * b + b, lanes))
        value = load(corner, m * a + a, lanes)
        value = less_product(value, corner, m * a, corner, m * a, a, lanes)
        inverse = 1.0 / root(pick(value, NO_PIVOT, value, 1.0))
        store(corner, m * a + a, lanes, pick(value, NO_PIVOT, inverse, 0.0))


@within
def solve(network, factors, x, y, lanes):
    """x, y ← (L Lᵀ)⁻¹ (x, y) for factored L; x (rows, W), y (m, W) of the global rows."""
    layout = network.layout
    m, rows = network.border.shape[1] // 2, 3 * (len(layout.start) - 1)
    forward(layout, 0, rows // 3, factors.lower, LOWER, factors.lower, x, 0, lanes)
    sides, corner = factors.sides, factors.corner
    for a in range(m):
        value = less_product(load(y, a, lanes), sides, rows * a, x, 0, rows, lanes)
        value = less_product(value, corner, m * a, y, 0, a, lanes)
        store(y, a, lanes, value * load(corner, m * a + a, lanes))
    for a in range(m - 1, -1, -1):
        value = load(y, a, lanes)
        for b in range(a + 1, m):
            value = fma(-load(corner, m * b + a, lanes), load(y, b, lanes), value)
        value = value * load(corner, m * a + a, lanes)
        store(y, a, lanes, value)
        for k in range(rows):
            store(x, k, lanes, fma(-load(sides, rows * a + k, lanes), value, load(x, k, lanes)))
    backward(layout, factors.lower, LOWER, factors.lower, x, lanes)


def diagonals(network: Network) -> Integers:
    """Places (grains, 3) of the diagonal among the entries of the lower factor."""
    return 9 * network.layout.start[:-1, None] + np.array([0, 4, 8])


def left_out(network: Network, factors: Factors) -> Mask:
    """Mask (rows,) of the rows that the last factorisation of the first lane left out."""
    return (factors.lower[diagonals(network), 0] <= 1.01 / np.sqrt(_NO_WEIGHT)).ravel()
