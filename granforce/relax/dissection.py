"""Cholesky factors of weighted Laplacians of a contact graph, by nested dissection.

The matrix is Σ_c E_c K_c E_cᵀ + δ: each contact couples the degrees of freedom of its two grains
and, if the pressure is prescribed, the one of the box. Halving the packing along its longer side
again and again gives separators; the grains of one separator (or of one last part) are
eliminated together as one dense front, children before parents (multifrontal method). In the
plane that costs O(N^1.5) operations and O(N log N) memory. What depends on the graph only is the
Plan; one plan serves any number of factorisations, in any thread.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy import sparse
from scipy.sparse.csgraph import maximum_bipartite_matching

# Parts of at most this many grains are eliminated whole: smaller fronts cost more in overhead
# than their sparsity saves (measured flat between 6 and 16 at N = 400 and 6400).
LARGEST_PART = 8
# Parts of more grains than this are worth a choice among several cuts.
SEVERAL_CUTS = 40
# Pivots whose rows of U are kept in cache while they are subtracted from all rows below.
PANEL = 48
# A pivot that rounding has driven to zero or below belongs to a direction without weight.
NO_PIVOT = 1e-200
NO_WEIGHT = 1e200


class Plan(NamedTuple):
    """Fronts in order of elimination; rows are the matrix's own row numbers."""

    first_row: np.ndarray  # (F + 1,) where the rows of each front begin in `rows`
    rows: np.ndarray  # rows of each front: its pivots, then those of later fronts
    pivots: np.ndarray  # (F,) number of pivots of each front
    panel: np.ndarray  # (F + 1,) where the factor's (pivots, rows) panel of each front begins
    children: np.ndarray  # (F,) number of children, which are the fronts last left on the stack
    stack: np.ndarray  # (F,) where the front's update begins on the stack
    stack_size: int
    into_parent: np.ndarray  # as `rows`: place of each non-pivot row among the parent's rows
    first_contact: np.ndarray  # (F + 1,) where the contacts assembled in each front begin
    contact: np.ndarray  # (N_c,) contacts, grouped by front
    place: np.ndarray  # (N_c, slots) place of each contact's rows in its front, by `contact`


def make_plan(x, i, j, size, border):
    """The Plan of the matrix on M grains at x (M, 2) with contacts i, j (N_c,) between them.

    size: degrees of freedom per grain; border: whether one more row, the last, meets every contact.
    """
    fronts, parent = _dissect(x, *_neighbours(len(x), i, j))
    front_of = np.empty(len(x), dtype=np.int64)
    for f, pivots in enumerate(fronts):
        front_of[pivots] = f
    edges = np.minimum(front_of[i], front_of[j])
    by_front = np.argsort(edges, kind="stable")
    first_contact = np.searchsorted(edges[by_front], np.arange(len(fronts) + 1))
    met = _later_grains(fronts, parent, front_of, i, j)
    extra = [size * len(x)] if border else []
    rows = []
    for f, pivots in enumerate(fronts):
        grains = np.concatenate([pivots, met[f]])
        scalars = (size * grains[:, None] + np.arange(size)).ravel()
        rows.append(np.concatenate([scalars, extra]).astype(np.int64))
    pivots = size * np.array([len(part) for part in fronts], dtype=np.int64)
    if border:
        pivots[-1] += 1
    return _layout(rows, pivots, parent, first_contact, by_front, slots(i, j, size, border, len(x)))


def slots(i, j, size, border, grains):
    """Row numbers (N_c, 2·size + border) that each contact meets."""
    across = np.arange(size)
    parts = [size * i[:, None] + across, size * j[:, None] + across]
    if border:
        parts.append(np.full((len(i), 1), size * grains))
    return np.concatenate(parts, axis=1).astype(np.int64)


def _neighbours(count, i, j):
    """Neighbours of each grain as (start, list), both directions of every contact."""
    here, there = np.concatenate([i, j]), np.concatenate([j, i])
    order = np.argsort(here, kind="stable")
    start = np.searchsorted(here[order], np.arange(count + 1))
    return start, there[order]


def _dissect(x, start, other):
    """Grains of each front, children before parents, and each front's parent (the root's: −1)."""
    fronts, parent = [], []
    side = np.zeros(len(x), dtype=np.int8)

    def eliminate(part):
        if len(part) <= LARGEST_PART:
            return add(part, [])
        separator, *halves = _best_cut(part, x, start, other, side)
        return add(separator, [eliminate(half) for half in halves if len(half)])

    def add(pivots, children):
        fronts.append(pivots)
        parent.append(-1)
        for child in children:
            parent[child] = len(fronts) - 1
        return len(fronts) - 1

    eliminate(np.arange(len(x)))
    return fronts, np.array(parent)


def _best_cut(part, x, start, other, side):
    """Separator and two halves: of several straight cuts the one with the thinnest separator."""
    extent = np.ptp(x[part], axis=0)
    several = len(part) > SEVERAL_CUTS
    best = None
    for axis in np.flatnonzero(extent >= (0.7 if several else 1.0) * extent.max()):
        ranked = part[np.argsort(x[part, axis], kind="stable")]
        for fraction in (0.42, 0.46, 0.5, 0.54, 0.58) if several else (0.5,):
            middle = int(fraction * len(part))
            halves = ranked[:middle], ranked[middle:]
            separator = _separator(*halves, start, other, side)
            if best is None or len(separator) < len(best[0]):
                best = (separator, *halves)
    separator, *halves = best
    return separator, *(np.setdiff1d(half, separator, assume_unique=True) for half in halves)


def _separator(left, right, start, other, side):
    """Fewest grains that meet every contact between two sets (König: from a largest matching)."""
    side[right] = 1
    degree = start[left + 1] - start[left]
    ends = np.cumsum(degree)
    flat = np.repeat(start[left] - ends + degree, degree) + np.arange(degree.sum())
    across = side[other[flat]] == 1
    side[right] = 0
    a, from_left = np.unique(np.repeat(left, degree)[across], return_inverse=True)
    b, to_right = np.unique(other[flat][across], return_inverse=True)
    links = [[] for _ in a]
    for m, k in zip(from_left.tolist(), to_right.tolist(), strict=True):
        links[m].append(k)
    graph = sparse.csr_matrix((np.ones(len(from_left)), (from_left, to_right)), (len(a), len(b)))
    partner = maximum_bipartite_matching(graph, perm_type="row").tolist()
    # Alternating paths from the unmatched on the left: what they reach on the right, and what
    # they do not reach on the left, meets every link.
    matched = set(partner)
    reached = [m for m in range(len(a)) if m not in matched]
    seen, met = set(reached), set()
    while reached:
        for k in links[reached.pop()]:
            if k not in met:
                met.add(k)
                if partner[k] not in seen:
                    seen.add(partner[k])
                    reached.append(partner[k])
    unseen = [m for m in range(len(a)) if m not in seen]
    return np.concatenate([a[unseen], b[sorted(met)]])


def _later_grains(fronts, parent, front_of, i, j):
    """Grains of later fronts that each front meets, directly or by fill, in elimination order."""
    position = np.empty(len(front_of), dtype=np.int64)
    position[np.concatenate(fronts)] = np.arange(len(front_of))
    met = [[] for _ in fronts]
    low = np.where(front_of[i] < front_of[j], i, j)
    high = np.where(front_of[i] < front_of[j], j, i)
    between = front_of[low] != front_of[high]
    order = np.argsort(front_of[low[between]], kind="stable")
    low, high = low[between][order], high[between][order]
    begin = np.searchsorted(front_of[low], np.arange(len(fronts) + 1))
    for f in range(len(fronts)):
        grains = np.unique(np.concatenate([*met[f], high[begin[f] : begin[f + 1]]]).astype(int))
        met[f] = grains[np.argsort(position[grains])]
        if parent[f] >= 0:
            met[parent[f]].append(met[f][front_of[met[f]] != parent[f]])
    return met


def _layout(rows, pivots, parent, first_contact, contact, meets):
    count = len(rows)
    sizes = np.array([len(part) for part in rows], dtype=np.int64)
    first_row = np.concatenate([[0], np.cumsum(sizes)])
    local = np.full(1 + max((part.max() for part in rows if len(part)), default=0), -1)
    into_parent = np.full(first_row[-1], -1)
    place = np.empty(meets.shape, dtype=np.int64)
    offspring = [[] for _ in rows]
    for f in range(count):
        if parent[f] >= 0:
            offspring[parent[f]].append(f)
    children = np.array([len(part) for part in offspring], dtype=np.int64)
    stack = np.empty(count, dtype=np.int64)
    top = peak = 0
    for f in range(count):
        local[rows[f]] = np.arange(sizes[f])
        mine = slice(first_contact[f], first_contact[f + 1])
        place[mine] = local[meets[contact[mine]]]
        for child in offspring[f]:
            inner = slice(first_row[child] + pivots[child], first_row[child + 1])
            into_parent[inner] = local[rows[child][pivots[child] :]]
            top = min(top, stack[child])
        stack[f] = top
        top += (sizes[f] - pivots[f]) ** 2
        peak = max(peak, top)
    return Plan(
        first_row,
        np.concatenate(rows),
        pivots,
        np.concatenate([[0], np.cumsum(pivots * sizes)]),
        children,
        stack,
        int(peak),
        into_parent,
        first_contact.astype(np.int64),
        contact.astype(np.int64),
        place,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def factor(plan, columns, weight, shift, panels, stack, work):
    """Fill the panels with the factor U of Σ_c E_c K_c E_cᵀ + diag(shift) = Uᵀ U.

    columns: E (N_c, slots, 2) unit forces on the rows each contact meets. weight: K (N_c, 3) as
    nn, nt, tt. shift (rows,). panels, stack, work: memory as told by `memory`.
    """
    for f in range(plan.pivots.shape[0]):
        first, pivots = plan.first_row[f], plan.pivots[f]
        size = plan.first_row[f + 1] - first
        front = work[: size * size].reshape(size, size)
        front[:] = 0.0
        for a in range(pivots):
            front[a, a] = shift[plan.rows[first + a]]
        for k in range(plan.first_contact[f], plan.first_contact[f + 1]):
            c = plan.contact[k]
            _add_contact(front, plan.place[k], columns[c], weight[c])
        child = f - 1
        for _ in range(plan.children[f]):
            child = _add_child(front, plan, child, stack)
        panel = panels[plan.panel[f] : plan.panel[f + 1]].reshape(pivots, size)
        _eliminate(front, pivots)
        panel[:] = front[:pivots]
        rest = size - pivots
        update = stack[plan.stack[f] : plan.stack[f] + rest * rest].reshape(rest, rest)
        for a in range(rest):
            update[a, a:] = front[pivots + a, pivots + a :]


@njit(cache=True, nogil=True, error_model="numpy")
def _add_contact(front, place, column, weight):
    slots = place.shape[0]
    for a in range(slots):
        e_n = column[a, 0] * weight[0] + column[a, 1] * weight[1]
        e_t = column[a, 0] * weight[1] + column[a, 1] * weight[2]
        row = place[a]
        for b in range(slots):
            if place[b] >= row:
                front[row, place[b]] += e_n * column[b, 0] + e_t * column[b, 1]


@njit(cache=True, nogil=True, error_model="numpy")
def _add_child(front, plan, child, stack):
    """Add a child's update to its parent's front; the front before that child's descendants."""
    first = plan.first_row[child] + plan.pivots[child]
    rest = plan.first_row[child + 1] - first
    update = stack[plan.stack[child] : plan.stack[child] + rest * rest].reshape(rest, rest)
    into = plan.into_parent[first : first + rest]
    for a in range(rest):
        row = into[a]
        # Rows keep their order from front to front: the upper half stays the upper half.
        for b in range(a, rest):
            front[row, into[b]] += update[a, b]
    before = child - 1
    for _ in range(plan.children[child]):
        before = _skip(plan, before)
    return before


@njit(cache=True, nogil=True)
def _skip(plan, front):
    """The front before a whole subtree in order of elimination."""
    left = 1
    while left > 0:
        left += plan.children[front] - 1
        front -= 1
    return front


@njit(cache=True, nogil=True, error_model="numpy")
def _eliminate(front, pivots):
    """Rows of U for the first pivots of a dense upper matrix, and what is left below, in place."""
    size = front.shape[0]
    for begin in range(0, pivots, PANEL):
        end = min(begin + PANEL, pivots)
        for p in range(begin, end):
            _subtract_rows(front, p, begin, p)
            row = front[p]
            pivot = row[p] if row[p] > NO_PIVOT else NO_WEIGHT
            inverse = 1.0 / np.sqrt(pivot)
            for b in range(p, size):
                row[b] *= inverse
            # The diagonal is kept inverted: solving then needs no division.
            row[p] = inverse
        for a in range(end, size):
            _subtract_rows(front, a, begin, end)


@njit(cache=True, nogil=True, error_model="numpy")
def _subtract_rows(front, a, begin, end):
    """Row a less its products with the pivot rows begin … end − 1, eight (then one) at a time.

    Eight at a time each element of the row is loaded and stored once for eight products: 3× faster.
    """
    size = front.shape[0]
    row = front[a]
    p = begin
    while p + 8 <= end:
        u0, u1, u2, u3 = front[p], front[p + 1], front[p + 2], front[p + 3]
        u4, u5, u6, u7 = front[p + 4], front[p + 5], front[p + 6], front[p + 7]
        f0, f1, f2, f3 = u0[a], u1[a], u2[a], u3[a]
        f4, f5, f6, f7 = u4[a], u5[a], u6[a], u7[a]
        for b in range(a, size):
            row[b] -= (f0 * u0[b] + f1 * u1[b] + f2 * u2[b] + f3 * u3[b]) + (
                f4 * u4[b] + f5 * u5[b] + f6 * u6[b] + f7 * u7[b]
            )
        p += 8
    for q in range(p, end):
        earlier = front[q]
        factor = earlier[a]
        for b in range(a, size):
            row[b] -= factor * earlier[b]


@njit(cache=True, nogil=True, error_model="numpy")
def solve(plan, panels, x, work):
    """x ← (Uᵀ U)⁻¹ x in place, x (rows,)."""
    fronts = plan.pivots.shape[0]
    for f in range(fronts):
        first, pivots = plan.first_row[f], plan.pivots[f]
        size = plan.first_row[f + 1] - first
        panel = panels[plan.panel[f] : plan.panel[f + 1]].reshape(pivots, size)
        local = work[:size]
        for a in range(size):
            local[a] = x[plan.rows[first + a]] if a < pivots else 0.0
        for p in range(pivots):
            row = panel[p]
            value = local[p] * row[p]
            local[p] = value
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
        panel = panels[plan.panel[f] : plan.panel[f + 1]].reshape(pivots, size)
        local = work[:size]
        for a in range(size):
            local[a] = x[plan.rows[first + a]]
        for p in range(pivots - 1, -1, -1):
            row = panel[p]
            value = local[p]
            # Four sums side by side, because one would wait for each addition.
            s0 = s1 = s2 = s3 = 0.0
            b = p + 1
            while b + 4 <= size:
                s0 += row[b] * local[b]
                s1 += row[b + 1] * local[b + 1]
                s2 += row[b + 2] * local[b + 2]
                s3 += row[b + 3] * local[b + 3]
                b += 4
            for d in range(b, size):
                s0 += row[d] * local[d]
            local[p] = (value - ((s0 + s1) + (s2 + s3))) * row[p]
        for a in range(pivots):
            x[plan.rows[first + a]] = local[a]


def memory(plan):
    """Sizes of the arrays panels, stack and work that `factor` and `solve` fill."""
    largest = int(np.diff(plan.first_row).max(initial=0))
    return int(plan.panel[-1]), max(1, plan.stack_size), max(1, largest**2)
