"""A K Aᵀ + δ, the stiffness of a contact network, assembled contact by contact in 3×3 blocks.

Each contact couples the three degrees of freedom of its two grains by a 2×2 conductance K,
symmetric or not. Let E (3, 2) be the action of unit f_n and unit f_t on the rows of the grain
eliminated later, and E′ on those of the other grain: the contact adds E K Eᵀ and E′ K E′ᵀ to the
diagonal blocks of the two, and E K E′ᵀ to the block between them. Up to three global rows (pressure
or stress) meet every contact and are stored apart as a border. `cholesky` factors the matrix if K
is symmetric, `lu` if not. Kernels work on one matrix or on LANES of them side by side (see
`lanes`); matrices never mix.

A is given by `columns` (N_c, 12), the action of unit f_n (first six numbers) and unit f_t on the
rows of the grain eliminated later (three) and earlier (three), and by `border` (N_c, 2 m), the
action on the m global rows.
"""

from typing import NamedTuple

import numpy as np

from granforce.numerics.elimination import Pattern, block_of, pattern
from granforce.numerics.lanes import fma, inline, load, room, same, store, within
from granforce.types import Floats, Integers


class Network(NamedTuple):
    """A, and where its products are stored."""

    layout: Pattern
    high: Integers  # (N_c,) place of the grain eliminated later
    low: Integers  # (N_c,) place of the other grain
    block: Integers  # (N_c,) block that couples them
    columns: Floats  # (N_c, 12)
    border: Floats  # (N_c, 2 m)


class Factors(NamedTuple):
    """Storage for one factorisation; W is 1 or LANES."""

    lower: Floats  # (blocks · 9, W)
    upper: Floats  # (blocks · 9, W) transposed; empty if the matrix is symmetric
    sides: Floats  # (m · rows, W) L⁻¹ of the global rows
    tops: Floats  # (m · rows, W) the same for the global columns; empty if symmetric
    corner: Floats  # (m · m, W) factors of the global rows' Schur complement


def make_network(
    x: Floats, i: Integers, j: Integers, first: Floats, second: Floats, border: Floats
) -> Network:
    """The Network of grains at x (M, 2) in contact i, j (N_c,).

    first, second (N_c, 3, 2): action of unit f_n, f_t on the rows of grains i and j; border (N_c,
    m, 2): on the global rows.
    """
    return turned(pattern(x, i, j), i, j, first, second, border)


def turned(
    layout: Pattern, i: Integers, j: Integers, first: Floats, second: Floats, border: Floats
) -> Network:
    """The Network of contacts whose pattern is known; arguments as in `make_network`."""
    at_i, at_j = layout.position[i], layout.position[j]
    later = (at_i > at_j)[:, None, None]
    columns = np.concatenate(
        [np.where(later, first, second), np.where(later, second, first)], axis=1
    )
    high, low = np.maximum(at_i, at_j), np.minimum(at_i, at_j)
    return Network(
        layout=layout,
        high=high,
        low=low,
        block=block_of(layout, high, low),
        columns=np.ascontiguousarray(columns.transpose(0, 2, 1)).reshape(len(high), 12),
        border=np.ascontiguousarray(border.transpose(0, 2, 1)).reshape(
            len(high), 2 * border.shape[1]
        ),
    )


def make_factors(network: Network, width: int, symmetric: bool = True) -> Factors:
    """Storage for the factors of `width` matrices side by side."""
    blocks, rows = len(network.layout.row), 3 * len(network.layout.position)
    m = network.border.shape[1] // 2
    other = 0 if symmetric else 1
    return Factors(
        lower=room(9 * blocks, width),
        upper=room(9 * blocks * other, width),
        sides=room(m * rows, width),
        tops=room(m * rows * other, width),
        corner=room(m * m, width),
    )


@inline
def pull(network, c, x, y, lanes):
    """(Aᵀ x)_n and (Aᵀ x)_t of contact c; x (rows, W), y (m, W) for the global rows."""
    normal = tangential = same(lanes, 0.0)
    for first, grain in ((0, network.high[c]), (3, network.low[c])):
        e = _columns_of(network.columns[c], first)
        x0, x1 = load(x, 3 * grain, lanes), load(x, 3 * grain + 1, lanes)
        x2 = load(x, 3 * grain + 2, lanes)
        normal = fma(e[0], x0, fma(e[1], x1, fma(e[2], x2, normal)))
        tangential = fma(e[3], x0, fma(e[4], x1, fma(e[5], x2, tangential)))
    g = network.border[c]
    m = len(g) // 2
    for a in range(m):
        value = load(y, a, lanes)
        normal = fma(g[a], value, normal)
        tangential = fma(g[m + a], value, tangential)
    return normal, tangential


@inline
def push(network, c, normal, tangential, x, y, lanes):
    """x, y ← x, y + A f for the forces f of contact c; shapes as in `pull`."""
    for first, grain in ((0, network.high[c]), (3, network.low[c])):
        e = _columns_of(network.columns[c], first)
        x0 = fma(e[0], normal, fma(e[3], tangential, load(x, 3 * grain, lanes)))
        x1 = fma(e[1], normal, fma(e[4], tangential, load(x, 3 * grain + 1, lanes)))
        x2 = fma(e[2], normal, fma(e[5], tangential, load(x, 3 * grain + 2, lanes)))
        store(x, 3 * grain, lanes, x0)
        store(x, 3 * grain + 1, lanes, x1)
        store(x, 3 * grain + 2, lanes, x2)
    g = network.border[c]
    m = len(g) // 2
    for a in range(m):
        value = fma(g[m + a], tangential, load(y, a, lanes))
        store(y, a, lanes, fma(g[a], normal, value))


@within
def clear(values, lanes):
    """values ← 0, element by element: a slice assignment takes numba half a second to compile."""
    for k in range(len(values)):
        store(values, k, lanes, 0.0)


@within
def copy(values, given, lanes):
    """values ← given, element by element."""
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
            store(factors.lower, 9 * start[k] + 4 * a, lanes, diagonal[3 * k + a])


@inline
def add(network, c, nn, nt, tt, factors, lanes):
    """Add contact c with the symmetric conductance K = [nn nt; nt tt] to the matrix."""
    _add_diagonal(network, c, nn, nt, nt, tt, factors, lanes)
    _add_between(network, c, nn, nt, nt, tt, factors.lower, factors.sides, lanes)


@inline
def add_skew(network, c, nn, nt, tn, tt, factors, lanes):
    """Add contact c with the conductance K = [nn nt; tn tt] to an unsymmetric matrix."""
    _add_diagonal(network, c, nn, nt, tn, tt, factors, lanes)
    _add_between(network, c, nn, nt, tn, tt, factors.lower, factors.sides, lanes)
    _add_between(network, c, nn, tn, nt, tt, factors.upper, factors.tops, lanes)


@inline
def _add_diagonal(network, c, nn, nt, tn, tt, factors, lanes):
    """Add E K Eᵀ to the blocks of both grains and to the corner."""
    start = network.layout.start
    for first, grain in ((0, network.high[c]), (3, network.low[c])):
        e = _columns_of(network.columns[c], first)
        _add_block(factors.lower, 9 * start[grain], e, _times(nn, nt, tn, tt, e), lanes)
    g = network.border[c]
    m = len(g) // 2
    for b in range(m):
        by_n, by_t = _through(nn, nt, tn, tt, g[b], g[m + b])
        for a in range(m):
            _add_to(factors.corner, m * a + b, g[a], by_n, g[m + a], by_t, lanes)


@inline
def _add_between(network, c, nn, nt, tn, tt, blocks, sides, lanes):
    """Add E K E′ᵀ to the block between the grains, and the products with global rows."""
    high, low = _columns_of(network.columns[c], 0), _columns_of(network.columns[c], 3)
    by_low = _times(nn, nt, tn, tt, low)
    _add_block(blocks, 9 * network.block[c], high, by_low, lanes)
    g, grains = network.border[c], len(network.layout.start) - 1
    m = len(g) // 2
    if m:
        by_high = _times(nn, nt, tn, tt, high)
        for a in range(m):
            row = 3 * a * grains
            _add_three(sides, row + 3 * network.low[c], g[a], g[m + a], by_low, lanes)
            _add_three(sides, row + 3 * network.high[c], g[a], g[m + a], by_high, lanes)


@within
def _columns_of(e, first):
    """Action of unit f_n and unit f_t on the three rows of a contact's later or earlier grain."""
    return e[first], e[first + 1], e[first + 2], e[first + 6], e[first + 7], e[first + 8]


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
def _add_block(blocks, place, e, other, lanes):
    """Add e otherᵀ to a block."""
    _add_three(blocks, place, e[0], e[3], other, lanes)
    _add_three(blocks, place + 3, e[1], e[4], other, lanes)
    _add_three(blocks, place + 6, e[2], e[5], other, lanes)


@within
def _add_three(values, place, e_n, e_t, other, lanes):
    """Add e otherᵀ to a row of a block, or to a global row's three entries."""
    first = fma(e_t, other[3], fma(e_n, other[0], load(values, place, lanes)))
    second = fma(e_t, other[4], fma(e_n, other[1], load(values, place + 1, lanes)))
    third = fma(e_t, other[5], fma(e_n, other[2], load(values, place + 2, lanes)))
    store(values, place, lanes, first)
    store(values, place + 1, lanes, second)
    store(values, place + 2, lanes, third)


@within
def add_one(network, c, K, factors, lane):
    """Add a normal conductance K of contact c to the matrix in one lane."""
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
    value = fma(e_n, by_n, load(values, place, lanes))
    store(values, place, lanes, fma(e_t, by_t, value))
