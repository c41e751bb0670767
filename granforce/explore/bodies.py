"""S drawn whole where it has three dimensions or fewer: its corners, its sides, and where it ends.

In cone coordinates S = {y ≥ 0 : A y = b}. Orthonormal coordinates u of its affine hull, in the
metric of the 2 N_c forces, make of every y_k ≥ 0 a half-space: a contact slides one way at its
other side (f_t = ±μ f_n), or opens (f_n = 0). Corners are found by Qhull's half-space intersection
around a point inside, and then solved for from the sides that meet in them, to rounding. Where S
has no end in some direction, the half-spaces are cut far outside; the corners there give the rays
along which it goes on, which are certified (A d = 0, d ≥ 0).
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.spatial import HalfspaceIntersection

from granforce import notebook
from granforce.explore.thin import null_space
from granforce.explore.walls import inner_point
from granforce.forces.ensemble import Ensemble, ensemble
from granforce.numerics import certificates
from granforce.records import Floats, InputError, Integers, Packing
from granforce.tolerances import BALANCED, FLAT

MOST_DIMENSIONS = 3
# Far outside: this many times as large as a network inside.
_FAR = 1e4
# Cone coordinates that change less than this along S do not change.
_STILL = 1e-12
# Corners nearer than this to a side, relative to their own size, lie in it.
_IN_SIDE = 1e-9

OPENS, SLIDES_BACK, SLIDES = 0, -1, 1  # f_n = 0, f_t = −μ f_n, f_t = μ f_n


class Side(NamedTuple):
    """A side of S: an end (h = 1), an edge of the polygon (2) or a face of the body (3)."""

    corners: Integers  # (k,) positions in Body.corners; at h = 3 in order around the face
    stops: tuple[tuple[int, int], ...]  # (number in the packing, OPENS, SLIDES or SLIDES_BACK)
    normal: Floats  # (h,) unit vector out of S


class Body(NamedTuple):
    """S as a point, a segment, a polygon or a body, in h orthonormal coordinates u."""

    origin: Floats  # (N_c, 2) the network at u = 0, force
    axes: Floats  # (h, N_c, 2) networks of length 1: F = origin + u · axes
    corners: Floats  # (V, h) force
    rays: Floats  # (R, h) unit vectors along which S has no end; none where it is bounded
    sides: tuple[Side, ...]  # of Side

    @property
    def bounded(self) -> bool:
        """Whether S has an end everywhere."""
        return not len(self.rays)

    def forces(self, u: Floats) -> Floats:
        """Networks (…, N_c, 2) at points u (…, h)."""
        return self.origin + np.tensordot(u, self.axes, axes=1)

    @property
    def intervals(self) -> tuple[Floats, Floats]:
        """Least and largest f_n, f_t (N_c, 2) of the contacts; ±inf where there is no end."""
        low, high = self.forces(self.corners).min(axis=0), self.forces(self.corners).max(axis=0)
        for along in np.tensordot(self.rays, self.axes, axes=1):
            high = np.where(along > FLAT, np.inf, high)
            low = np.where(along < -FLAT, -np.inf, low)
        return low, high

    def _repr_html_(self) -> str:
        """The body as notebooks show it."""
        lines = {"dimension h": len(self.axes), "corners": len(self.corners)}
        return notebook.table("S, whole", lines | {"has an end everywhere": self.bounded})


def body(S: Ensemble) -> Body:
    """The Body of an Ensemble S of at most MOST_DIMENSIONS dimensions.

    Raises InputError where there are more, or forces are known.
    """
    if S.known is not None:
        raise InputError("S is drawn whole only where no forces are known: leave them out")
    A, b, T = S.scaled_form
    y, held = inner_point(A, b)
    moving = np.flatnonzero(~held)
    null = null_space(A.toarray()[:, moving])
    h = null.shape[1]
    if h > MOST_DIMENSIONS:
        raise InputError(f"S has {h} dimensions; up to {MOST_DIMENSIONS} can be drawn whole")
    y = _balanced(A.toarray(), b, y, moving)
    scale = S.force_scale
    x = np.zeros((T.shape[1], h))
    x[moving] = null
    turned, stretch = np.linalg.qr(T @ x)
    slopes = null @ np.linalg.inv(stretch)
    corners, rays, members = _corners(slopes, y[moving], A, moving)
    axes = S.to_forces(turned.T)
    sides = _sides(S, slopes, moving, corners, members)
    return Body(S.to_forces(scale * (T @ y)), axes, scale * corners, rays, sides)


def fall(packing: Packing, mu: float | None = None) -> Floats | None:
    """The motion (N, 3) of the grains, velocity and r ω, that proves that nothing balances.

    Loads do work in it, and no admissible force on a contact takes any: Aᵀu ≥ 0 in cone coordinates
    (Farkas). Its largest entry is 1. None where S is not empty, or no proof was found.
    """
    whole = ensemble(packing, mu, prune=False)
    A, b, _ = whole.scaled_form
    ray = certificates.empty_ray(A, b)
    if ray is None:
        return None
    rows, _ = whole.cone_form
    largest = abs(rows).max(axis=1).toarray().ravel()
    size = 1 + whole.per_contact
    moved = -(ray / np.where(largest > 0, largest, 1.0))[: size * len(whole.grains)]
    motion = np.zeros((len(packing.r), 3))
    motion[whole.grains, :size] = moved.reshape(-1, size)
    return motion / (np.abs(motion).max() or 1.0)


def _balanced(A: sparse.csr_matrix, b: Floats, y: Floats, moving: Integers) -> Floats:
    """y with what its program left unbalanced spread over what moves."""
    y = y.copy()
    for _ in range(3):
        y[moving] += np.linalg.pinv(A[:, moving] * y[moving]) @ (b - A @ y) * y[moving]
    if np.abs(A @ y - b).max(initial=0.0) > BALANCED:
        raise InputError("S has no point inside that balances; change μ slightly")
    return y


def _corners(
    slopes: Floats, inner: Floats, A: sparse.csr_matrix, moving: Integers
) -> tuple[Floats, Floats, dict[Any, Any]]:
    """Corners (V, h) and rays (R, h) of {u : inner + slopes u ≥ 0}, and {row: corners in it}."""
    h = slopes.shape[1]
    size = np.linalg.norm(slopes, axis=1)
    rows = np.flatnonzero(size > _STILL)
    if h == 0:
        return np.zeros((1, 0)), np.zeros((0, 0)), {}
    slope, rest = slopes[rows] / size[rows, None], inner[rows] / size[rows]
    open_ended = certificates.recession(A[:, moving]) is not None
    total, reach = slopes.sum(axis=0), _FAR * inner.sum()
    if open_ended:
        slope = np.vstack([slope, -total / np.linalg.norm(total)])
        rest = np.append(rest, reach / np.linalg.norm(total))
    found = _meetings(slope, rest)
    near = np.abs(rest + found @ slope.T)
    in_side = near <= _IN_SIDE * (1 + np.linalg.norm(found, axis=1))[:, None]
    far = in_side[:, -1] if open_ended else np.zeros(len(found), bool)
    real = slice(None, -1) if open_ended else slice(None)
    # To rounding, from the sides that meet there.
    sides = [np.flatnonzero(member[real]) for member in in_side[~far]]
    corners = [np.linalg.lstsq(slope[some], -rest[some], rcond=None)[0] for some in sides]
    rays = [_along(slope[real], member[real], total) for member in in_side[far]]
    members = {int(row): np.flatnonzero(in_side[~far][:, k]) for k, row in enumerate(rows)}
    return np.reshape(corners, (-1, h)), np.reshape(rays, (-1, h)), members


def _meetings(slope: Floats, rest: Floats) -> Floats:
    """Points (V, h) where sides rest + slope u ≥ 0 around u = 0 meet."""
    if slope.shape[1] == 1:
        up, down = slope[:, 0] > 0, slope[:, 0] < 0
        return np.array([[-rest[up].min()], [rest[down].min()]])
    found = HalfspaceIntersection(
        np.column_stack([-slope, -rest]), np.zeros(slope.shape[1])
    ).intersections
    found = found[np.all(np.isfinite(found), axis=1)]
    scale = 1 + np.linalg.norm(found, axis=1)
    apart = np.linalg.norm(found[:, None] - found[None], axis=-1) > _IN_SIDE * scale[:, None]
    first = [k for k in range(len(found)) if np.all(apart[k, :k])]
    return found[first]


def _along(slope: Floats, member: Any, total: Floats) -> Floats:
    """The direction that stays in all of these sides and goes outwards."""
    direction = np.linalg.svd(slope[member])[2][-1] if member.any() else np.ones(len(total))
    return direction * np.sign(direction @ total) / np.linalg.norm(direction)


def _sides(
    S: Ensemble, slopes: Floats, moving: Integers, corners: Floats, members: Any
) -> tuple[Side, ...]:
    """Sides of rows that meet the body in one of full size, those of one place together."""
    h = slopes.shape[1]
    stops: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    places: dict[tuple[int, ...], int] = {}
    for row, inside in members.items():
        if len(inside) >= max(1, h - 1):
            stops.setdefault(tuple(inside.tolist()), []).append(_stop(S, int(moving[row])))
            places[tuple(inside.tolist())] = row
    sides = []
    for inside, labels in stops.items():
        normal = -slopes[places[inside]] / np.linalg.norm(slopes[places[inside]])
        order = np.array(inside)
        if h == 3:
            order = order[_around(corners[order], normal)]
        sides.append(Side(order, tuple(_joined(labels)), normal))
    return tuple(sides)


def _stop(S: Ensemble, column: int) -> tuple[int, int]:
    """(contact, what stops there) of a cone coordinate that is 0."""
    if S.mu == 0:
        return int(S.index[column]), OPENS
    return int(S.index[column // 2]), SLIDES if column % 2 else SLIDES_BACK


def _joined(labels: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Stops, a contact that slides both ways being one that opens."""
    both = {}
    for contact, what in labels:
        both[contact] = OPENS if contact in both else what
    return sorted(both.items())


def _around(points: Floats, normal: Floats) -> Integers:
    """The order of points (k, 3) of a plane around their middle."""
    across = np.linalg.svd(normal[None])[2][1:]
    flat = (points - points.mean(axis=0)) @ across.T
    return np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))
