"""Grains on the outside of a frame, or at its hole, from their positions alone."""

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import Delaunay, QhullError

from granforce.types import Floats, Integers

# Largest circumradius of triangles of neighbours, in mean radii: includes triangles around a single
# missing grain, but not those that bridge a bay of the outside.
_CIRCLE = 4.0
# A hole this many mean radii across belongs to an inner wall, not to missing grains.
_HOLE = 12.0


def boundary(x: Floats, r: Floats) -> Integers:
    """(N,) 1 for grains on the outside, −1 at the largest hole if it is large, and 0 elsewhere.

    x (N, 2), r (N,). Uses the edges of the alpha shape of the centres (Edelsbrunner, Kirkpatrick,
    Seidel, IEEE Trans. Inf. Theory 29, 551 (1983)).
    """
    edge = np.ones(len(x), dtype=np.int64)
    try:
        triangles = Delaunay(x).simplices
    except QhullError:  # fewer than three grains, or all collinear
        return edge
    corner = x[triangles]
    sides = np.stack([corner[:, k] - corner[:, k - 1] for k in range(3)], axis=1)
    area = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]) / 2
    product = np.hypot(*sides.transpose(2, 0, 1)).prod(axis=1)
    triangles = triangles[product <= 4 * area * _CIRCLE * r.mean()]
    if not len(triangles):
        return edge
    edges = np.sort(np.concatenate([triangles[:, [k, k - 1]] for k in range(3)]), axis=1)
    edges, times = np.unique(edges, axis=0, return_counts=True)
    i, j = edges[times == 1].T
    graph = sparse.coo_matrix((np.ones(len(i)), (i, j)), shape=(len(x), len(x)))
    _, ring = csgraph.connected_components(graph, directed=False)
    at = np.unique(np.concatenate([i, j]))
    edge[np.unique(triangles)] = 0
    width = {one: np.ptp(x[at[ring[at] == one]], axis=0).max() for one in np.unique(ring[at])}
    widest = sorted(width, key=lambda one: -width[one])
    edge[at[ring[at] == widest[0]]] = 1
    if len(widest) > 1 and width[widest[1]] > _HOLE * r.mean():
        edge[at[ring[at] == widest[1]]] = -1
    return edge
