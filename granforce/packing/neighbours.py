"""Pairs of neighbouring disks in a periodic, open or tilted cell, from a cell list."""

import numpy as np

from granforce.numerics.lanes import allocating, allocating_part, within


@allocating
def find_pairs(x, r, cell, cutoff):
    """All pairs with gap < cutoff, each periodic image separately.

    x (N, 2), r (N,), cell: a Cell. Returns i, j (P,) with i < j and shift (P, 2): the image of j at
    x_j + shift · cell.vectors is the neighbour of i.
    """
    n = x.shape[0]
    box = cell.box
    reach = 2.0 * r.max() + cutoff
    cells = np.ones(2, np.int64)
    low = np.zeros(2)
    size = np.ones(2)
    high = _heights(cell)
    for k in range(2):
        if np.isfinite(box[k]):
            size[k] = box[k]
        else:
            low[k] = x[:, k].min()
            size[k] = x[:, k].max() - low[k] + 1e-12
            high[k] = size[k]
        cells[k] = max(1, min(int(high[k] / reach), int(2 * np.sqrt(n)) + 1))
    periodic = np.isfinite(box)
    # With fewer than three cells along a periodic side, one pair may touch through several images,
    # or the stencil would visit a cell twice; then every image is tried in turn.
    for k in range(2):
        if periodic[k] and cells[k] < 3:
            return _every_image(x, r, cell, cutoff, reach)
    return _by_cells(x, r, cell, cutoff, low, size, cells)


@allocating_part
def _heights(cell):
    """Distances between opposite sides of the cell, along a and b."""
    high = cell.box.copy()
    if cell.tilt != 0.0:
        high[0] *= cell.box[1] / np.hypot(cell.tilt, cell.box[1])
    return high


@within
def _across(cell, d_x, d_y):
    """Component of a step along a, in length along x; equal to d_x in a cell without tilt."""
    return d_x - cell.tilt * (d_y / cell.box[1])


@within
def _nearest_shift(cell, d_x, d_y):
    """The image that reduces a step to at most half of a and of b."""
    s_x = s_y = 0
    if np.isfinite(cell.box[0]):
        s_x = -int(np.round(_across(cell, d_x, d_y) / cell.box[0]))
    if np.isfinite(cell.box[1]):
        s_y = -int(np.round(d_y / cell.box[1]))
    return s_x, s_y


@allocating_part
def _every_image(x, r, cell, cutoff, reach):
    n = x.shape[0]
    reach_shift = np.zeros(2, np.int64)
    high = _heights(cell)
    for k in range(2):
        if np.isfinite(cell.box[k]):
            reach_shift[k] = int(np.ceil(reach / high[k]))
    rows = [(0, 0, 0, 0)]
    for i in range(n):
        for j in range(i + 1, n):
            base_x, base_y = _nearest_shift(cell, x[j, 0] - x[i, 0], x[j, 1] - x[i, 1])
            for s_x in range(base_x - reach_shift[0], base_x + reach_shift[0] + 1):
                for s_y in range(base_y - reach_shift[1], base_y + reach_shift[1] + 1):
                    _append(rows, x, r, cell, cutoff, i, j, s_x, s_y)
    return _columns(rows)


@allocating_part
def _append(rows, x, r, cell, cutoff, i, j, s_x, s_y):
    d_x, d_y = _step(x, cell, i, j, s_x, s_y)
    reach = r[i] + r[j] + cutoff
    if d_x * d_x + d_y * d_y < reach * reach:
        rows.append((i, j, s_x, s_y))


@within
def _step(x, cell, i, j, s_x, s_y):
    """Vector from the centre of i to that of an image of j."""
    d_x = x[j, 0] - x[i, 0] + (s_x * cell.box[0] if s_x != 0 else 0.0)
    d_y = x[j, 1] - x[i, 1] + (s_y * cell.box[1] if s_y != 0 else 0.0)
    return d_x + s_y * cell.tilt, d_y


@allocating_part
def _by_cells(x, r, cell, cutoff, low, size, cells):
    n = x.shape[0]
    box = cell.box
    place = np.empty((n, 2), np.int64)
    first = np.full((cells[0], cells[1]), -1, np.int64)
    after = np.empty(n, np.int64)
    for i in range(n):
        along = _across(cell, x[i, 0], x[i, 1]), x[i, 1]
        for k in range(2):
            u = (along[k] - low[k]) / size[k]
            if np.isfinite(box[k]):
                u -= np.floor(u)
            place[i, k] = min(int(u * cells[k]), cells[k] - 1)
        a, b = place[i, 0], place[i, 1]
        after[i] = first[a, b]
        first[a, b] = i
    rows = [(0, 0, 0, 0)]
    for i in range(n):
        for da in range(-1, 2):
            a = place[i, 0] + da
            if np.isfinite(box[0]):
                a %= cells[0]
            elif a < 0 or a >= cells[0]:
                continue
            for db in range(-1, 2):
                b = place[i, 1] + db
                if np.isfinite(box[1]):
                    b %= cells[1]
                elif b < 0 or b >= cells[1]:
                    continue
                j = first[a, b]
                while j >= 0:
                    if j > i:
                        s_x, s_y = _nearest_shift(cell, x[j, 0] - x[i, 0], x[j, 1] - x[i, 1])
                        _append(rows, x, r, cell, cutoff, i, j, s_x, s_y)
                    j = after[j]
    return _columns(rows)


@allocating_part
def _columns(rows):
    # rows[0] only defines the type of the list for the compiler.
    count = len(rows) - 1
    i = np.empty(count, np.int64)
    j = np.empty(count, np.int64)
    shift = np.empty((count, 2), np.int64)
    for k in range(count):
        i[k], j[k], shift[k, 0], shift[k, 1] = rows[k + 1]
    return i, j, shift


@allocating
def separations(x, r, cell, i, j, shift):
    """Unit vectors i → j (P, 2), centre distances (P,) and gaps (P,) of the listed pairs."""
    count = i.shape[0]
    normal = np.empty((count, 2))
    length = np.empty(count)
    gap = np.empty(count)
    for c in range(count):
        d_x, d_y = _step(x, cell, i[c], j[c], shift[c, 0], shift[c, 1])
        length[c] = np.hypot(d_x, d_y)
        gap[c] = length[c] - r[i[c]] - r[j[c]]
        normal[c, 0] = d_x / length[c]
        normal[c, 1] = d_y / length[c]
    return normal, length, gap
