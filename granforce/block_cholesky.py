"""Sparse Cholesky factors of LANES matrices with one pattern side by side, in 3×3 blocks.

A packing's normal matrix A D Aᵀ has one 3×3 block per grain and per pair of grains in contact. Its
graph is planar, so minimum degree leaves little fill, and the pattern is the same for every
program over S: the programs of a batch are laid out as the innermost, contiguous axis, where the
compiler turns each scalar operation into vector instructions. Lanes never mix, so that a
program's result does not depend on its neighbours, bit for bit.
"""

from typing import NamedTuple

import numba
import numpy as np

# Programs solved side by side: two 512-bit (or four 256-bit) vectors of doubles.
LANES = 16
_BLOCK = 9 * LANES
_ROW = 3 * LANES
# A pivot that rounding has driven to zero or below belongs to a direction without weight.
_NO_PIVOT = 1e-40
_NO_WEIGHT = 1e64


class Pattern(NamedTuple):
    """Where the blocks of the lower factor L are; block numbers count along the columns of L."""

    position: np.ndarray  # (grains,) place of each grain in the order of elimination
    start: np.ndarray  # (grains + 1,) first block of each column: the diagonal one
    row: np.ndarray  # (blocks,) block row of each block
    target: np.ndarray  # (updates,) the block that each product of two blocks is taken from


def pattern(grains, pairs):
    """The Pattern of a matrix with blocks on the diagonal and at pairs (N, 2) of grains.

    Grains are eliminated by least degree.
    """
    order, below = _least_degree(grains, pairs)
    position = np.empty(grains, dtype=np.int64)
    position[order] = np.arange(grains)
    columns = [np.sort(position[list(rows)]) for rows in below]
    start = np.concatenate([[0], np.cumsum([1 + len(rows) for rows in columns])]).astype(np.int64)
    row = np.empty(start[-1], dtype=np.int64)
    where = {}
    for column, rows in enumerate(columns):
        row[start[column]] = column
        row[start[column] + 1 : start[column + 1]] = rows
        for block in range(start[column], start[column + 1]):
            where[int(row[block]), column] = block
    target = [
        where[int(rows[a]), int(rows[b])]
        for rows in columns
        for a in range(len(rows))
        for b in range(a + 1)
    ]
    return Pattern(position, start, row, np.array(target, dtype=np.int64))


def _least_degree(grains, pairs):
    """Order of elimination, and the neighbours of each grain when it is eliminated."""
    adjacent = [set() for _ in range(grains)]
    for a, b in np.asarray(pairs).tolist():
        if a != b:
            adjacent[a].add(b)
            adjacent[b].add(a)
    left = set(range(grains))
    order, below = [], []
    while left:
        grain = min(left, key=lambda k: (len(adjacent[k]), k))
        neighbours = adjacent[grain]
        for other in neighbours:
            adjacent[other] |= neighbours
            adjacent[other] -= {other, grain}
        left.remove(grain)
        order.append(grain)
        below.append(neighbours)
    return order, below


def block_of(layout, high, low):
    """Number of the block in row high of column low (positions, arrays), high ≥ low."""
    numbers = np.empty(len(high), dtype=np.int64)
    for k, (row, column) in enumerate(zip(high, low, strict=True)):
        begin, end = layout.start[column], layout.start[column + 1]
        numbers[k] = begin + np.searchsorted(layout.row[begin:end], row)
    return numbers


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _factor_diagonal(d):
    """Cholesky factor of a diagonal block in place; its own diagonal is kept inverted."""
    for s in range(LANES):
        p0 = d[s]
        p0 = p0 if p0 > _NO_PIVOT else _NO_WEIGHT
        r0 = 1.0 / np.sqrt(p0)
        l10 = d[3 * LANES + s] * r0
        l20 = d[6 * LANES + s] * r0
        p1 = d[4 * LANES + s] - l10 * l10
        p1 = p1 if p1 > _NO_PIVOT else _NO_WEIGHT
        r1 = 1.0 / np.sqrt(p1)
        l21 = (d[7 * LANES + s] - l20 * l10) * r1
        p2 = d[8 * LANES + s] - l20 * l20 - l21 * l21
        p2 = p2 if p2 > _NO_PIVOT else _NO_WEIGHT
        d[s] = r0
        d[3 * LANES + s] = l10
        d[4 * LANES + s] = r1
        d[6 * LANES + s] = l20
        d[7 * LANES + s] = l21
        d[8 * LANES + s] = 1.0 / np.sqrt(p2)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _divide(x, d):
    """x ← x d⁻ᵀ for a block x below the factored diagonal block d."""
    for s in range(LANES):
        r0, r1, r2 = d[s], d[4 * LANES + s], d[8 * LANES + s]
        l10, l20, l21 = d[3 * LANES + s], d[6 * LANES + s], d[7 * LANES + s]
        for a in range(3):
            x0 = x[(3 * a) * LANES + s] * r0
            x1 = (x[(3 * a + 1) * LANES + s] - x0 * l10) * r1
            x2 = (x[(3 * a + 2) * LANES + s] - x0 * l20 - x1 * l21) * r2
            x[(3 * a) * LANES + s] = x0
            x[(3 * a + 1) * LANES + s] = x1
            x[(3 * a + 2) * LANES + s] = x2


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _subtract_product(z, x, y):
    """z ← z − x yᵀ for three blocks; written out, because the lanes then vectorise (4× faster)."""
    for s in range(LANES):
        x0, x1, x2 = x[s], x[LANES + s], x[2 * LANES + s]
        x3, x4, x5 = x[3 * LANES + s], x[4 * LANES + s], x[5 * LANES + s]
        x6, x7, x8 = x[6 * LANES + s], x[7 * LANES + s], x[8 * LANES + s]
        y0, y1, y2 = y[s], y[LANES + s], y[2 * LANES + s]
        y3, y4, y5 = y[3 * LANES + s], y[4 * LANES + s], y[5 * LANES + s]
        y6, y7, y8 = y[6 * LANES + s], y[7 * LANES + s], y[8 * LANES + s]
        z[s] -= x0 * y0 + x1 * y1 + x2 * y2
        z[LANES + s] -= x0 * y3 + x1 * y4 + x2 * y5
        z[2 * LANES + s] -= x0 * y6 + x1 * y7 + x2 * y8
        z[3 * LANES + s] -= x3 * y0 + x4 * y1 + x5 * y2
        z[4 * LANES + s] -= x3 * y3 + x4 * y4 + x5 * y5
        z[5 * LANES + s] -= x3 * y6 + x4 * y7 + x5 * y8
        z[6 * LANES + s] -= x6 * y0 + x7 * y1 + x8 * y2
        z[7 * LANES + s] -= x6 * y3 + x7 * y4 + x8 * y5
        z[8 * LANES + s] -= x6 * y6 + x7 * y7 + x8 * y8


@numba.njit(cache=True, nogil=True, error_model="numpy")
def factor(L, start, target):
    """Cholesky factors in place; L (blocks · 9 · LANES,) holds the lower blocks of each matrix."""
    update = 0
    for column in range(len(start) - 1):
        begin, end = start[column], start[column + 1]
        diagonal = L[begin * _BLOCK : (begin + 1) * _BLOCK]
        _factor_diagonal(diagonal)
        for a in range(begin + 1, end):
            x = L[a * _BLOCK : (a + 1) * _BLOCK]
            _divide(x, diagonal)
            for b in range(begin + 1, a + 1):
                z = target[update] * _BLOCK
                _subtract_product(L[z : z + _BLOCK], x, L[b * _BLOCK : (b + 1) * _BLOCK])
                update += 1


@numba.njit(cache=True, nogil=True, error_model="numpy")
def solve(L, start, row, x):
    """x ← (L Lᵀ)⁻¹ x for factored L; x (grains · 3 · LANES,)."""
    count = len(start) - 1
    for column in range(count):
        begin, end = start[column], start[column + 1]
        v = x[column * _ROW : (column + 1) * _ROW]
        _forward(L[begin * _BLOCK : (begin + 1) * _BLOCK], v)
        for a in range(begin + 1, end):
            _subtract(x[row[a] * _ROW : (row[a] + 1) * _ROW], L[a * _BLOCK : (a + 1) * _BLOCK], v)
    for column in range(count - 1, -1, -1):
        begin, end = start[column], start[column + 1]
        v = x[column * _ROW : (column + 1) * _ROW]
        for a in range(begin + 1, end):
            w = x[row[a] * _ROW : (row[a] + 1) * _ROW]
            _subtract_transposed(v, L[a * _BLOCK : (a + 1) * _BLOCK], w)
        _backward(L[begin * _BLOCK : (begin + 1) * _BLOCK], v)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _forward(d, v):
    for s in range(LANES):
        v0 = v[s] * d[s]
        v1 = (v[LANES + s] - d[3 * LANES + s] * v0) * d[4 * LANES + s]
        v2 = v[2 * LANES + s] - d[6 * LANES + s] * v0 - d[7 * LANES + s] * v1
        v[s], v[LANES + s], v[2 * LANES + s] = v0, v1, v2 * d[8 * LANES + s]


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _backward(d, v):
    for s in range(LANES):
        v2 = v[2 * LANES + s] * d[8 * LANES + s]
        v1 = (v[LANES + s] - d[7 * LANES + s] * v2) * d[4 * LANES + s]
        v0 = (v[s] - d[3 * LANES + s] * v1 - d[6 * LANES + s] * v2) * d[s]
        v[s], v[LANES + s], v[2 * LANES + s] = v0, v1, v2


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _subtract(w, x, v):
    """w ← w − x v for a block x and rows v, w."""
    for s in range(LANES):
        v0, v1, v2 = v[s], v[LANES + s], v[2 * LANES + s]
        w[s] -= x[s] * v0 + x[LANES + s] * v1 + x[2 * LANES + s] * v2
        w[LANES + s] -= x[3 * LANES + s] * v0 + x[4 * LANES + s] * v1 + x[5 * LANES + s] * v2
        w[2 * LANES + s] -= x[6 * LANES + s] * v0 + x[7 * LANES + s] * v1 + x[8 * LANES + s] * v2


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _subtract_transposed(w, x, v):
    """w ← w − xᵀ v for a block x and rows v, w."""
    for s in range(LANES):
        v0, v1, v2 = v[s], v[LANES + s], v[2 * LANES + s]
        w[s] -= x[s] * v0 + x[3 * LANES + s] * v1 + x[6 * LANES + s] * v2
        w[LANES + s] -= x[LANES + s] * v0 + x[4 * LANES + s] * v1 + x[7 * LANES + s] * v2
        w[2 * LANES + s] -= x[2 * LANES + s] * v0 + x[5 * LANES + s] * v1 + x[8 * LANES + s] * v2
