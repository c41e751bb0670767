"""Assemblies of rigid bodies: convex polygons and disks that rest on each other and on fixed ones.

Contacts follow from the geometry (`polygons`). Fixed bodies are those whose load is NaN, so that
their balance is not required; contacts between two of them are left out, as no equation contains
them. Each other body carries its weight downwards.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from decimal import ROUND_CEILING, Decimal
from typing import Any

import numpy as np
import numpy.typing as npt

from granforce.forces.balance import left_open_in
from granforce.forces.build import ensemble
from granforce.forces.nearest import nearest
from granforce.packing import polygons
from granforce.packing.neighbours import find_pairs
from granforce.packing.polygons import Meeting, Touch
from granforce.records import (
    Contacts,
    InputError,
    NotJammedError,
    Packing,
    Shapes,
    UndecidedError,
    are_whole,
    brief,
    brief_list,
    float_array,
    make_cell,
    make_contacts_at,
    make_packing,
    positive,
    real_array,
    refuse_hidden,
)
from granforce.system.wording import counted
from granforce.tolerances import TOUCHING
from granforce.types import Floats, Integers, Mask

# Gaps up to this many tolerances are reported as nearly touching; and, in the largest body, those
# up to which pairs are named if nothing balances.
_NEARLY, _MISSED = 100.0, 0.01


def blocks(
    bodies: Sequence[npt.ArrayLike],
    mu: Any,
    *,
    fixed: npt.ArrayLike = (),
    weights: npt.ArrayLike | None = None,
    materials: Sequence[Any] | None = None,
    friction: Mapping[Any, Any] | None = None,
    tolerance: float | None = None,
    balanced: bool = True,
    names: Sequence[str] | None = None,
) -> Packing:
    """A Packing of rigid bodies, with the admissible network nearest to equal normal forces.

    An edge on an edge touches at both ends of the shared part.

    Parameters
    ----------
    bodies : sequence of array
        Corners (k, 2) of a convex polygon, in either direction, or (x, y, r) of a disk, for each; a
        fixed body may be a thin wall, (2, 2).
    mu : float or (N_c,) array
        Friction coefficient, or those of all contacts.
    fixed : array of int, default ()
        Numbers of the bodies that cannot move.
    weights : (N,) array, optional
        Force along −y, by default the areas; masses are in proportion.
    materials : (N,) sequence, optional
        Labels of the materials of the bodies.
    friction : mapping, optional
        μ of pairs of materials if it is not mu, {("stone", "wood"): 0.4, …}.
    tolerance : float, optional
        Distance up to which surfaces touch or may overlap, in the unit of the bodies; by default
        10⁻⁹ times the largest body.
    balanced : bool, default True
        Whether to look for a network; otherwise forces are 0, even if nothing balances.
    names : sequence of str, optional
        Names of the bodies, for messages; by default their numbers.

    Returns
    -------
    Packing
        Doubtful pairs are listed in info: corner_on_corner [i, j], which have no normal and no
        contact, and nearly_touching [i, j, gap], up to 100 tolerances apart.

    Raises
    ------
    InputError
        For bodies that overlap.
    NotJammedError
        If nothing balances the weights.
    UndecidedError
        (An InputError, too) where rounding leaves this open, close to the limit.
    """
    try:
        bodies = list(bodies)
    except TypeError:
        words = f"a list of corners (k, 2) and disks (x, y, r), got {brief(bodies)}"
        raise InputError(f"bodies must be {words}") from None
    names = [str(k) for k in range(len(bodies))] if names is None else names
    if len(names) != len(bodies):
        raise InputError(f"give the name of each of the {len(bodies)} bodies")
    outlines = [_outline(body, f"body {name}") for body, name in zip(bodies, names, strict=True)]
    if not outlines:
        raise InputError("there are no bodies; give at least one")
    held = _fixed(fixed, len(outlines))
    thin = np.array([body.shape == (2, 2) for body in outlines])
    for k in np.flatnonzero(thin & ~held)[:1]:
        raise InputError(f"body {names[k]} has two corners; only a fixed body can be a thin wall")
    area, x, polar, r = (np.array(part) for part in zip(*map(_measured, outlines), strict=True))
    if materials is not None and len(materials) != len(outlines):
        raise InputError(f"give the material of each of the {len(outlines)} bodies")
    weights = area if weights is None else float_array(weights, area.shape, "weights")
    for k in np.flatnonzero((weights <= 0) & ~held)[:1]:
        raise InputError(f"body {names[k]} has a weight ≤ 0: every body that can move needs a mass")
    weights = np.where(held, area, weights)
    tolerance = TOUCHING * r.max() if tolerance is None else positive(tolerance, "tolerance")
    i, j, touches, doubts = _contacts(outlines, x, r, held, tolerance, names)
    number = [len(touch.gap) for touch in touches]
    points, gap = (
        np.concatenate([np.empty(shape), *(getattr(touch, name) for touch in touches)])
        for name, shape in (("points", (0, 2)), ("gap", 0))
    )
    normal = np.repeat(np.reshape([touch.normal for touch in touches], (-1, 2)), number, axis=0)
    contacts = make_contacts_at(np.repeat(i, number), np.repeat(j, number), points, normal, x, gap)
    load = np.zeros((len(x), 3))
    load[:, 1] = -weights
    load[held] = np.nan
    polygonal = [body if body.ndim == 2 else np.empty((0, 2)) for body in outlines]
    packing = make_packing(
        x,
        r,
        [np.inf, np.inf],
        contacts,
        np.zeros((len(gap), 2)),
        _frictions(mu, materials, {} if friction is None else friction, contacts),
        load=load,
        info={"bodies": len(x), "tolerance": float(tolerance), **doubts},
        shapes=Shapes(
            corners=np.concatenate(polygonal),
            sides=np.array([len(body) for body in polygonal]),
            mass=weights,
            inertia=weights * polar / area,
        ),
    )
    if not balanced:
        return packing
    try:
        return with_network(packing)
    except NotJammedError as error:
        legend = _legend(names) if "grains" in str(error) else ""
        raise NotJammedError(f"{error}{_missed(packing, names)}{legend}") from None


def with_network(packing: Packing) -> Packing:
    """The Packing with the admissible network nearest to its own forces, or to equal f_n.

    Raises NotJammedError if no network exists, UndecidedError if none was reached.
    """
    if not packing.forces.any():
        equal = np.zeros_like(packing.forces)
        equal[:, 0] = np.nanmean(np.abs(packing.load[:, :2])) or 1.0
        packing = packing._replace(forces=equal)
    S = ensemble(packing)
    if S.admits(S.original):
        return packing
    found = nearest(S, S.original)
    if not S.admits(found.forces):
        raise UndecidedError(
            f"no network was found: residual {found.residual:.2g} ⟨f_n⟩; change μ or a body"
        )
    return packing._replace(forces=S.expand(found.forces))


def _frictions(
    mu: Any, materials: Sequence[Any] | None, pairs: Mapping[Any, Any], contacts: Contacts
) -> Any:
    """μ, or the friction coefficients (N_c,) of pairs of materials, and μ of all other pairs."""
    if not isinstance(pairs, Mapping):
        raise InputError(f'friction must be {{("stone", "wood"): 0.4, …}}, got {brief(pairs)}')
    if materials is None and not pairs:
        return mu
    named = [] if materials is None else list(materials)
    given: dict[frozenset[Any], Any] = {}
    for pair, value in pairs.items():
        if given.setdefault(frozenset(pair), value) != value:
            both = " and ".join(map(brief, pair))
            raise InputError(f"friction is given twice for {both}, with two values: give it once")
    for material in sorted(frozenset().union(*given) - set(named), key=str)[:1]:
        raise InputError(f"friction is given for {brief(material)}, but no body has this material")
    ends = zip(contacts.i.tolist(), contacts.j.tolist(), strict=True)
    return [given.get(frozenset((named[i], named[j])), mu) for i, j in ends]


def _missed(packing: Packing, names: Sequence[str]) -> str:
    """Words on bodies that touch nothing, and on pairs that may be contacts."""
    shapes, tolerance = packing.shapes, packing.info["tolerance"]
    assert shapes is not None
    outlines = [
        body if len(body) else np.append(x, r)
        for body, x, r in zip(shapes.polygons(), packing.x, packing.r, strict=True)
    ]
    held = left_open_in(packing)
    near = _MISSED * packing.r.max()
    doubts = _contacts(outlines, packing.x, packing.r, held, tolerance, near=near)[3]
    words = ""
    if gaps := [gap for _, _, gap in doubts["nearly_touching"]]:
        words += "; " + nearly_touching(gaps, tolerance)
    if pairs := [f"{names[i]} and {names[j]}" for i, j in doubts["corner_on_corner"]]:
        words += (
            f"; bodies {brief_list(pairs)} meet corner on corner, where no normal is determined, "
            "which is no contact: move one so that a corner meets an edge"
        )
    doubted = [body for some in doubts.values() for pair in some for body in pair[:2]]
    touching = [*packing.contacts.i, *packing.contacts.j, *doubted]
    for k in np.setdiff1d(np.flatnonzero(~held), touching)[:1]:
        gaps = [
            np.inf if j == k else _meeting(outlines[k], outlines[j], tolerance).gap
            for j in range(len(outlines))
        ]
        if len(gaps) > 1:
            nearest = int(np.argmin(gaps))
            words += (
                f"; body {names[k]} touches no other: the nearest, body {names[nearest]}, is "
                f"{gaps[nearest]:.3g} away; move it until they touch"
            )
    return words


def nearly_touching(gaps: Sequence[float], tolerance: float) -> str:
    """Words on pairs of bodies with these gaps, which are no contacts."""
    pairs = counted(len(gaps), "pair of bodies nearly touches", "pairs of bodies nearly touch")
    return larger_tolerance(
        f"{pairs}, with gaps from {_up(min(gaps))}, and no contact at the tolerance {tolerance:.2g}"
    )


def _up(gap: float) -> str:
    """A gap in two digits, rounded up, so that it can be given as a tolerance."""
    digits = Decimal(gap)
    up = digits.quantize(Decimal(1).scaleb(digits.adjusted() - 1), ROUND_CEILING)
    return f"{float(up):.2g}"


def larger_tolerance(pairs: str) -> str:
    """Words on pairs that nearly touch, with what makes them contacts."""
    return f"{pairs}: a larger --tolerance (tolerance=) makes them contacts"


def _legend(names: Sequence[str]) -> str:
    """Numbers of bodies with their names, where these differ."""
    if list(names) == [str(k) for k in range(len(names))]:
        return ""
    listed = brief_list([f"{k} {name}" for k, name in enumerate(names)])
    return f"; the bodies are {listed}"


def _outline(body: npt.ArrayLike, name: str) -> Floats:
    """Corners (k, 2), or (3,) x, y, r of a disk."""
    given = real_array(body, name)
    if given.ndim != 1:
        return polygons.polygon(given, name)
    disk = float_array(given, (3,), name)
    if disk[2] <= 0:
        raise InputError(f"{name} is a disk of radius {disk[2]:g}, which must be above 0")
    return disk


def area(body: npt.ArrayLike, name: str) -> float:
    """The area of a body as `blocks` takes it, with its name for messages."""
    return _measured(_outline(body, f"body {name}"))[0]


def _measured(body: Floats) -> tuple[float, Floats, float, float]:
    """Area, centre, polar second moment of area, and circumscribed radius."""
    if body.ndim == 1:
        r = body[2]
        return np.pi * r**2, body[:2], 0.5 * np.pi * r**4, r
    area, centre, polar = polygons.moments(body)
    return area, centre, polar, float(np.hypot(*(body - centre).T).max())


def _fixed(fixed: npt.ArrayLike, count: int) -> Mask:
    numbers = np.asarray(refuse_hidden(fixed, "fixed")).ravel()
    if not are_whole(numbers, count - 1).all():
        raise InputError(f"fixed bodies are numbers from 0 to {count - 1}")
    held = np.zeros(count, dtype=bool)
    held[numbers.astype(np.int64)] = True
    return held


def _contacts(
    outlines: Sequence[Floats],
    x: Floats,
    r: Floats,
    held: Mask,
    tolerance: float,
    names: Sequence[str] = (),
    *,
    near: float | None = None,
) -> tuple[Integers, Integers, list[Touch], dict[str, Any]]:
    """Pairs i, j (k,) that touch, their Touch, and the doubtful pairs, with gaps up to near."""
    near = _NEARLY * tolerance if near is None else near
    cell = make_cell([np.inf, np.inf])
    first, second, _ = find_pairs(x, r, cell, near)
    pairs = [
        (i, j)
        for i, j in sorted(zip(first.tolist(), second.tolist(), strict=True))
        if not (held[i] and held[j])
    ]
    touching: list[tuple[int, int, Touch]] = []
    doubts: dict[str, Any] = {"corner_on_corner": [], "nearly_touching": []}
    for i, j in pairs:
        met = _meeting(outlines[i], outlines[j], tolerance)
        if met.touch is not None:
            touching.append((i, j, met.touch))
        elif met.cornered:
            doubts["corner_on_corner"].append([i, j])
        elif met.gap < 0:
            raise InputError(
                f"bodies {names[i]} and {names[j]} overlap by {-met.gap:.3g}, more than the "
                f"tolerance {tolerance:.3g}; "
                + (
                    f"move one, or give --tolerance {_up(-met.gap)} (tolerance=)"
                    if -met.gap <= _MISSED * r.max()
                    else "move one, or correct its corners"
                )
            )
        elif met.gap <= near:
            doubts["nearly_touching"].append([i, j, met.gap])
    i, j = np.array([one[:2] for one in touching], dtype=np.int64).reshape(-1, 2).T
    return i, j, [one[2] for one in touching], doubts


def _meeting(a: Floats, b: Floats, tolerance: float) -> Meeting:
    if a.ndim == 2 and b.ndim == 2:
        return polygons.polygons_meet(a, b, tolerance)
    if a.ndim == 1 and b.ndim == 1:
        return polygons.disks_meet(a[:2], a[2], b[:2], b[2], tolerance)
    if a.ndim == 1:
        return polygons.disk_meets(a[:2], a[2], b, tolerance)
    met = polygons.disk_meets(b[:2], b[2], a, tolerance)
    if met.touch is None:
        return met
    return met._replace(touch=met.touch._replace(normal=-met.touch.normal))
