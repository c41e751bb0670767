"""Force space seen in a plane: states of a Replay projected, and the outline of S there."""

from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from granforce import measures, study
from granforce.records import InputError

from .compute import found_or_made


class Plane(NamedTuple):
    """Two axes of force space, and where states lie in their plane. Forces are in ⟨f_n⟩."""

    components: tuple  # two (position in the backbone, 0 or 1), or empty for principal axes
    axes: np.ndarray  # (2, N_c, 2)
    origin: np.ndarray  # (2,) of the plane's coordinates
    share: np.ndarray  # (2,) of the variance of the states, NaN for components
    path: np.ndarray  # (F, 2) float32: the original network, then the states shown


class Outlined(NamedTuple):
    """The outline of S in a Plane, between polygons inside and outside."""

    plane: Plane
    inner: np.ndarray  # (k, 2) corners
    outer: np.ndarray  # (m, 2)
    gap: float  # largest distance between them
    programs: int  # linear programs it took
    seconds: float


def principal(replay):
    """The Plane of the two directions along which the states shown vary most."""
    frames = _frames(replay)
    axes, share = measures.principal_axes(frames[1:])
    return _plane(replay, (), axes, measures.mean_network(frames[1:]), share)


def components(replay, first, second):
    """The Plane of two components (position in the backbone, 0 for f_n or 1 for f_t).

    InputError for a contact that is not there, or one component named twice.
    """
    chosen = tuple(first), tuple(second)
    count = replay.normal.shape[1]
    for contact, component in chosen:
        if not 0 <= contact < count or component not in (0, 1):
            raise InputError(f"contacts are counted from 0 to {count - 1}, got {contact}")
    if first == second:
        raise InputError("choose two different components")
    axes = np.zeros((2, count, 2))
    for k, place in enumerate(chosen):
        axes[(k, *place)] = 1.0
    return _plane(replay, chosen, axes, np.zeros(axes.shape[1:]), np.full(2, np.nan))


def _frames(replay):
    return np.stack([replay.normal, replay.tangential], axis=2).astype(np.float64)


def _plane(replay, chosen, axes, centre, share):
    path = np.tensordot(_frames(replay) - centre, axes, ((1, 2), (1, 2)))
    origin = np.tensordot(axes, centre, ((1, 2), (0, 1)))
    return Plane(chosen, axes, origin, share, path.astype(np.float32))


def labels(replay, plane):
    """Titles of the two axes, in words."""
    if plane.components:
        return tuple(
            f"{'fₙ' if component == 0 else 'fₜ'} of contact {replay.backbone[contact]} / ⟨fₙ⟩"
            for contact, component in plane.components
        )
    ordinals = ("first", "second")
    return tuple(
        f"{word} principal axis ({part:.0%} of the variance) / ⟨fₙ⟩"
        for word, part in zip(ordinals, plane.share, strict=True)
    )


def hull(points):
    """Corners of the convex hull of points (n, 2); all points where they lie on a line."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        return points


def area(polygon):
    """Area of a convex polygon (k, 2); 0 for fewer than three corners."""
    x, y = np.asarray(polygon, dtype=np.float64).T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)


def outline(library, cell, replay, plane):
    """Work, for jobs.Task, that finds or computes the outline of S in a Plane."""

    def work(job):
        selection = cell.selection
        chosen = [[int(replay.backbone[contact]), part] for contact, part in plane.components]
        params = study.outline_parameters(
            selection.packing,
            mu=selection.mu,
            components=chosen or None,
            states=None if chosen else cell.params,
        )
        get = partial(study.get_outline, axes=None if chosen else plane.axes)
        found = found_or_made(
            library, job, "outline of S", "outline", params, study.OUTLINE_VERSION, get
        )
        return _outlined(replay, plane, found)

    return work


def _outlined(replay, plane, found):
    """The outline as kept; its axes are those it was made with, and the path follows them."""
    axes = found["axes"].values
    if not np.array_equal(axes, plane.axes):
        centre = measures.mean_network(_frames(replay)[1:])
        plane = _plane(replay, plane.components, axes, centre, plane.share)
    inner, outer = (found[name].values - plane.origin for name in ("inner", "outer"))
    numbers = (found[name].item() for name in ("outline_gap", "programs", "seconds"))
    return Outlined(plane, inner, outer, *numbers)
