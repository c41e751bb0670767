"""Force space in a plane: the positions of a Replay's states, and the outline of S."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.spatial import ConvexHull, QhullError

from granforce import measures
from granforce.live.hulls import stress_axes
from granforce.records import InputError
from granforce.study import kinds
from granforce.study.keys import Parameters
from granforce.system.wording import integer
from granforce.types import Floats

from ..background.jobs import Job
from .compute import load_or_compute
from .library import Cell, Library
from .replays import Replay
from .selection import Selection

# Two (position in the backbone, 0 for f_n or 1 for f_t), or empty.
Components = tuple[tuple[int, int], ...]


class Plane(NamedTuple):
    """Two axes of force space, and the positions of states in their plane. Forces are in ⟨f_n⟩."""

    components: Components  # two (position in the backbone, 0 or 1), or empty for principal axes
    axes: Floats  # (2, N_c, 2)
    origin: Floats  # (2,) of the plane's coordinates
    share: Floats  # (2,) of the variance of the states, NaN for components
    path: Any  # (F, 2) float32: the original network, then the states shown
    kind: str = ""  # STRESS if the axes are those of stresses

    @property
    def pair(self) -> list[int]:
        """The two contacts whose forces are the axes; empty for other planes."""
        contacts = [contact for contact, _ in self.components]
        return contacts if len(set(contacts)) == 2 else []


STRESS = "stress"
PAIR = "green", "violet"  # lines of the contacts whose forces are the axes, across and up


class Outlined(NamedTuple):
    """The outline of S in a Plane, between inner and outer polygons."""

    plane: Plane
    inner: Floats  # (k, 2) corners
    outer: Floats  # (m, 2)
    gap: float  # largest distance between them
    programs: int  # linear programs it took
    seconds: float


def principal(replay: Replay, states: Any = None) -> Plane:
    """The Plane of the two directions of largest variance.

    states (k, N_c, 2): by default those shown.
    """
    states = _frames(replay)[1:] if states is None else states.astype(np.float64)
    axes, share = measures.principal_axes(states)
    return _plane(replay, (), axes, measures.mean_network(states), share)


def components(replay: Replay, first: Sequence[int], second: Sequence[int]) -> Plane:
    """The Plane of two components (position in the backbone, 0 for f_n or 1 for f_t).

    InputError for a missing contact, or the same component twice.
    """
    (a, part), (b, other) = first, second
    chosen = (a, part), (b, other)
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


def strong_pair(replay: Replay) -> tuple[int, int]:
    """The strongest contact as packed, and the next without a disk in common, as positions.

    If there is none, the second strongest. Positions are in the backbone. InputError for fewer
    than two.
    """
    if replay.normal.shape[1] < 2:
        raise InputError("there are not two contacts to compare")
    strong = np.argsort(-replay.normal[0], kind="stable")
    disks = np.column_stack([replay.i, replay.j])
    apart = ~np.isin(disks[strong], disks[strong[0]]).any(axis=1)
    other = strong[apart][0] if apart.any() else strong[1]
    return int(strong[0]), int(other)


def stress(library: Library, selection: Selection, replay: Replay) -> Plane:
    """The Plane of stresses: (σ_xx − σ_yy)/2P and σ_xy/P. InputError without a pressure."""
    axes = stress_axes(library.packing(selection.packing), selection.mu)
    none = np.zeros(axes.shape[1:])
    return _plane(replay, (), axes, none, np.full(2, np.nan))._replace(kind=STRESS)


def _frames(replay: Replay) -> Floats:
    return np.stack([replay.normal, replay.tangential], axis=2).astype(np.float64)


def _plane(
    replay: Replay, chosen: Components, axes: Floats, centre: Floats, share: Floats
) -> Plane:
    path = np.tensordot(_frames(replay) - centre, axes, ((1, 2), (1, 2)))
    origin = np.tensordot(axes, centre, ((1, 2), (0, 1)))
    return Plane(chosen, axes, origin, share, path.astype(np.float32))


def labels(replay: Replay, plane: Plane) -> tuple[str, ...]:
    """Labels of the two axes, short enough for the height of the plot on a phone."""
    if plane.pair:  # its lines have colours
        return tuple(f"fₙ at the {colour} line, in ⟨fₙ⟩" for colour in PAIR)
    if plane.components:
        return tuple(
            f"{'fₙ' if component == 0 else 'fₜ'} of contact {replay.backbone[contact]}, in ⟨fₙ⟩"
            for contact, component in plane.components
        )
    if plane.kind == STRESS:
        return "pressed more across than up: (σₓₓ − σᵧᵧ) / 2P", "sheared: σₓᵧ / P"
    return ("the direction in which networks differ most, in ⟨fₙ⟩", "the second such direction")


def name(plane: Plane) -> str:
    """The name of a Plane in a link."""
    if not plane.components:
        return "s" if plane.kind == STRESS else "p"
    return _spelled(plane.components)


def _spelled(components: Components) -> str:
    return "-".join(f"{contact}{'nt'[part]}" for contact, part in components)


def renumbered(name: str, number: Callable[[int], int]) -> str:
    """The name of a plane with each contact renumbered."""
    return _spelled(tuple((number(contact), part) for contact, part in read(name))) or name


def read(text: str) -> Components:
    """The components () or ((contact, part), (contact, part)) of a name; ValueError if invalid."""
    if text in ("p", "s"):
        return ()
    first, second = ((integer(part[:-1]), "nt".index(part[-1:] or "?")) for part in text.split("-"))
    return first, second


def named(library: Library, cell: Cell, replay: Replay, text: str) -> Plane:
    """The Plane of a name, with its stored axes."""
    chosen = read(text)
    if chosen:
        return components(replay, *chosen)
    if text == "s":
        return stress(library, cell.selection, replay)
    plane = principal(replay)
    stored = library.stored(kinds.OUTLINE, _parameters(cell, replay, plane))
    return plane if stored is None else _from_stored(replay, plane, stored)


def other_states(cells: Sequence[Cell], cell: Cell) -> Cell | None:
    """The cell of the other kind of states with the same packing and μ and most states, or None.

    Uniform states for a walk, and a walk for uniform states.
    """
    selection = cell.selection
    others = [
        other
        for other in cells
        if other.kind != cell.kind
        and other.selection.shares_packing(selection)
        and other.selection.held == selection.held
    ]
    return max(others, key=lambda other: other.selection.states, default=None)


def points(plane: Plane, replay: Replay, other: Replay) -> Floats:
    """Positions (k, 2) in a Plane of the states of another Replay on the same contacts."""
    if not np.array_equal(replay.backbone, other.backbone):
        return np.empty((0, 2))
    return np.tensordot(_frames(other)[1:], plane.axes, ((1, 2), (1, 2))) - plane.origin


def inner_share(points: Floats, outline: npt.ArrayLike) -> float:
    """Fraction of points (n, 2) in a convex polygon (k, 2) shrunk to half about its centroid."""
    corners = halfway(outline)
    edge, away = np.roll(corners, -1, axis=0) - corners, points[:, None] - corners
    turn = edge[:, 0] * away[..., 1] - edge[:, 1] * away[..., 0]
    return float(np.mean(np.all(turn >= 0, axis=1) | np.all(turn <= 0, axis=1)))


def halfway(outline: npt.ArrayLike) -> Floats:
    """Corners (k, 2) of a convex polygon (k, 2) shrunk to half about its centroid."""
    corners = np.asarray(outline, dtype=np.float64)
    after = np.roll(corners, -1, axis=0)
    slice_ = corners[:, 0] * after[:, 1] - after[:, 0] * corners[:, 1]
    centroid = ((corners + after) * slice_[:, None]).sum(axis=0) / (3 * slice_.sum())
    return (corners + centroid) / 2


def area(points: npt.ArrayLike) -> float:
    """Area of the convex hull of points (n, 2); 0 for points on a line."""
    try:
        return float(ConvexHull(points).volume)  # the name of the measure in any dimension
    except QhullError:
        return 0.0


def outline(
    library: Library, cell: Cell, replay: Replay, plane: Plane
) -> Callable[[Job], Outlined]:
    """Work for jobs.Task that loads or computes the outline of S in a Plane."""

    def work(job: Job) -> Outlined:
        if plane.kind == STRESS:
            return _stresses(library, job, cell, plane)
        params = _parameters(cell, replay, plane)
        axes = None if plane.components else plane.axes
        dataset = load_or_compute(library, job, "outline of S", kinds.OUTLINE, params, axes=axes)
        return _outlined(replay, plane, dataset)

    return work


def _stresses(library: Library, job: Job, cell: Cell, plane: Plane) -> Outlined:
    """The Outlined of all stresses."""
    params = kinds.STRESS.parameters(cell.selection.packing, **cell.selection.conditions)
    dataset = load_or_compute(library, job, "outline of all stresses", kinds.STRESS, params)
    inner, outer = dataset["stress_inner"].values, dataset["stress_outer"].values
    gap = dataset["friction_bound"].item() - dataset["friction"].item()
    programs = json.loads(dataset.attrs["counts"])["programs"]
    return Outlined(plane, inner, outer, gap, programs, dataset["seconds"].item())


def _parameters(cell: Cell, replay: Replay, plane: Plane) -> Parameters:
    """The parameters of the outline in a Plane."""
    selection = cell.selection
    chosen = [[int(replay.backbone[contact]), part] for contact, part in plane.components]
    return kinds.OUTLINE.parameters(
        selection.packing,
        **selection.conditions,
        components=chosen or None,
        states=None if chosen else cell.params,
    )


def _from_stored(replay: Replay, plane: Plane, dataset: xr.Dataset) -> Plane:
    """The Plane on the axes with which its outline was computed."""
    axes = dataset["axes"].values
    if np.array_equal(axes, plane.axes):
        return plane
    centre = measures.mean_network(_frames(replay)[1:])
    return _plane(replay, plane.components, axes, centre, plane.share)


def _outlined(replay: Replay, plane: Plane, dataset: xr.Dataset) -> Outlined:
    """The stored outline, on the axes of its computation, to which the path is converted."""
    plane = _from_stored(replay, plane, dataset)
    return Outlined(
        plane,
        inner=dataset["inner"].values - plane.origin,
        outer=dataset["outer"].values - plane.origin,
        gap=dataset["outline_gap"].item(),
        programs=dataset["programs"].item(),
        seconds=dataset["seconds"].item(),
    )
