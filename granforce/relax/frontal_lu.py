"""LU factors of matrices Σ_c E_c K_c E_cᵀ + diag, K not symmetric, on the plan of `dissection`.

The multifrontal method of `dissection` with whole fronts in place of upper halves, and without
pivoting: the diagonal (masses) keeps fronts regular, and who asks must judge the solution.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from granforce.relax import dissection
from granforce.relax.dissection import NO_PIVOT, NO_WEIGHT


class Memory(NamedTuple):
    """Room for the factors of one matrix, and for finding them."""

    upper: np.ndarray  # (pivots, rows) panel of U of each front; inverses on the diagonal
    lower: np.ndarray  # the same of Lᵀ, unit diagonal left out
    stack: np.ndarray
    work: np.ndarray


def room(plan):
    """Memory for one matrix."""
    panels, stack, work = dissection.memory(plan)
    return Memory(np.empty(panels), np.empty(panels), np.empty(stack), np.empty(work))


@njit(cache=True, nogil=True, error_model="numpy")
def factor(plan, columns, blocks, diagonal, memory):
    """Fill memory.upper and memory.lower with the factors.

    columns: E (N_c, slots, 2); blocks: K (N_c, 2, 2), what unit relative motions (second index)
    do to f_n, f_t (first index); diagonal (rows,).
    """
    stack = memory.stack
    for f in range(plan.pivots.shape[0]):
        first, pivots = plan.first_row[f], plan.pivots[f]
        size = plan.first_row[f + 1] - first
        front = memory.work[: size * size].reshape(size, size)
        front[:] = 0.0
        for a in range(pivots):
            front[a, a] = diagonal[plan.rows[first + a]]
        for k in range(plan.first_contact[f], plan.first_contact[f + 1]):
            c = plan.contact[k]
            _add_contact(front, plan.place[k], columns[c], blocks[c])
        child = f - 1
        for _ in range(plan.children[f]):
            child = _add_child(front, plan, child, stack)
        _eliminate(front, pivots)
        panel = slice(plan.panel[f], plan.panel[f + 1])
        memory.upper[panel].reshape(pivots, size)[:] = front[:pivots]
        memory.lower[panel].reshape(pivots, size)[:] = front[:, :pivots].T
        rest = size - pivots
        update = stack[plan.stack[f] : plan.stack[f] + rest * rest].reshape(rest, rest)
        update[:] = front[pivots:, pivots:]


@njit(cache=True, nogil=True, error_model="numpy")
def _add_contact(front, place, column, block):
    slots = place.shape[0]
    for a in range(slots):
        by_n = column[a, 0] * block[0, 0] + column[a, 1] * block[1, 0]
        by_t = column[a, 0] * block[0, 1] + column[a, 1] * block[1, 1]
        for b in range(slots):
            front[place[a], place[b]] += by_n * column[b, 0] + by_t * column[b, 1]


@njit(cache=True, nogil=True, error_model="numpy")
def _add_child(front, plan, child, stack):
    """Add a child's update to its parent's front; the front before that child's descendants."""
    first = plan.first_row[child] + plan.pivots[child]
    rest = plan.first_row[child + 1] - first
    update = stack[plan.stack[child] : plan.stack[child] + rest * rest].reshape(rest, rest)
    into = plan.into_parent[first : first + rest]
    for a in range(rest):
        row = front[into[a]]
        for b in range(rest):
            row[into[b]] += update[a, b]
    before = child - 1
    for _ in range(plan.children[child]):
        before = dissection._skip(plan, before)
    return before


@njit(cache=True, nogil=True, error_model="numpy")
def _eliminate(front, pivots):
    """L below and U above the diagonal for the first pivots, inverses of the pivots on it.

    Row after row; four earlier pivot rows at a time, so that each element is loaded once for four
    products.
    """
    size = front.shape[0]
    for a in range(size):
        row = front[a]
        end = min(a, pivots)
        p = 0
        while p + 4 <= end:
            u0, u1, u2, u3 = front[p], front[p + 1], front[p + 2], front[p + 3]
            l0 = row[p] * u0[p]
            l1 = (row[p + 1] - l0 * u0[p + 1]) * u1[p + 1]
            l2 = (row[p + 2] - l0 * u0[p + 2] - l1 * u1[p + 2]) * u2[p + 2]
            l3 = (row[p + 3] - l0 * u0[p + 3] - l1 * u1[p + 3] - l2 * u2[p + 3]) * u3[p + 3]
            row[p], row[p + 1], row[p + 2], row[p + 3] = l0, l1, l2, l3
            for b in range(p + 4, size):
                row[b] -= (l0 * u0[b] + l1 * u1[b]) + (l2 * u2[b] + l3 * u3[b])
            p += 4
        for q in range(p, end):
            earlier = front[q]
            ratio = row[q] * earlier[q]
            row[q] = ratio
            for b in range(q + 1, size):
                row[b] -= ratio * earlier[b]
        if a < pivots:
            row[a] = 1.0 / (row[a] if abs(row[a]) > NO_PIVOT else NO_WEIGHT)


@njit(cache=True, nogil=True, error_model="numpy")
def solve(plan, memory, x):
    """x ← (L U)⁻¹ x in place, x (rows,)."""
    fronts = plan.pivots.shape[0]
    for f in range(fronts):
        first, pivots = plan.first_row[f], plan.pivots[f]
        size = plan.first_row[f + 1] - first
        panel = memory.lower[plan.panel[f] : plan.panel[f + 1]].reshape(pivots, size)
        local = memory.work[:size]
        for a in range(size):
            local[a] = x[plan.rows[first + a]] if a < pivots else 0.0
        for p in range(pivots):
            row, value = panel[p], local[p]
            for b in range(p + 1, size):
                local[b] -= value * row[b]
        for a in range(size):
            if a < pivots:
                x[plan.rows[first + a]] = local[a]
            else:
                x[plan.rows[first + a]] += local[a]
    for f in range(fronts - 1, -1, -1):
        first, pivots = plan.first_row[f], plan.pivots[f]
        size = plan.first_row[f + 1] - first
        panel = memory.upper[plan.panel[f] : plan.panel[f + 1]].reshape(pivots, size)
        local = memory.work[:size]
        for a in range(size):
            local[a] = x[plan.rows[first + a]]
        for p in range(pivots - 1, -1, -1):
            row, value = panel[p], local[p]
            for b in range(p + 1, size):
                value -= row[b] * local[b]
            local[p] = value * row[p]
        for a in range(pivots):
            x[plan.rows[first + a]] = local[a]
