"""All of S in up to three dimensions: its corners, sides and rays.

In cone coordinates S = {y ≥ 0 : A y = b}. Orthonormal coordinates u of its affine hull, in the
metric of the 2 N_c forces, turn every y_k ≥ 0 into a half-space, at whose boundary a contact slides
one way (f_t = ±μ f_n) or opens (f_n = 0). In homogeneous coordinates (u, t) corners u/t and the
rays of an S without end, t = 0, are the edges of one cone. Qhull finds the edges, as the corners of
a section through the cone; each is then solved for from the sides that meet in it, to rounding. A
ray counts as one where it is certified: A d = 0, d ≥ 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated, NamedTuple

import numpy as np
from scipy.spatial import HalfspaceIntersection

from granforce import notebook
from granforce.explore.thin import null_space
from granforce.fields import record
from granforce.forces import hull
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.numerics import certificates, inner_point
from granforce.quantities import FORCE, Field
from granforce.records import InputError, Packing, takes
from granforce.types import Floats, Integers, Mask

MOST_DIMENSIONS = 3
# Coordinates y, in ⟨f_n⟩, up to which an inner point counts as close to usual forces.
_USUAL = 10.0
# Along a ray no y decreases faster than this, relative to the fastest; smaller rates are rounding.
_RAY = 1e-12
# Least cosine between a ray and Qhull's result.
_PARALLEL = 1 - 1e-6
# Distance below which a point is on a wall, relative to the terms whose difference it is.
_ON_WALL, _ROUNDING = 1e-11, 1e-14
# Least singular value of unit normals of walls that meet in one point.
_SINGULAR = 1e-13

OPENS, SLIDES_BACK, SLIDES = 0, -1, 1  # f_n = 0, f_t = −μ f_n, f_t = μ f_n


@record
class Side(NamedTuple):
    """A side of S: an end (h = 1), an edge of the polygon (2) or a face of the body (3)."""

    corners: Annotated[
        Integers, "(k,) positions in Body.corners; at h = 3 in order around the face"
    ]
    stops: Annotated[
        tuple[tuple[int, int], ...], "(number in the packing, OPENS, SLIDES or SLIDES_BACK)"
    ]
    normal: Annotated[Floats, "(h,) unit vector out of S"]


@record
class Body(NamedTuple):
    """S as a point, a segment, a polygon or a body, in h orthonormal coordinates u."""

    origin: Annotated[Floats, Field("contact component", FORCE, "the network at u = 0")]
    axes: Annotated[
        Floats, Field("direction contact component", "", "of length 1: F = origin + u · axes")
    ]
    corners: Annotated[Floats, Field("corner direction", FORCE, "corners u of S")]
    rays: Annotated[Floats, Field("ray direction", "", "unit vectors along which S is unbounded")]
    sides: Annotated[tuple[Side, ...], "its sides"]

    @property
    def bounded(self) -> bool:
        """Whether S is bounded."""
        return not len(self.rays)

    def forces(self, u: Floats) -> Floats:
        """Networks (…, N_c, 2) at points u (…, h)."""
        return self.origin + np.tensordot(u, self.axes, axes=1)

    @property
    def intervals(self) -> tuple[Floats, Floats]:
        """Least and largest f_n, f_t (N_c, 2) of the contacts; ±inf where unbounded."""
        low, high = self.forces(self.corners).min(axis=0), self.forces(self.corners).max(axis=0)
        for along in np.tensordot(self.rays, self.axes, axes=1):
            high = np.where(along > 10 * _RAY, np.inf, high)
            low = np.where(along < -10 * _RAY, -np.inf, low)
        return low, high

    def _repr_html_(self) -> str:
        """HTML for notebooks."""
        lines = {"dimension h": len(self.axes), "corners": len(self.corners)}
        return notebook.table("S, whole", lines | {"bounded": self.bounded})


@takes(Ensemble)
def body(S: Ensemble) -> Body:
    """The Body of an Ensemble S of at most three dimensions.

    Certificates decide where S is unbounded: a ray balances without load and leaves no cone, both
    to a relative 10⁻¹². Just below the friction μ′ at which S becomes unbounded (the tangent of
    half the angle of a groove), rounding moves far corners by a relative 10⁻¹⁴/(1 − μ/μ′): measured
    in grooves of 10° to 179°, they are right to 10⁻⁹ up to 1 − μ/μ′ = 10⁻⁵.

    Parameters
    ----------
    S : Ensemble
        Of dimension h ≤ 3.

    Returns
    -------
    Body
        The network at its origin, its axes and corners, and rays along which S is unbounded.

    Raises
    ------
    InputError
        If S has more dimensions, or if forces are known.
    """
    if S.informed.any():
        raise InputError("gf.body does not accept known forces: leave them out")
    h = S.dimension
    if h > MOST_DIMENSIONS:
        raise InputError(f"S has {h} dimensions; gf.body accepts at most {MOST_DIMENSIONS}")
    # By forces, not cone coordinates: their f_t, μ times a difference, is rounded μ times as much.
    origin = _inner(S)
    axes = np.zeros((S.A.shape[1], h))
    axes[S.free] = null_space(hull.constraints(S, S.hull.held).toarray(), h)
    walls, moving = hull.distances(S), np.flatnonzero(~S.hull.held)
    slopes = (walls @ axes)[moving]
    shape = _shape(slopes, (walls @ origin)[moving])
    corners, rays = S.force_scale * shape.corners @ shape.stretch, shape.rays @ shape.stretch
    sides = _sides(S, shape, slopes, moving)
    origin = S.to_forces(S.force_scale * origin)
    return Body(origin, S.to_forces(axes.T), corners, _unit(rays), sides)


@takes(Packing)
def fall(packing: Packing, mu: float | None = None) -> Floats | None:
    """The motion of the grains that proves that nothing balances.

    Loads do work in this motion, and no admissible contact force absorbs any: Aᵀu ≥ 0 in cone
    coordinates (Farkas).

    Parameters
    ----------
    packing : Packing
        The packing.
    mu : float, optional
        Friction coefficient, by default the packing's.

    Returns
    -------
    (N, 3) array or None
        Velocity and r ω; the largest entry is 1. None if S is not empty, or no proof was found.
    """
    whole = ensemble(packing, mu, prune=False)
    A, b, _ = whole.scaled_form
    ray = certificates.empty_ray(A, b)
    if ray is None:
        return None
    rows, _ = whole.cone_form
    largest = abs(rows).max(axis=1).toarray().ravel()
    size = whole.per_grain
    moved = -(ray[: len(largest)] / np.where(largest > 0, largest, 1.0))[: size * len(whole.grains)]
    motion = np.zeros((len(packing.r), 3))
    motion[whole.grains, :size] = moved.reshape(-1, size)
    return motion / (np.abs(motion).max() or 1.0)


def _inner(S: Ensemble) -> Floats:
    """Forces (unknowns,) inside S, in ⟨f_n⟩, balanced to rounding.

    They are of the usual size: the centre of an elongated S lies far out.
    """
    A, y = S.scaled_form[0], S.hull.inner
    if not S.hull.held.any() and y.max(initial=0.0) > _USUAL:
        near = inner_point.inner_point(A, S.hull.b)
        y = y if near.held.any() else near.y
    x = S.scaled_form[2] @ y
    return inner_point.balanced(S.A.tocsc(), S.b / S.force_scale, x)[0]


class _Shape(NamedTuple):
    """S in coordinates w around a point inside, with walls at distances of order 1 from it."""

    walls: Floats  # (n, h) Q: wall k is at Q_k·w = −1
    stretch: Floats  # (h, h) converts w to orthonormal coordinates of force: u = w · stretch
    corners: Floats  # (V, h)
    rays: Floats  # (R, h)
    at_corner: Mask  # (V, n) walls that meet in each corner
    at_ray: Mask  # (R, n) walls along which each ray runs


def _shape(slopes: Floats, inner: Floats) -> _Shape:
    """The _Shape of {u : inner + slopes u ≥ 0}, slopes (n, h), inner (n,)."""
    n, h = slopes.shape
    walls, root = np.linalg.qr(slopes / inner[:, None])
    stretch = np.linalg.inv(root).T
    corners: dict[bytes, tuple[Floats, Mask]] = {}
    rays: dict[bytes, tuple[Floats, Mask]] = {}
    for w, t, defining in _meetings(walls):
        meeting = _on(walls, w, t)
        meeting[defining] = True
        ray = _along(walls[meeting], w) if h else w
        change = slopes @ (ray @ stretch)
        change = change / max(np.abs(change).max(initial=0.0), 1e-300)
        if h and change.min() >= -_RAY and ray @ w > _PARALLEL * np.linalg.norm(w):
            along = change <= 10 * _RAY
            rays.setdefault(along.tobytes(), (ray, along))
            continue
        w = np.linalg.lstsq(walls[meeting], -np.ones(meeting.sum()), rcond=_SINGULAR)[0]
        meeting = _on(walls, w, 1.0)
        if np.linalg.matrix_rank(_unit(walls[meeting]), _SINGULAR) == h:
            corners.setdefault(meeting.tobytes(), (w, meeting))
    sides = [
        (
            np.reshape([w for w, _ in ends], (len(ends), h)),
            np.reshape([at for _, at in ends], (len(ends), n)).astype(np.bool_),
        )
        for ends in (list(corners.values()), list(rays.values()))
    ]
    return _Shape(walls, stretch, sides[0][0], sides[1][0], sides[0][1], sides[1][1])


def _unit(vectors: Floats) -> Floats:
    """Vectors (…, h) scaled to length 1; those of length 0 as they are."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)


def _along(walls: Floats, w: Floats) -> Floats:
    """The unit vector along all these walls, nearest to w."""
    direction = np.linalg.svd(walls)[2][-1] if len(walls) else w
    return _unit(direction * np.sign(direction @ w or 1.0))


def _on(walls: Floats, w: Floats, t: float) -> Mask:
    """(n,) walls that contain the point w/t, to rounding."""
    length = np.linalg.norm(w)
    size = np.linalg.norm(walls, axis=1) * length + t
    return np.abs(walls @ w + t) <= _ON_WALL * size + _ROUNDING * np.hypot(length, t)


def _meetings(walls: Floats) -> list[tuple[Floats, float, list[int]]]:
    """(w, t, walls) of the ends of {w : Q w ≥ −1}: corners w/t or, if t = 0, rays w.

    In homogeneous coordinates (w, t) corners and rays are the edges of one cone, and the corners of
    a bounded section through it.
    """
    h, which = walls.shape[1], _different(walls)
    if h == 0:
        return [(np.zeros(0), 1.0, [])]
    rows = np.column_stack([walls[which], np.ones(len(which))])
    rows = np.vstack([rows, np.append(np.zeros(h), 1.0)])
    # Across the sum of all rows, which grows along every edge.
    across = np.linalg.svd(rows.sum(axis=0)[None])[2][1:]
    slope = rows @ across.T
    if h == 1:
        facets = [[int(np.argmax(slope))], [int(np.argmin(slope))]]
        corners = -1 / slope[np.ravel(facets)]
    else:
        met = HalfspaceIntersection(np.column_stack([-slope, -np.ones(len(slope))]), np.zeros(h))
        corners, facets = met.intersections, met.dual_facets
    ends = np.append(np.zeros(h), 1.0) + corners @ across
    defining = [[int(which[k]) for k in facet if k < len(which)] for facet in facets]
    return [(end[:-1], float(end[-1]), some) for end, some in zip(ends, defining, strict=True)]


def _different(walls: Floats) -> Integers:
    """The first wall in each place, without walls at infinity."""
    size = np.linalg.norm(walls, axis=1)
    apart = np.linalg.norm(walls[:, None] - walls[None], axis=-1) > _ON_WALL * size[:, None]
    return np.flatnonzero([size[k] > 0 and np.all(apart[k, :k]) for k in range(len(walls))])


def _sides(S: Ensemble, shape: _Shape, slopes: Floats, moving: Integers) -> tuple[Side, ...]:
    """Sides: walls that meet S in a full side; walls in one place together."""
    h = len(shape.stretch)
    ends = [np.pad(shape.corners, ((0, 0), (0, 1)), constant_values=1.0)]
    ends.append(np.pad(shape.rays, ((0, 0), (0, 1))))
    edges, meets = _unit(np.vstack(ends)), np.vstack([shape.at_corner, shape.at_ray])
    places: dict[bytes, list[int]] = {}
    for k in range(len(moving) if h else 0):
        if np.linalg.matrix_rank(edges[meets[:, k]], _SINGULAR) == h:
            places.setdefault(meets[:, k].tobytes(), []).append(k)
    return tuple(_side(S, shape, slopes, moving, walls) for walls in places.values())


def _side(
    S: Ensemble, shape: _Shape, slopes: Floats, moving: Integers, walls: Sequence[int]
) -> Side:
    """The Side of walls (positions in moving) in one place."""
    first = walls[0]
    corners, normal = np.flatnonzero(shape.at_corner[:, first]), -_unit(slopes[first])
    if len(normal) == 3:
        points, rays = shape.corners[corners], shape.rays[shape.at_ray[:, first]]
        corners = corners[_around(points @ shape.stretch, rays @ shape.stretch, normal)]
    return Side(corners, tuple(_joined(_stop(S, int(moving[k])) for k in walls)), normal)


def _stop(S: Ensemble, column: int) -> tuple[int, int]:
    """(contact, event) of a cone coordinate that is 0."""
    if S.mu == 0:
        return int(S.index[column]), OPENS
    return int(S.index[column // 2]), SLIDES if column % 2 else SLIDES_BACK


def _joined(labels: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Stops in which a contact that slides both ways counts as opening."""
    both = {}
    for contact, what in labels:
        both[contact] = OPENS if contact in both else what
    return sorted(both.items())


def _around(points: Floats, rays: Floats, normal: Floats) -> Integers:
    """The order of points (k, 3) of a plane around their centre, starting at the rays (r, 3)."""
    across = np.linalg.svd(normal[None])[2][1:]
    flat = (points - points.mean(axis=0)) @ across.T
    angle = np.arctan2(flat[:, 1], flat[:, 0])
    if len(rays):
        out = rays.sum(axis=0) @ across.T
        angle = (angle - np.arctan2(out[1], out[0])) % (2 * np.pi)
    return np.argsort(angle)
