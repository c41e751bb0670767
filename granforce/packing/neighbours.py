"""Pairs of neighbouring disks in a periodic, open or tilted cell, from a cell list."""

import numpy as np

from granforce.cell import Cell
from granforce.numerics.lanes import allocating, allocating_part, within
from granforce.types import Floats, Integers


def find_pairs(
    x: Floats, r: Floats, cell: Cell, cutoff: float
) -> tuple[Integers, Integers, Integers]:
    """All pairs with gap < cutoff, each periodic image separately.

    x (N, 2), r (N,). Returns i, j (P,) with i < j and shift (P, 2): the image of j at x_j + shift ·
    cell.vectors is the neighbour of i.
    """
    box, periodic = cell.box, np.isfinite(cell.box)
    reach, most = 2.0 * r.max() + cutoff, int(2 * np.sqrt(len(r))) + 1
    low = np.where(periodic, 0.0, x.min(axis=0))
    size = np.where(periodic, box, x.max(axis=0) - low + 1e-12)
    high = np.where(periodic, cell.heights, size)
    cells = np.maximum(1, np.minimum(high / reach, most).astype(np.int64))
    # With fewer than three cells along a periodic side, one pair may touch through several images,
    # or the stencil would visit a cell twice; then every image is tried in turn.
    if np.any(periodic & (cells < 3)):
        images = np.where(periodic, np.ceil(reach / high), 0.0).astype(np.int64)
        return _every_image(x, r, cell, cutoff, images)
    along = np.stack([x[:, 0] - cell.tilt * (x[:, 1] / box[1]), x[:, 1]], axis=1)
    u = (along - low) / size
    u -= np.where(periodic, np.floor(u), 0.0)
    place = np.minimum((u * cells).astype(np.int64), cells - 1)
    return _by_cells(x, r, cell, cutoff, place, np.full(cells, -1))


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


@allocating
def _every_image(x, r, cell, cutoff, images):
    """Pairs from all images up to `images` (2,) beyond the nearest along each side."""
    n = x.shape[0]
    rows = [(0, 0, 0, 0)]
    for i in range(n):
        for j in range(i + 1, n):
            base_x, base_y = _nearest_shift(cell, x[j, 0] - x[i, 0], x[j, 1] - x[i, 1])
            for s_x in range(base_x - images[0], base_x + images[0] + 1):
                for s_y in range(base_y - images[1], base_y + images[1] + 1):
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


@allocating
def _by_cells(x, r, cell, cutoff, place, first):
    """Pairs in neighbouring cells; place (N, 2): the cell of each disk, first: −1 per cell."""
    n = x.shape[0]
    box, cells = cell.box, first.shape
    after = np.empty(n, np.int64)
    for i in range(n):
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
