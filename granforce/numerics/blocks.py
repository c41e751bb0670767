"""Products of 3×3 blocks and triangular sweeps over them: the operations of every factorisation.

A matrix that couples grains is stored in blocks of nine numbers, row by row, with one block for
each pair of grains that elimination couples (`elimination.Pattern`): entry (i, j) of block b is at
place 9 b + 3 i + j of the array. A factor L has one column of blocks per grain: the diagonal block
first, then those below. Once its diagonal block is factored, column k takes part in three
operations:

- the blocks below are divided by it, x ← x d⁻ᵀ (`divide`);
- their products are subtracted from later columns, z ← z − x yᵀ (`subtract_column` within a panel
  of columns with the same rows below, `subtract_panel` from all later columns at once);
- a triangular sweep over a vector, down by `forward` (x ← L⁻¹ x) or up by `backward` (L⁻ᵀ x).

The diagonal of a diagonal block is stored inverted, so that sweeps multiply. Of its other six
numbers, the three below the diagonal are read (LOWER) if L is a Cholesky factor, and the three
above (UPPER) if the block holds both L and U of `lu`, whose U is stored transposed.
"""

from granforce.numerics.lanes import fma, inline, keep_three, less, load, store, three, within

# A pivot that rounding drives to zero or below belongs to a direction without weight.
NO_PIVOT = 1e-40
# Places of entries 10, 20, 21 of a lower triangle in a 3×3 block, and of a transposed upper one.
LOWER, UPPER = (3, 6, 7), (1, 2, 5)


@within
def divide(L, x, d, side, lanes):
    """x ← x d⁻ᵀ for a block x of L and the triangle on one side of the diagonal block d."""
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
def subtract_column(Z, z, X, x, count, Y, y, lanes):
    """z ← z − x yᵀ for `count` consecutive blocks z and x; y stays in registers."""
    columns = _columns(Y, y, lanes)
    for k in range(0, 9 * count, 9):
        rows = _less_product(_rows(Z, z + k, lanes), X, x + k, columns, lanes)
        _keep_rows(Z, z + k, rows, lanes)


@inline
def subtract_panel(layout, p, number, Z, X, beyond, Y, lanes):
    """z ← z − x yᵀ for all columns of panel p at once and blocks x that are `beyond` y or later.

    In a panel of several columns z stays in registers, because memory traffic beyond the caches
    takes two thirds of the time; with one column, y does. Returns `number` plus the pairs of blocks
    done.
    """
    start, target, begin, end = layout.start, layout.target, layout.panel[p], layout.panel[p + 1]
    below = start[end] - start[end - 1] - 1
    for q in range(below):
        if end == begin + 1:
            x = 9 * (start[end] - below)
            columns = _columns(Y, x + 9 * q, lanes)
            for a in range(q + beyond, below):
                z = 9 * target[number + a - q]
                rows = _less_product(_rows(Z, z, lanes), X, x + 9 * a, columns, lanes)
                _keep_rows(Z, z, rows, lanes)
        else:
            for a in range(q + beyond, below, 2):
                other = min(a + 1, below - 1)
                z, w = 9 * target[number + a - q], 9 * target[number + other - q]
                one, two = _rows(Z, z, lanes), _rows(Z, w, lanes)
                for k in range(begin + 1, end + 1):
                    x = 9 * (start[k] - below)
                    columns = _columns(Y, x + 9 * q, lanes)
                    one = _less_product(one, X, x + 9 * a, columns, lanes)
                    two = _less_product(two, X, x + 9 * other, columns, lanes)
                _keep_rows(Z, z, one, lanes)
                _keep_rows(Z, w, two, lanes)
        number += below - q
    return number


@inline
def _columns(Y, y, lanes):
    return three(Y, y, 3, lanes), three(Y, y + 1, 3, lanes), three(Y, y + 2, 3, lanes)


@inline
def _rows(Z, z, lanes):
    return three(Z, z, 1, lanes), three(Z, z + 3, 1, lanes), three(Z, z + 6, 1, lanes)


@inline
def _keep_rows(Z, z, rows, lanes):
    keep_three(Z, z, lanes, rows[0])
    keep_three(Z, z + 3, lanes, rows[1])
    keep_three(Z, z + 6, lanes, rows[2])


@inline
def _less_product(rows, X, x, columns, lanes):
    """The rows of a block minus x yᵀ, with y given by its columns."""
    return (
        _less_row(rows[0], X, x, columns, lanes),
        _less_row(rows[1], X, x + 3, columns, lanes),
        _less_row(rows[2], X, x + 6, columns, lanes),
    )


@inline
def _less_row(row, X, x, columns, lanes):
    row = less(row, load(X, x, lanes), columns[0])
    row = less(row, load(X, x + 1, lanes), columns[1])
    return less(row, load(X, x + 2, lanes), columns[2])


@within
def forward(layout, begin, end, D, side, L, x, first, lanes):
    """x ← L⁻¹ x with columns `begin` to `end`; rows of x count from `first`.

    D holds one side of L's diagonal blocks.
    """
    start = layout.start
    for k in range(begin, end):
        d, v = 9 * start[k], first + 3 * k
        v0 = load(x, v, lanes) * load(D, d, lanes)
        v1 = fma(-load(D, d + side[0], lanes), v0, load(x, v + 1, lanes)) * load(D, d + 4, lanes)
        v2 = fma(-load(D, d + side[1], lanes), v0, load(x, v + 2, lanes))
        v2 = fma(-load(D, d + side[2], lanes), v1, v2) * load(D, d + 8, lanes)
        spread(layout, k, L, v0, v1, v2, x, first, lanes)


@inline
def spread(layout, k, L, v0, v1, v2, x, first, lanes):
    """Set rows k of x to v and subtract column k of L times v from the rows below."""
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
def backward(layout, D, side, L, x, lanes):
    """x ← L⁻ᵀ x; D holds one side of L's diagonal blocks."""
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
    """Rows k of x minus the rows below times column k of L."""
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
def less_product(value, x, first, y, other, count, lanes):
    """value − x·y over `count` numbers, from `first` in x and `other` in y."""
    for k in range(count):
        value = fma(-load(x, first + k, lanes), load(y, other + k, lanes), value)
    return value
