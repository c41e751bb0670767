"""Assemblies of rigid bodies that rest on each other and on fixed ones.

A body is a convex polygon, a disk, or several of these parts. Contacts follow from the geometry
(`polygons`). Fixed bodies are those whose load is NaN, so that their balance is not required;
contacts between two of them are left out, as no equation contains them. Each other body carries its
weight downwards.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from decimal import ROUND_CEILING, Decimal
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from granforce.forces.balance import left_open_in
from granforce.forces.build import ensemble
from granforce.forces.contact_problem import wedged
from granforce.forces.nearest import nearest
from granforce.packing import polygons
from granforce.packing.neighbours import find_pairs
from granforce.packing.polygons import Meeting, Touch
from granforce.records import (
    Contacts,
    InputError,
    InputWarning,
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
from granforce.tolerances import LARGEST_UNIT, TOUCHING
from granforce.types import Floats, Integers, Mask

# Gaps up to this many tolerances are reported as nearly touching; and, in the largest body, those
# up to which pairs are named if nothing balances.
_NEARLY, _MISSED = 100.0, 0.01
# Most contacts up to which wedged bodies are named: beyond, the proof takes minutes.
_MOST_NAMED = 1000


class _Parts(NamedTuple):
    """The parts of all bodies, body by body."""

    outlines: list[Floats]  # corners (k, 2), or x, y, r of a disk
    body: Integers  # (P,) number of the body
    circles: Floats  # (P, 3) x, y, r of the circle around the part


def blocks(
    bodies: Sequence[Any],
    mu: Any,
    *,
    fixed: npt.ArrayLike = (),
    weights: npt.ArrayLike | None = None,
    materials: Sequence[Any] | None = None,
    friction: Mapping[Any, Any] | None = None,
    normals: Mapping[Any, Any] | None = None,
    tolerance: float | None = None,
    balanced: bool = True,
    names: Sequence[str] | None = None,
) -> Packing:
    """A Packing of rigid bodies, with the admissible network nearest to equal normal forces.

    An edge on an edge touches at both ends of the shared part.

    Parameters
    ----------
    bodies : sequence of array, or of lists of arrays
        Corners (k, 2) of a convex polygon, in either direction, or (x, y, r) of a disk, for each;
        or a list of such parts, which move as one, whether they touch or not. Where parts overlap,
        their areas add up, and an InputWarning says so. A fixed body may be a thin wall, (2, 2).
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
    normals : mapping, optional
        Directions of contact normals, in degrees from +x, where bodies meet corner on corner:
        {(0, 1): 90} if the normal from body 0 to body 1 points up.
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
        contact, and nearly_touching [i, j, gap], up to 100 tolerances apart. With a network,
        wedged lists bodies that can press on each other without a load (up to 1000 contacts).

    Raises
    ------
    InputError
        For bodies that overlap, parts that are not convex, and normals where none is missing.
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
    if not bodies:
        raise InputError("there are no bodies; give at least one")
    parts, area, x, polar, r = _measured(bodies, names)
    held = _fixed(fixed, len(bodies))
    thin = [len(one) == 2 for one in parts.outlines]
    for k in np.setdiff1d(parts.body[thin], np.flatnonzero(held))[:1]:
        raise InputError(f"body {names[k]} has two corners; only a fixed body can be a thin wall")
    if materials is not None and len(materials) != len(bodies):
        raise InputError(f"give the material of each of the {len(bodies)} bodies")
    weights = area if weights is None else float_array(weights, area.shape, "weights")
    for k in np.flatnonzero((weights <= 0) & ~held)[:1]:
        raise InputError(f"body {names[k]} has a weight ≤ 0: every body that can move needs a mass")
    weights = np.where(held, area, weights)
    tolerance = TOUCHING * r.max() if tolerance is None else positive(tolerance, "tolerance")
    i, j, touches, doubts = _contacts(
        parts, held, tolerance, names, normals=_normals(normals, held)
    )
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
    polygonal = [one if one.ndim == 2 else np.empty((0, 2)) for one in parts.outlines]
    several = len(polygonal) > len(x)
    if len(twice := _overlapping(parts, held, tolerance)):
        warnings.warn(counted_twice(names[k] for k in twice), InputWarning, stacklevel=2)
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
            sides=np.array([len(one) for one in polygonal]),
            mass=weights,
            inertia=weights * polar / area,
            body=parts.body if several else None,
            circles=parts.circles if several else None,
        ),
    )
    if not balanced:
        return packing
    try:
        packing = with_network(packing)
    except NotJammedError as error:
        legend = _legend(names) if "grains" in str(error) else ""
        raise NotJammedError(f"{error}{_missed(packing, names)}{legend}") from None
    named = wedged(ensemble(packing)).tolist() if len(gap) <= _MOST_NAMED else []
    return packing._replace(info=packing.info | {"wedged": named})


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
    parts, tolerance, held = _parts_of(packing), packing.info["tolerance"], left_open_in(packing)
    near = _MISSED * packing.r.max()
    doubts = _contacts(parts, held, tolerance, near=near)[3]
    words = ""
    if gaps := [gap for _, _, gap in doubts["nearly_touching"]]:
        words += "; " + nearly_touching(gaps, tolerance)
    if pairs := [f"{names[i]} and {names[j]}" for i, j in doubts["corner_on_corner"]]:
        words += (
            f"; bodies {brief_list(pairs)} meet corner on corner, where no normal is determined, "
            "which is no contact: move one so that a corner meets an edge, or give the normal "
            '(normals={(0, 1): degrees}, or "normals" in JSON)'
        )
    doubted = [body for some in doubts.values() for pair in some for body in pair[:2]]
    touching = [*packing.contacts.i, *packing.contacts.j, *doubted]
    for k in np.setdiff1d(np.flatnonzero(~held), touching)[:1]:
        own, other = parts.body == k, parts.body != k
        gaps = [
            (_meeting(parts.outlines[a], parts.outlines[b], tolerance).gap, parts.body[b])
            for a in np.flatnonzero(own)
            for b in np.flatnonzero(other)
        ]
        for gap, closest in sorted(gaps)[:1]:
            words += (
                f"; body {names[k]} touches no other: the nearest, body {names[closest]}, is "
                f"{gap:.3g} away; move it until they touch"
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
    return f"{pairs}: a larger tolerance (--tolerance, or tolerance=) makes them contacts"


def counted_twice(bodies: Iterable[Any]) -> str:
    """Words on bodies with parts that overlap."""
    return (
        f"parts of bodies {brief_list(list(bodies))} overlap: their common area counts twice, so "
        "that mass and centre of mass are wrong; give parts that do not overlap"
    )


def _overlapping(parts: _Parts, held: Mask, tolerance: float) -> Integers:
    """Bodies with parts that overlap, and that can move."""
    x, r, body = parts.circles[:, :2], parts.circles[:, 2], parts.body
    i, j, _ = find_pairs(x, r, make_cell([np.inf, np.inf]), 0.0)
    within = (body[i] == body[j]) & ~held[body[i]]
    pairs = zip(i[within], j[within], strict=True)
    deep = [_meeting(parts.outlines[a], parts.outlines[b], tolerance).gap for a, b in pairs]
    return np.unique(body[i[within][np.array(deep, dtype=float) < -tolerance]])


def _legend(names: Sequence[str]) -> str:
    """Numbers of bodies with their names, where these differ."""
    if list(names) == [str(k) for k in range(len(names))]:
        return ""
    listed = brief_list([f"{k} {name}" for k, name in enumerate(names)])
    return f"; the bodies are {listed}"


def _outline(body: npt.ArrayLike, name: str) -> Floats:
    """Corners (k, 2), or (3,) x, y, r of a disk."""
    given = real_array(body, name)
    if np.abs(given).max(initial=0.0) > LARGEST_UNIT:
        raise InputError(f"{name} extends beyond {LARGEST_UNIT:g}; give lengths in another unit")
    if given.ndim != 1:
        return polygons.polygon(given, name)
    disk = float_array(given, (3,), name)
    if disk[2] <= 0:
        raise InputError(f"{name} is a disk of radius {disk[2]:g}, which must be above 0")
    return disk


def _outlines(body: Any, name: str) -> list[Floats]:
    """The outline of each part of a body: of itself, if it is no list of parts."""
    try:
        given = list(body)
    except TypeError:
        given = []
    if not given:
        raise InputError(f"{name} has no parts; give corners (k, 2), or a disk (x, y, r)")
    if not any(map(_is_outline, given)):
        return [_outline(body, name)]
    several = len(given) > 1
    return [
        _outline(one, f"part {k} of {name}" if several else name) for k, one in enumerate(given)
    ]


def _is_outline(given: Any) -> bool:
    """Whether an item of a body is an outline: a disk (x, y, r), or corners (k, 2).

    Otherwise it is a number or a corner (x, y) of the body's only outline.
    """
    if isinstance(given, np.ndarray):
        return given.ndim == 2 or given.shape == (3,)
    if not isinstance(given, list | tuple) or not given:
        return False
    return len(given) == 3 or np.iterable(given[0])


def areas(bodies: Sequence[Any], names: Sequence[str]) -> Floats:
    """The areas (N,) of bodies as `blocks` takes them, with their names for messages."""
    return _measured(bodies, names)[1]


def _measured(
    bodies: Sequence[Any], names: Sequence[str]
) -> tuple[_Parts, Floats, Floats, Floats, Floats]:
    """The parts of bodies; their areas, centres, polar second moments, and radii around these."""
    each = [_outlines(body, f"body {name}") for body, name in zip(bodies, names, strict=True)]
    number = np.repeat(np.arange(len(each)), [len(some) for some in each])
    outlines = [outline for some in each for outline in some]
    one, centre, own, radius = (
        np.array(values) for values in zip(*map(_moments, outlines), strict=True)
    )
    begin = np.flatnonzero(np.diff(number, prepend=-1))
    area = np.add.reduceat(one, begin)
    x = np.add.reduceat(one[:, None] * centre, begin) / area[:, None]
    polar = np.add.reduceat(own + one * np.sum((centre - x[number]) ** 2, axis=1), begin)
    r = np.zeros(len(each))
    for body, outline in zip(number, outlines, strict=True):
        points, more = (outline, 0.0) if outline.ndim == 2 else (outline[None, :2], outline[2])
        r[body] = max(r[body], np.hypot(*(points - x[body]).T).max() + more)
    return _Parts(outlines, number, np.column_stack([centre, radius])), area, x, polar, r


def _moments(part: Floats) -> tuple[float, Floats, float, float]:
    """Area, centre, polar second moment of area, and circumscribed radius."""
    if part.ndim == 1:
        r = part[2]
        return np.pi * r**2, part[:2], 0.5 * np.pi * r**4, r
    area, centre, polar = polygons.moments(part)
    return area, centre, polar, float(np.hypot(*(part - centre).T).max())


def _parts_of(packing: Packing) -> _Parts:
    shapes = packing.shapes
    assert shapes is not None
    circles = np.column_stack([packing.x, packing.r]) if shapes.circles is None else shapes.circles
    body = np.arange(len(packing.r)) if shapes.body is None else shapes.body
    outlines = [
        corners if len(corners) else circle
        for corners, circle in zip(shapes.part_corners(), circles, strict=True)
    ]
    return _Parts(outlines, body, circles)


def _normals(given: Mapping[Any, Any] | None, held: Mask) -> dict[tuple[int, int], float]:
    """Angles (radians) of the normals of pairs (i, j), i < j, as `blocks` takes them."""
    if not isinstance(given, Mapping | None):
        raise InputError(f"normals must be {{(0, 1): 90, …}}, got {brief(given)}")
    angles: dict[tuple[int, int], float] = {}
    for pair, angle in ({} if given is None else given).items():
        numbers = np.asarray(pair)
        if numbers.shape != (2,) or not are_whole(numbers, len(held) - 1).all():
            last = len(held) - 1
            raise InputError(f"normals are of pairs of bodies 0 … {last}, not {brief(pair)}")
        i, j = numbers.astype(int).tolist()
        turned = np.radians(float(float_array(angle, (), f"the normal of bodies {i} and {j}")))
        if (ends := (min(i, j), max(i, j))) in angles:
            raise InputError(f"the normal of bodies {i} and {j} is given twice: give it once")
        angles[ends] = turned + (np.pi if i > j else 0.0)
    return angles


def _fixed(fixed: npt.ArrayLike, count: int) -> Mask:
    numbers = np.asarray(refuse_hidden(fixed, "fixed")).ravel()
    if not are_whole(numbers, count - 1).all():
        raise InputError(f"fixed bodies are numbers from 0 to {count - 1}")
    held = np.zeros(count, dtype=bool)
    held[numbers.astype(np.int64)] = True
    return held


def _contacts(
    parts: _Parts,
    held: Mask,
    tolerance: float,
    names: Sequence[str] = (),
    *,
    near: float | None = None,
    normals: Mapping[tuple[int, int], float] | None = None,
) -> tuple[Integers, Integers, list[Touch], dict[str, Any]]:
    """Pairs i, j (k,) that touch, their Touch, and the doubtful pairs, with gaps up to near.

    normals: angles at pairs that meet corner on corner.
    """
    x, r, body, normals = parts.circles[:, :2], parts.circles[:, 2], parts.body, dict(normals or {})
    near = _NEARLY * tolerance if near is None else near
    cell = make_cell([np.inf, np.inf])
    first, second, _ = find_pairs(x, r, cell, near)
    ends = body[np.sort(np.stack([first, second]), axis=0)]
    apart = (ends[0] != ends[1]) & ~held[ends].all(axis=0)
    pairs = sorted(zip(*np.sort(np.stack([first, second]), axis=0)[:, apart].tolist(), strict=True))
    touching: dict[tuple[int, int], list[Touch]] = {}
    doubts: dict[str, Any] = {"corner_on_corner": [], "nearly_touching": []}
    beyond = _beyond(parts)
    for a, b in pairs:
        i, j = int(body[a]), int(body[b])
        met = _meeting(parts.outlines[a], parts.outlines[b], tolerance, beyond[a], beyond[b])
        if met.cornered and (i, j) in normals:
            angle = normals.pop((i, j))
            touch = polygons.corners_meet(parts.outlines[a], parts.outlines[b], angle, met.gap)
            if touch is None:
                raise InputError(
                    f"the normal of bodies {names[i]} and {names[j]} at {np.degrees(angle):g} "
                    "degrees does not point from one to the other: correct normals"
                )
            met = met._replace(touch=touch)
        if met.touch is not None:
            touching.setdefault((i, j), []).append(met.touch)
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
    for i, j in normals:
        raise InputError(
            f"bodies {names[i]} and {names[j]} do not meet corner on corner, so that no normal is "
            "missing: leave it out of normals"
        )
    every = [
        (pair, touch)
        for pair, some in sorted(touching.items())
        for touch in (polygons.united(some, tolerance) if len(some) > 1 else some)
    ]
    i, j = np.array([pair for pair, _ in every], dtype=np.int64).reshape(-1, 2).T
    return i, j, [touch for _, touch in every], doubts


def _beyond(parts: _Parts) -> list[Mask | None]:
    """Where surfaces go on, as by `goes_on`; None for disks, and bodies of one part."""
    count, begin = np.bincount(parts.body)[parts.body], np.searchsorted(parts.body, parts.body)
    return [
        None
        if count[k] == 1 or one.ndim == 1
        else polygons.goes_on(
            one, [parts.outlines[o] for o in range(begin[k], begin[k] + count[k]) if o != k]
        )
        for k, one in enumerate(parts.outlines)
    ]


def _meeting(a: Floats, b: Floats, tolerance: float, *beyond: Mask | None) -> Meeting:
    if a.ndim == 2 and b.ndim == 2:
        return polygons.polygons_meet(a, b, tolerance, *beyond)
    if a.ndim == 1 and b.ndim == 1:
        return polygons.disks_meet(a[:2], a[2], b[:2], b[2], tolerance)
    if a.ndim == 1:
        return polygons.disk_meets(a[:2], a[2], b, tolerance)
    met = polygons.disk_meets(b[:2], b[2], a, tolerance)
    if met.touch is None:
        return met
    return met._replace(touch=met.touch._replace(normal=-met.touch.normal))
