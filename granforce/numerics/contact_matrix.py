"""Sparse factors of A K Aᵀ + δ, the stiffness of a contact network, in 3×3 blocks.

Each contact couples the three degrees of freedom of its two grains by a conductance K, symmetric
2×2 or not; up to three global rows (pressure, or stress) meet every contact and are kept as a
border, eliminated last. `factor` gives L Lᵀ, `factor_lu` L U for K that is not symmetric. Kernels
work on one matrix or on LANES of them side by side (see `lanes`); matrices never mix.

A is given by `columns` (N_c, 12): what unit f_n (first six numbers) and unit f_t do to the rows of
the grain that is eliminated later (three) and earlier (three), and `border` (N_c, 2 m): what they
do to the m global rows.
"""

from typing import NamedTuple

import numpy as np

from granforce.numerics.elimination import Pattern, block_of, pattern
from granforce.numerics.lanes import (
    compiled,
    fma,
    inline,
    load,
    pick,
    room,
    root,
    same,
    size,
    store,
    within,
)
from granforce.records import Floats, Integers, Mask

# A pivot that rounding has driven to zero or below belongs to a direction without weight.
NO_PIVOT, _NO_WEIGHT = 1e-40, 1e64
# Where a 3×3 block has the numbers 10, 20, 21 of a lower triangle, and of an upper one transposed.
_LOWER, _UPPER = (3, 6, 7), (1, 2, 5)


class Network(NamedTuple):
    """A, and where its products go."""

    layout: Pattern
    high: Integers  # (N_c,) place of the grain that is eliminated later
    low: Integers  # (N_c,) of the other one
    block: Integers  # (N_c,) block that couples them
    columns: Floats  # (N_c, 12)
    border: Floats  # (N_c, 2 m)


class Factors(NamedTuple):
    """Memory of one factorisation; W is 1 or LANES."""

    lower: Floats  # (blocks · 9, W)
    upper: Floats  # (blocks · 9, W) transposed; no room where the matrix is symmetric
    sides: Floats  # (m · rows, W) L⁻¹ of the global rows
    tops: Floats  # (m · rows, W) the same of the global columns; no room where symmetric
    corner: Floats  # (m · m, W) factors of the global rows' Schur complement


def make_network(
    x: Floats, i: Integers, j: Integers, first: Floats, second: Floats, border: Floats
) -> Network:
    """The Network of grains at x (M, 2) in contact i, j (N_c,).

    first, second (N_c, 3, 2): what unit f_n, f_t do to the rows of grains i and j; border
    (N_c, m, 2): to the global rows.
    """
    layout = pattern(x, i, j)
    at_i, at_j = layout.position[i], layout.position[j]
    later = (at_i > at_j)[:, None, None]
    columns = np.concatenate(
        [np.where(later, first, second), np.where(later, second, first)], axis=1
    )
    high, low = np.maximum(at_i, at_j), np.minimum(at_i, at_j)
    return Network(
        layout,
        high,
        low,
        block_of(layout, high, low),
        np.ascontiguousarray(columns.transpose(0, 2, 1)).reshape(len(high), 12),
        np.ascontiguousarray(border.transpose(0, 2, 1)).reshape(len(high), -1),
    )


def make_factors(network: Network, width: int, symmetric: bool = True) -> Factors:
    """Room for the factors of `width` matrices side by side."""
    blocks, rows = len(network.layout.row), 3 * len(network.layout.position)
    m = network.border.shape[1] // 2
    other = 0 if symmetric else 1
    return Factors(
        *(room(count, width) for count in (9 * blocks, 9 * blocks * other)),
        *(room(count, width) for count in (m * rows, m * rows * other, m * m)),
    )


@inline
def pull(network, c, x, y, lanes):
    """(Aᵀ x)_n and (Aᵀ x)_t of contact c; x (rows, W), and y (m, W) of the global rows."""
    normal = tangential = same(lanes, 0.0)
    for first, grain in ((0, network.high[c]), (3, network.low[c])):
        e = _columns_of(network, c, first, lanes)
        x0, x1 = load(x, 3 * grain, lanes), load(x, 3 * grain + 1, lanes)
        x2 = load(x, 3 * grain + 2, lanes)
        normal = fma(e[0], x0, fma(e[1], x1, fma(e[2], x2, normal)))
        tangential = fma(e[3], x0, fma(e[4], x1, fma(e[5], x2, tangential)))
    g = network.border[c]
    m = len(g) // 2
    for a in range(m):
        value = load(y, a, lanes)
        normal = fma(same(lanes, g[a]), value, normal)
        tangential = fma(same(lanes, g[m + a]), value, tangential)
    return normal, tangential


@inline
def push(network, c, normal, tangential, x, y, lanes):
    """x, y ← x, y + A f for the forces f of contact c; shapes as for `pull`."""
    for first, grain in ((0, network.high[c]), (3, network.low[c])):
        e = _columns_of(network, c, first, lanes)
        x0 = fma(e[0], normal, fma(e[3], tangential, load(x, 3 * grain, lanes)))
        x1 = fma(e[1], normal, fma(e[4], tangential, load(x, 3 * grain + 1, lanes)))
        x2 = fma(e[2], normal, fma(e[5], tangential, load(x, 3 * grain + 2, lanes)))
        store(x, 3 * grain, lanes, x0)
        store(x, 3 * grain + 1, lanes, x1)
        store(x, 3 * grain + 2, lanes, x2)
    g = network.border[c]
    m = len(g) // 2
    for a in range(m):
        value = fma(same(lanes, g[m + a]), tangential, load(y, a, lanes))
        store(y, a, lanes, fma(same(lanes, g[a]), normal, value))


@within
def clear(values, lanes):
    """values ← 0, number by number: arrays set to slices take numba half a second to compile."""
    for k in range(len(values)):
        store(values, k, lanes, same(lanes, 0.0))


@within
def copy(values, given, lanes):
    """values ← given, likewise."""
    for k in range(len(values)):
        store(values, k, lanes, load(given, k, lanes))


@within
def begin(network, diagonal, factors, lanes):
    """Set the matrix to diag(diagonal (rows,)), without global rows."""
    start = network.layout.start
    clear(factors.lower, lanes)
    clear(factors.sides, lanes)
    clear(factors.corner, lanes)
    clear(factors.upper, lanes)
    clear(factors.tops, lanes)
    for k in range(len(start) - 1):
        for a in range(3):
            store(factors.lower, 9 * start[k] + 4 * a, lanes, same(lanes, diagonal[3 * k + a]))


@inline
def add(network, c, nn, nt, tt, factors, lanes):
    """Add contact c with the symmetric conductance K = [nn nt; nt tt] to the matrix."""
    _add_diagonal(network, c, nn, nt, nt, tt, factors, lanes)
    _add_between(network, c, nn, nt, nt, tt, factors.lower, factors.sides, lanes)


@inline
def add_skew(network, c, nn, nt, tn, tt, factors, lanes):
    """Add contact c with the conductance K = [nn nt; tn tt] to a matrix that is not symmetric."""
    _add_diagonal(network, c, nn, nt, tn, tt, factors, lanes)
    _add_between(network, c, nn, nt, tn, tt, factors.lower, factors.sides, lanes)
    _add_between(network, c, nn, tn, nt, tt, factors.upper, factors.tops, lanes)


@inline
def _add_diagonal(network, c, nn, nt, tn, tt, factors, lanes):
    """E K Eᵀ to the blocks of both grains and to the corner."""
    start = network.layout.start
    for first, grain in ((0, network.high[c]), (3, network.low[c])):
        e = _columns_of(network, c, first, lanes)
        _add_block(factors.lower, 9 * start[grain], e, _times(nn, nt, tn, tt, e), lanes)
    g = network.border[c]
    m = len(g) // 2
    for b in range(m):
        by_n, by_t = _through(nn, nt, tn, tt, same(lanes, g[b]), same(lanes, g[m + b]))
        for a in range(m):
            _add_to(factors.corner, m * a + b, g[a], by_n, g[m + a], by_t, lanes)


@inline
def _add_between(network, c, nn, nt, tn, tt, blocks, sides, lanes):
    """E K Eᵀ to the block of the later by the earlier grain, and of global rows by both."""
    high, low = _columns_of(network, c, 0, lanes), _columns_of(network, c, 3, lanes)
    by_low = _times(nn, nt, tn, tt, low)
    _add_block(blocks, 9 * network.block[c], high, by_low, lanes)
    g, grains = network.border[c], len(network.layout.start) - 1
    m = len(g) // 2
    if m:
        by_high = _times(nn, nt, tn, tt, high)
        for a in range(m):
            _add_row(sides, 3 * (a * grains + network.low[c]), g[a], g[m + a], by_low, lanes)
            _add_row(sides, 3 * (a * grains + network.high[c]), g[a], g[m + a], by_high, lanes)


@within
def _columns_of(network, c, first, lanes):
    """What unit f_n, then unit f_t do to the three rows of a contact's later or earlier grain."""
    e = network.columns[c]
    return (
        *(same(lanes, e[first]), same(lanes, e[first + 1]), same(lanes, e[first + 2])),
        *(same(lanes, e[first + 6]), same(lanes, e[first + 7]), same(lanes, e[first + 8])),
    )


@within
def _through(nn, nt, tn, tt, normal, tangential):
    """K times a vector."""
    return fma(nn, normal, nt * tangential), fma(tn, normal, tt * tangential)


@within
def _times(nn, nt, tn, tt, e):
    """K times the three columns e, normal parts first."""
    n0, t0 = _through(nn, nt, tn, tt, e[0], e[3])
    n1, t1 = _through(nn, nt, tn, tt, e[1], e[4])
    n2, t2 = _through(nn, nt, tn, tt, e[2], e[5])
    return n0, n1, n2, t0, t1, t2


@within
def _add_block(blocks, place, e, by, lanes):
    """Add e byᵀ to a block."""
    _add_three(blocks, place, e[0], e[3], by, lanes)
    _add_three(blocks, place + 3, e[1], e[4], by, lanes)
    _add_three(blocks, place + 6, e[2], e[5], by, lanes)


@within
def _add_row(sides, place, e_n, e_t, by, lanes):
    """Add a global row's three entries."""
    _add_three(sides, place, same(lanes, e_n), same(lanes, e_t), by, lanes)


@within
def _add_three(values, place, e_n, e_t, by, lanes):
    first = fma(e_t, by[3], fma(e_n, by[0], load(values, place, lanes)))
    second = fma(e_t, by[4], fma(e_n, by[1], load(values, place + 1, lanes)))
    third = fma(e_t, by[5], fma(e_n, by[2], load(values, place + 2, lanes)))
    store(values, place, lanes, first)
    store(values, place + 1, lanes, second)
    store(values, place + 2, lanes, third)


@within
def add_one(network, c, K, factors, lane):
    """Add a normal conductance K of contact c to the matrix of one lane."""
    e, g, start = network.columns[c], network.border[c], network.layout.start
    at_high, at_low = 9 * start[network.high[c]], 9 * start[network.low[c]]
    between, m, grains = 9 * network.block[c], len(g) // 2, len(start) - 1
    for a in range(3):
        for b in range(3):
            factors.lower[at_high + 3 * a + b, lane] += K * e[a] * e[b]
            factors.lower[at_low + 3 * a + b, lane] += K * e[3 + a] * e[3 + b]
            factors.lower[between + 3 * a + b, lane] += K * e[a] * e[3 + b]
        for b in range(m):
            factors.sides[3 * (b * grains + network.high[c]) + a, lane] += K * g[b] * e[a]
            factors.sides[3 * (b * grains + network.low[c]) + a, lane] += K * g[b] * e[3 + a]
    for a in range(m):
        for b in range(m):
            factors.corner[m * a + b, lane] += K * g[a] * g[b]


@within
def _add_to(values, place, e_n, by_n, e_t, by_t, lanes):
    value = fma(same(lanes, e_n), by_n, load(values, place, lanes))
    store(values, place, lanes, fma(same(lanes, e_t), by_t, value))


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
                _divide(L, 9 * a, 9 * start[k], _LOWER, lanes)
            for q in range(k + 1, end):
                a = start[k] + q - k
                _subtract_column(L, 9 * start[q], L, 9 * a, last - a, L, 9 * a, lanes)
        # Now, while these columns are at hand: what is larger than the caches takes its time.
        for a in range(m):
            _forward(layout, panel[p], end, L, _LOWER, L, sides, rows * a, lanes)
        number = _subtract_panel(layout, p, number, L, L, 0, L, lanes)
    for a in range(m):
        for b in range(a + 1):
            value = load(corner, m * a + b, lanes)
            value = _less_product(value, sides, rows * a, sides, rows * b, rows, lanes)
            store(corner, m * a + b, lanes, value)
    _factor_corner(corner, m, lanes)


def diagonals(network: Network) -> Integers:
    """Places (grains, 3) of the diagonal among the entries of the lower factor."""
    return 9 * network.layout.start[:-1, None] + np.array([0, 4, 8])


def left_out(network: Network, factors: Factors) -> Mask:
    """Mask (rows,) of the rows that the last factorisation of the first lane left out."""
    return (factors.lower[diagonals(network), 0] <= 1.01 / np.sqrt(_NO_WEIGHT)).ravel()


@within
def _pivot(value, least, lanes):
    """One over the root of a pivot."""
    value = pick(value, same(lanes, least), value, same(lanes, _NO_WEIGHT))
    return same(lanes, 1.0) / root(value)


@within
def _factor_diagonal(L, d, least, k, lanes):
    """Cholesky factor of the diagonal block of rows k to k + 2; its own diagonal is inverted."""
    r0 = _pivot(load(L, d, lanes), least[k], lanes)
    l10 = load(L, d + 3, lanes) * r0
    l20 = load(L, d + 6, lanes) * r0
    r1 = _pivot(fma(l10, -l10, load(L, d + 4, lanes)), least[k + 1], lanes)
    l21 = fma(l20, -l10, load(L, d + 7, lanes)) * r1
    p2 = fma(l21, -l21, fma(l20, -l20, load(L, d + 8, lanes)))
    store(L, d, lanes, r0)
    store(L, d + 3, lanes, l10)
    store(L, d + 4, lanes, r1)
    store(L, d + 6, lanes, l20)
    store(L, d + 7, lanes, l21)
    store(L, d + 8, lanes, _pivot(p2, least[k + 2], lanes))


@within
def _divide(L, x, d, side, lanes):
    """x ← x d⁻ᵀ for a block x of L, and the triangle on one side of its diagonal block d."""
    r0, r1, r2 = load(L, d, lanes), load(L, d + 4, lanes), load(L, d + 8, lanes)
    l10, l20 = load(L, d + side[0], lanes), load(L, d + side[1], lanes)
    l21 = load(L, d + side[2], lanes)
    for a in range(x, x + 9, 3):
        x0 = load(L, a, lanes) * r0
        x1 = fma(-l10, x0, load(L, a + 1, lanes)) * r1
        x2 = fma(-l21, x1, fma(-l20, x0, load(L, a + 2, lanes))) * r2
        store(L, a, lanes, x0)
        store(L, a + 1, lanes, x1)
        store(L, a + 2, lanes, x2)


@inline
def _subtract_column(Z, z, X, x, count, Y, y, lanes):
    """z ← z − x yᵀ for `count` blocks z and x in a row; y stays in registers."""
    by = _block(Y, y, lanes)
    for k in range(0, 9 * count, 9):
        block = _less_product_of_blocks(_block(Z, z + k, lanes), X, x + k, by, lanes)
        _set_block(Z, z + k, block, lanes)


@inline
def _subtract_panel(layout, p, number, Z, X, beyond, Y, lanes):
    """z ← z − x yᵀ, for all columns of panel p at once and blocks x that are `beyond` y or later.

    Where there are several columns, z stays in registers: what exceeds the caches takes two thirds
    of the time. With one, y does. The number of pairs of blocks is added to the given one.
    """
    start, target, begin, end = layout.start, layout.target, layout.panel[p], layout.panel[p + 1]
    below = start[end] - start[end - 1] - 1
    for q in range(below):
        if end == begin + 1:
            x = 9 * (start[end] - below)
            by = _block(Y, x + 9 * q, lanes)
            for a in range(q + beyond, below):
                z = 9 * target[number + a - q]
                block = _less_product_of_blocks(_block(Z, z, lanes), X, x + 9 * a, by, lanes)
                _set_block(Z, z, block, lanes)
        else:
            for a in range(q + beyond, below):
                z = 9 * target[number + a - q]
                block = _block(Z, z, lanes)
                for k in range(begin + 1, end + 1):
                    x = 9 * (start[k] - below)
                    by = _block(Y, x + 9 * q, lanes)
                    block = _less_product_of_blocks(block, X, x + 9 * a, by, lanes)
                _set_block(Z, z, block, lanes)
        number += below - q
    return number


@inline
def _block(X, x, lanes):
    return (
        *(load(X, x, lanes), load(X, x + 1, lanes), load(X, x + 2, lanes)),
        *(load(X, x + 3, lanes), load(X, x + 4, lanes), load(X, x + 5, lanes)),
        *(load(X, x + 6, lanes), load(X, x + 7, lanes), load(X, x + 8, lanes)),
    )


@inline
def _set_block(X, x, block, lanes):
    store(X, x, lanes, block[0])
    store(X, x + 1, lanes, block[1])
    store(X, x + 2, lanes, block[2])
    store(X, x + 3, lanes, block[3])
    store(X, x + 4, lanes, block[4])
    store(X, x + 5, lanes, block[5])
    store(X, x + 6, lanes, block[6])
    store(X, x + 7, lanes, block[7])
    store(X, x + 8, lanes, block[8])


@inline
def _less_product_of_blocks(block, X, x, by, lanes):
    """A block less x yᵀ, y given by its entries."""
    z0, z1, z2 = _less_row_product(block[0], block[1], block[2], X, x, by, lanes)
    z3, z4, z5 = _less_row_product(block[3], block[4], block[5], X, x + 3, by, lanes)
    z6, z7, z8 = _less_row_product(block[6], block[7], block[8], X, x + 6, by, lanes)
    return z0, z1, z2, z3, z4, z5, z6, z7, z8


@inline
def _less_row_product(z0, z1, z2, X, x, by, lanes):
    x0, x1, x2 = -load(X, x, lanes), -load(X, x + 1, lanes), -load(X, x + 2, lanes)
    z0 = fma(x2, by[2], fma(x1, by[1], fma(x0, by[0], z0)))
    z1 = fma(x2, by[5], fma(x1, by[4], fma(x0, by[3], z1)))
    z2 = fma(x2, by[8], fma(x1, by[7], fma(x0, by[6], z2)))
    return z0, z1, z2


@within
def _factor_corner(corner, m, lanes):
    """Cholesky factor of the m × m corner in place, its diagonal inverted (0 without pivot)."""
    for a in range(m):
        for b in range(a):
            value = load(corner, m * a + b, lanes)
            value = _less_product(value, corner, m * a, corner, m * b, b, lanes)
            store(corner, m * a + b, lanes, value * load(corner, m * b + b, lanes))
        value = load(corner, m * a + a, lanes)
        value = _less_product(value, corner, m * a, corner, m * a, a, lanes)
        zero, tiny = same(lanes, 0.0), same(lanes, NO_PIVOT)
        inverse = same(lanes, 1.0) / root(pick(value, tiny, value, same(lanes, 1.0)))
        store(corner, m * a + a, lanes, pick(value, tiny, inverse, zero))


@within
def solve(network, factors, x, y, lanes):
    """x, y ← (L Lᵀ)⁻¹ (x, y) for factored L; x (rows, W), y (m, W) of the global rows."""
    layout = network.layout
    m, rows = network.border.shape[1] // 2, 3 * (len(layout.start) - 1)
    _forward(layout, 0, rows // 3, factors.lower, _LOWER, factors.lower, x, 0, lanes)
    sides, corner = factors.sides, factors.corner
    for a in range(m):
        value = _less_product(load(y, a, lanes), sides, rows * a, x, 0, rows, lanes)
        value = _less_product(value, corner, m * a, y, 0, a, lanes)
        store(y, a, lanes, value * load(corner, m * a + a, lanes))
    for a in range(m - 1, -1, -1):
        value = load(y, a, lanes)
        for b in range(a + 1, m):
            value = fma(-load(corner, m * b + a, lanes), load(y, b, lanes), value)
        value = value * load(corner, m * a + a, lanes)
        store(y, a, lanes, value)
        for k in range(rows):
            store(x, k, lanes, fma(-load(sides, rows * a + k, lanes), value, load(x, k, lanes)))
    _backward(layout, factors.lower, _LOWER, factors.lower, x, lanes)


@within
def _forward(layout, begin, end, D, side, L, x, first, lanes):
    """x ← L⁻¹ x by columns `begin` to `end`, for the rows of x from `first` on.

    Of L's diagonal blocks one side is in D.
    """
    start = layout.start
    for k in range(begin, end):
        d, v = 9 * start[k], first + 3 * k
        v0 = load(x, v, lanes) * load(D, d, lanes)
        v1 = fma(-load(D, d + side[0], lanes), v0, load(x, v + 1, lanes)) * load(D, d + 4, lanes)
        v2 = fma(-load(D, d + side[1], lanes), v0, load(x, v + 2, lanes))
        v2 = fma(-load(D, d + side[2], lanes), v1, v2) * load(D, d + 8, lanes)
        _spread(layout, k, L, v0, v1, v2, x, first, lanes)


@inline
def _spread(layout, k, L, v0, v1, v2, x, first, lanes):
    """Set rows k of x to v, and subtract column k of L times v below."""
    start, row = layout.start, layout.row
    v = first + 3 * k
    store(x, v, lanes, v0)
    store(x, v + 1, lanes, v1)
    store(x, v + 2, lanes, v2)
    v0, v1, v2 = -v0, -v1, -v2
    for a in range(start[k] + 1, start[k + 1]):
        w, e = first + 3 * row[a], 9 * a
        for b in range(3):
            value = fma(load(L, e, lanes), v0, load(x, w + b, lanes))
            value = fma(load(L, e + 1, lanes), v1, value)
            store(x, w + b, lanes, fma(load(L, e + 2, lanes), v2, value))
            e += 3


@within
def _backward(layout, D, side, L, x, lanes):
    """x ← L⁻ᵀ x; of L's diagonal blocks one side is in D."""
    for k in range(len(layout.start) - 2, -1, -1):
        d, v = 9 * layout.start[k], 3 * k
        v0, v1, v2 = _gathered(layout, k, L, x, lanes)
        v2 = v2 * load(D, d + 8, lanes)
        v1 = fma(-load(D, d + side[2], lanes), v2, v1) * load(D, d + 4, lanes)
        v0 = fma(-load(D, d + side[1], lanes), v2, fma(-load(D, d + side[0], lanes), v1, v0))
        store(x, v, lanes, v0 * load(D, d, lanes))
        store(x, v + 1, lanes, v1)
        store(x, v + 2, lanes, v2)


@inline
def _gathered(layout, k, L, x, lanes):
    """Rows k of x less those below times column k of L."""
    start, row = layout.start, layout.row
    v0, v1, v2 = load(x, 3 * k, lanes), load(x, 3 * k + 1, lanes), load(x, 3 * k + 2, lanes)
    for a in range(start[k] + 1, start[k + 1]):
        w, e = 3 * row[a], 9 * a
        for b in range(3):
            value = -load(x, w + b, lanes)
            v0 = fma(load(L, e, lanes), value, v0)
            v1 = fma(load(L, e + 1, lanes), value, v1)
            v2 = fma(load(L, e + 2, lanes), value, v2)
            e += 3
    return v0, v1, v2


@within
def factor_lu(network, factors, stop, lanes):
    """L U of a matrix that is not symmetric, in place, without pivoting.

    The diagonal must keep the pivots regular; who asks must judge the solution. L has units on its
    diagonal; U is kept transposed, its diagonal blocks with those of L, the pivots inverted.
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
                _divide(L, 9 * a, d, _UPPER, lanes)
                _divide_by_unit(U, 9 * a, L, d, lanes)
            for q in range(k + 1, end):
                a, z = start[k] + q - k, 9 * start[q]
                _subtract_column(L, z, L, 9 * a, last - a, U, 9 * a, lanes)
                _subtract_column(U, z + 9, U, 9 * a + 9, last - a - 1, L, 9 * a, lanes)
        _subtract_panel(layout, p, number, U, U, 1, L, lanes)
        number = _subtract_panel(layout, p, number, L, L, 0, U, lanes)
    m, rows = network.border.shape[1] // 2, 3 * (len(start) - 1)
    corner = factors.corner
    for a in range(m):
        _forward_unit(layout, L, factors.tops, rows * a, lanes)
        _forward(layout, 0, rows // 3, L, _UPPER, U, factors.sides, rows * a, lanes)
    for a in range(m):
        for b in range(m):
            value = _less_product(
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
        store(corner, m * k + k, lanes, _inverse(load(corner, m * k + k, lanes), lanes))
        for a in range(k + 1, m):
            ratio = load(corner, m * a + k, lanes) * load(corner, m * k + k, lanes)
            store(corner, m * a + k, lanes, ratio)
            for b in range(k + 1, m):
                value = fma(-ratio, load(corner, m * k + b, lanes), load(corner, m * a + b, lanes))
                store(corner, m * a + b, lanes, value)


@within
def _less_product(value, x, first, y, other, count, lanes):
    """value − x·y for `count` numbers from `first` of x and `other` of y on."""
    for k in range(count):
        value = fma(-load(x, first + k, lanes), load(y, other + k, lanes), value)
    return value


@within
def _inverse(pivot, lanes):
    """One over a pivot of either sign; 0 without pivot."""
    zero, one = same(lanes, 0.0), same(lanes, 1.0)
    there = pick(size(pivot), same(lanes, NO_PIVOT), pivot, one)
    return pick(size(pivot), same(lanes, NO_PIVOT), one / there, zero)


@within
def _factor_skew_diagonal(L, d, lanes):
    """Unit L below and U above the diagonal of a diagonal block in place, pivots inverted."""
    for k in range(3):
        inverse = _inverse(load(L, d + 4 * k, lanes), lanes)
        store(L, d + 4 * k, lanes, inverse)
        for a in range(k + 1, 3):
            ratio = load(L, d + 3 * a + k, lanes) * inverse
            store(L, d + 3 * a + k, lanes, ratio)
            for b in range(k + 1, 3):
                value = fma(-ratio, load(L, d + 3 * k + b, lanes), load(L, d + 3 * a + b, lanes))
                store(L, d + 3 * a + b, lanes, value)


@within
def _divide_by_unit(U, x, L, d, lanes):
    """x ← x L⁻ᵀ for a block x of U, and the unit lower triangle of the diagonal block d."""
    for a in range(x, x + 9, 3):
        x0 = load(U, a, lanes)
        x1 = fma(-x0, load(L, d + 3, lanes), load(U, a + 1, lanes))
        x2 = fma(-x0, load(L, d + 6, lanes), load(U, a + 2, lanes))
        store(U, a + 1, lanes, x1)
        store(U, a + 2, lanes, fma(-x1, load(L, d + 7, lanes), x2))


@within
def _forward_unit(layout, L, x, first, lanes):
    """x ← L⁻¹ x for unit L."""
    for k in range(len(layout.start) - 1):
        d, v = 9 * layout.start[k], first + 3 * k
        v0 = load(x, v, lanes)
        v1 = fma(-load(L, d + 3, lanes), v0, load(x, v + 1, lanes))
        v2 = fma(-load(L, d + 6, lanes), v0, load(x, v + 2, lanes))
        v2 = fma(-load(L, d + 7, lanes), v1, v2)
        _spread(layout, k, L, v0, v1, v2, x, first, lanes)


@within
def solve_lu(network, factors, x, y, lanes):
    """x, y ← (L U)⁻¹ (x, y); shapes as for `solve`."""
    layout, corner = network.layout, factors.corner
    m, rows = network.border.shape[1] // 2, 3 * (len(layout.start) - 1)
    _forward_unit(layout, factors.lower, x, 0, lanes)
    for a in range(m):
        value = _less_product(load(y, a, lanes), factors.sides, rows * a, x, 0, rows, lanes)
        store(y, a, lanes, _less_product(value, corner, m * a, y, 0, a, lanes))
    for a in range(m - 1, -1, -1):
        rest = m - a - 1
        value = _less_product(load(y, a, lanes), corner, m * a + a + 1, y, a + 1, rest, lanes)
        value = value * load(corner, m * a + a, lanes)
        store(y, a, lanes, value)
        for k in range(rows):
            top = load(factors.tops, rows * a + k, lanes)
            store(x, k, lanes, fma(-top, value, load(x, k, lanes)))
    _backward(layout, factors.lower, _UPPER, factors.upper, x, lanes)
