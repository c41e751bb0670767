"""L U = A K Aᵀ + δ for unsymmetric conductances K, without pivoting.

As in `cholesky`, but with two factors: L has a unit diagonal and U is stored transposed, so that
both are columns of blocks, updated by products x yᵀ of a block x of one and y of the other (see
`blocks`). Diagonal blocks hold both triangles.

For one grain, with rows x, y and torque:

    2 1 0        the first row is that of U; the numbers below are divided by its pivot: 4/2 = 2, 0;
    4 5 2        the second row becomes 5 − 2·1 = 3, 2 − 2·0 = 2, and below its pivot (3 − 0·1)/3
    0 3 4        = 1; the third row becomes 4 − 0·0 − 1·2 = 2.

So L = (1; 2 1; 0 1 1) and U = (2 1 0; 3 2; 2) by rows, stored as (½ 1 0; 2 ⅓ 2; 0 1 ½). To solve
for (3, 11, 7), sweep down: 3, 11 − 2·3 = 5, 7 − 0·3 − 1·5 = 2, and up: 2·½ = 1, (5 − 2·1)·⅓ = 1, (3
− 1·1 − 0·1)·½ = 1. The solution is (1, 1, 1).

Global rows s and columns t come last as a border, `sides` ← U⁻ᵀ s and `tops` ← L⁻¹ t, and the
corner becomes C minus their products.
"""

from granforce.numerics.blocks import (
    NO_PIVOT,
    UPPER,
    backward,
    divide,
    forward,
    less_product,
    spread,
    subtract_column,
    subtract_panel,
)
from granforce.numerics.lanes import fma, load, pick, size, store, within


@within
def factor(network, factors, stop, lanes):
    """L U of an unsymmetric matrix, in place, without pivoting.

    The diagonal must keep the pivots nonzero; the caller must check the solution. L has a unit
    diagonal; U is stored transposed, its diagonal blocks with those of L, and the pivots inverted.
    """
    layout, L, U = network.layout, factors.lower, factors.upper
    start, panel = layout.start, layout.panel
    number = 0
    for p in range(len(panel) - 1):
        if stop[0]:
            return
        end = panel[p + 1]
        for k in range(panel[p], end):
            first, last, d = start[k] + 1, start[k + 1], 9 * start[k]
            _factor_skew_diagonal(L, d, lanes)
            for a in range(first, last):
                divide(L, 9 * a, d, UPPER, lanes)
                _divide_by_unit(U, 9 * a, L, d, lanes)
            for q in range(k + 1, end):
                a, z = start[k] + q - k, 9 * start[q]
                subtract_column(L, z, L, 9 * a, last - a, U, 9 * a, lanes)
                subtract_column(U, z + 9, U, 9 * a + 9, last - a - 1, L, 9 * a, lanes)
        subtract_panel(layout, p, number, U, U, 1, L, lanes)
        number = subtract_panel(layout, p, number, L, L, 0, U, lanes)
    m, rows = network.border.shape[1] // 2, 3 * (len(start) - 1)
    corner = factors.corner
    for a in range(m):
        _forward_unit(layout, L, factors.tops, rows * a, lanes)
        forward(layout, 0, rows // 3, L, UPPER, U, factors.sides, rows * a, lanes)
    for a in range(m):
        for b in range(m):
            value = less_product(
                load(corner, m * a + b, lanes),
                factors.sides,
                rows * a,
                factors.tops,
                rows * b,
                rows,
                lanes,
            )
            store(corner, m * a + b, lanes, value)
    for k in range(m):
        store(corner, m * k + k, lanes, _inverse(load(corner, m * k + k, lanes)))
        for a in range(k + 1, m):
            ratio = load(corner, m * a + k, lanes) * load(corner, m * k + k, lanes)
            store(corner, m * a + k, lanes, ratio)
            for b in range(k + 1, m):
                value = fma(-ratio, load(corner, m * k + b, lanes), load(corner, m * a + b, lanes))
                store(corner, m * a + b, lanes, value)


@within
def _factor_skew_diagonal(L, d, lanes):
    """Unit L below and U above the diagonal of a diagonal block, in place, pivots inverted."""
    for k in range(3):
        inverse = _inverse(load(L, d + 4 * k, lanes))
        store(L, d + 4 * k, lanes, inverse)
        for a in range(k + 1, 3):
            ratio = load(L, d + 3 * a + k, lanes) * inverse
            store(L, d + 3 * a + k, lanes, ratio)
            for b in range(k + 1, 3):
                value = fma(-ratio, load(L, d + 3 * k + b, lanes), load(L, d + 3 * a + b, lanes))
                store(L, d + 3 * a + b, lanes, value)


@within
def _divide_by_unit(U, x, L, d, lanes):
    """x ← x L⁻ᵀ for a block x of U and the unit lower triangle of the diagonal block d."""
    for a in range(x, x + 9, 3):
        x0 = load(U, a, lanes)
        x1 = fma(-x0, load(L, d + 3, lanes), load(U, a + 1, lanes))
        x2 = fma(-x0, load(L, d + 6, lanes), load(U, a + 2, lanes))
        store(U, a + 1, lanes, x1)
        store(U, a + 2, lanes, fma(-x1, load(L, d + 7, lanes), x2))


@within
def _inverse(pivot):
    """One over a pivot of either sign; 0 for a missing pivot."""
    safe = pick(size(pivot), NO_PIVOT, pivot, 1.0)
    return pick(size(pivot), NO_PIVOT, 1.0 / safe, 0.0)


@within
def _forward_unit(layout, L, x, first, lanes):
    """x ← L⁻¹ x for unit L."""
    for k in range(len(layout.start) - 1):
        d, v = 9 * layout.start[k], first + 3 * k
        v0 = load(x, v, lanes)
        v1 = fma(-load(L, d + 3, lanes), v0, load(x, v + 1, lanes))
        v2 = fma(-load(L, d + 6, lanes), v0, load(x, v + 2, lanes))
        v2 = fma(-load(L, d + 7, lanes), v1, v2)
        spread(layout, k, L, v0, v1, v2, x, first, lanes)


@within
def solve(network, factors, x, y, lanes):
    """x, y ← (L U)⁻¹ (x, y); shapes as in `cholesky.solve`."""
    layout, corner = network.layout, factors.corner
    m, rows = network.border.shape[1] // 2, 3 * (len(layout.start) - 1)
    _forward_unit(layout, factors.lower, x, 0, lanes)
    for a in range(m):
        value = less_product(load(y, a, lanes), factors.sides, rows * a, x, 0, rows, lanes)
        store(y, a, lanes, less_product(value, corner, m * a, y, 0, a, lanes))
    for a in range(m - 1, -1, -1):
        rest = m - a - 1
        value = less_product(load(y, a, lanes), corner, m * a + a + 1, y, a + 1, rest, lanes)
        value = value * load(corner, m * a + a, lanes)
        store(y, a, lanes, value)
        for k in range(rows):
            top = load(factors.tops, rows * a + k, lanes)
            store(x, k, lanes, fma(-top, value, load(x, k, lanes)))
    backward(layout, factors.lower, UPPER, factors.upper, x, lanes)
