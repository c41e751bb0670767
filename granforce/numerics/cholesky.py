"""L Lᵀ = A K Aᵀ + δ for symmetric conductances K: factors, solutions and left-out rows.

Panel by panel: each column's diagonal block is factored, the blocks below are divided by it, and
their products are subtracted from later columns (see `blocks`).

For one grain, with rows x, y and torque, the nine numbers become:

    4 2 0        the root of the first pivot, 4, is 2; the numbers below are divided by it: 1, 0;
    2 5 4        the second pivot has become 5 − 1·1 = 4, with root 2; below it is
    0 4 5        (4 − 0·1)/2 = 2; the third pivot is 5 − 0·0 − 2·2 = 1, with root 1.

So L = (2; 1 2; 0 2 1) by rows. Its diagonal is stored inverted: ½, ½, 1. To solve for (6, 11, 9),
sweep down: 6·½ = 3, (11 − 1·3)·½ = 4, (9 − 0·3 − 2·4)·1 = 1, and up: 1·1 = 1, (4 − 2·1)·½ = 1, (3 −
1·1 − 0·1)·½ = 1. The solution is (1, 1, 1).

The global rows s, of the pressure or the stress, meet every contact; eliminated first they would
fill the matrix. They come last, as a border. With B = L Lᵀ for the grains and C the corner,

    (B s; sᵀ C) = (L 0; tᵀ R) (Lᵀ t; 0 Rᵀ),    t = L⁻¹ s,    R Rᵀ = C − tᵀ t,

so that the border needs one more sweep (`sides` ← t) and R is the factor of a matrix with at most
three rows (`corner`).
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

# Replaces a missing pivot: its row gets no weight.
_NO_WEIGHT = 1e64


@compiled
def factor(network, least, factors, stop, lanes):
    """Factor the matrix in place by Cholesky, and the Schur complement of the global rows.

    Rows with a pivot up to `least` (rows,) are left out; see `left_out`. Returns early, with the
    matrix half factored, once stop[0] is set.
    """
    layout, L, sides, corner = network.layout, factors.lower, factors.sides, factors.corner
    # start[k] is the first block of column k, panel[p] the first column of panel p, and `number`
    # counts the pairs of blocks that earlier panels have subtracted.
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
        # Now, while these columns are in the cache: for large matrices memory traffic dominates.
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
    """One over the square root of a pivot."""
    return 1.0 / root(pick(value, least, value, _NO_WEIGHT))


@within
def _factor_diagonal(L, d, least, k, lanes):
    """Cholesky factor of the diagonal block of rows k to k + 2, with its diagonal inverted."""
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
    """x, y ← (L Lᵀ)⁻¹ (x, y) with the factor L; x (rows, W), y (m, W) for the global rows."""
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
    """Places (grains, 3) of the diagonal entries in the lower factor."""
    return 9 * network.layout.start[:-1, None] + np.array([0, 4, 8])


def left_out(network: Network, factors: Factors) -> Mask:
    """Mask (rows,) of the rows left out by the last factorisation of the first lane."""
    return (factors.lower[diagonals(network), 0] <= 1.01 / np.sqrt(_NO_WEIGHT)).ravel()
