"""Pairs of neighbouring disks in a periodic (or open) box, by a cell list."""

import numpy as np

from granforce.numerics.lanes import compiled, within


@compiled
def find_pairs(x, r, box, cutoff):
    """All pairs with gap < cutoff, each periodic image apart.

    x (N, 2), r (N,), box (2,) with inf for an open direction. Returns i, j (P,) with i < j and
    shift (P, 2): the image of j at x_j + shift · box is the neighbour of i.
    """
    n = x.shape[0]
    reach = 2.0 * r.max() + cutoff
    cells = np.ones(2, np.int64)
    low = np.zeros(2)
    size = np.ones(2)
    for k in range(2):
        if np.isfinite(box[k]):
            size[k] = box[k]
        else:
            low[k] = x[:, k].min()
            size[k] = x[:, k].max() - low[k] + 1e-12
        cells[k] = max(1, min(int(size[k] / reach), int(2 * np.sqrt(n)) + 1))
    periodic = np.isfinite(box)
    # Fewer than three cells along a periodic side: one pair may touch through several images, or
    # the stencil would visit a cell twice; there every image is tried in turn.
    for k in range(2):
        if periodic[k] and cells[k] < 3:
            return _every_image(x, r, box, cutoff, reach)
    return _by_cells(x, r, box, cutoff, low, size, cells)


@within
def _every_image(x, r, box, cutoff, reach):
    n = x.shape[0]
    reach_shift = np.zeros(2, np.int64)
    for k in range(2):
        if np.isfinite(box[k]):
            reach_shift[k] = int(np.ceil(reach / box[k]))
    rows = [(0, 0, 0, 0)]
    for i in range(n):
        for j in range(i + 1, n):
            base = np.zeros(2, np.int64)
            for k in range(2):
                if np.isfinite(box[k]):
                    base[k] = -int(np.round((x[j, k] - x[i, k]) / box[k]))
            for sx in range(-reach_shift[0], reach_shift[0] + 1):
                for sy in range(-reach_shift[1], reach_shift[1] + 1):
                    _append(rows, x, r, box, cutoff, i, j, base[0] + sx, base[1] + sy)
    return _columns(rows)


@within
def _append(rows, x, r, box, cutoff, i, j, sx, sy):
    dx = x[j, 0] - x[i, 0] + (sx * box[0] if sx != 0 else 0.0)
    dy = x[j, 1] - x[i, 1] + (sy * box[1] if sy != 0 else 0.0)
    reach = r[i] + r[j] + cutoff
    if dx * dx + dy * dy < reach * reach:
        rows.append((i, j, sx, sy))


@within
def _by_cells(x, r, box, cutoff, low, size, cells):
    n = x.shape[0]
    cell = np.empty((n, 2), np.int64)
    first = np.full((cells[0], cells[1]), -1, np.int64)
    after = np.empty(n, np.int64)
    for i in range(n):
        for k in range(2):
            u = (x[i, k] - low[k]) / size[k]
            if np.isfinite(box[k]):
                u -= np.floor(u)
            cell[i, k] = min(int(u * cells[k]), cells[k] - 1)
        a, b = cell[i, 0], cell[i, 1]
        after[i] = first[a, b]
        first[a, b] = i
    rows = [(0, 0, 0, 0)]
    for i in range(n):
        for da in range(-1, 2):
            a = cell[i, 0] + da
            if np.isfinite(box[0]):
                a %= cells[0]
            elif a < 0 or a >= cells[0]:
                continue
            for db in range(-1, 2):
                b = cell[i, 1] + db
                if np.isfinite(box[1]):
                    b %= cells[1]
                elif b < 0 or b >= cells[1]:
                    continue
                j = first[a, b]
                while j >= 0:
                    if j > i:
                        sx = sy = 0
                        if np.isfinite(box[0]):
                            sx = -int(np.round((x[j, 0] - x[i, 0]) / box[0]))
                        if np.isfinite(box[1]):
                            sy = -int(np.round((x[j, 1] - x[i, 1]) / box[1]))
                        _append(rows, x, r, box, cutoff, i, j, sx, sy)
                    j = after[j]
    return _columns(rows)


@within
def _columns(rows):
    # rows[0] only told the compiler the type of the list.
    count = len(rows) - 1
    i = np.empty(count, np.int64)
    j = np.empty(count, np.int64)
    shift = np.empty((count, 2), np.int64)
    for k in range(count):
        i[k], j[k], shift[k, 0], shift[k, 1] = rows[k + 1]
    return i, j, shift


@compiled
def separations(x, r, box, i, j, shift):
    """Unit vectors i → j (P, 2), centre distances (P,) and gaps (P,) of the listed pairs."""
    count = i.shape[0]
    normal = np.empty((count, 2))
    length = np.empty(count)
    gap = np.empty(count)
    for c in range(count):
        for k in range(2):
            s = shift[c, k]
            normal[c, k] = x[j[c], k] - x[i[c], k] + (s * box[k] if s != 0 else 0.0)
        length[c] = np.hypot(normal[c, 0], normal[c, 1])
        gap[c] = length[c] - r[i[c]] - r[j[c]]
        normal[c, 0] /= length[c]
        normal[c, 1] /= length[c]
    return normal, length, gap
