"""Small scenes in the form for drawing, by name or built by a visitor, and their links."""

import io
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from granforce.live import hulls
from granforce.packing import assemblies, importers, masonry, scenes
from granforce.records import InputError, NotJammedError, Packing, float_array, friction
from granforce.types import Floats, Integers

from ...state.scene_links import OWN

MOST_BODIES, MOST_WALLS = 30, 12
# The initial scene of the builder: two disks wedged in a box, with room for more.
BEGIN = "1,1,1;2,2.732050807569,1|0,5,0,0;0,0,3,0;3,0,3,5"
PRESSED = re.compile(r"p(\d+(,\d+)*)?")  # part of a built scene: the pressing walls
DRAWN = 6.0  # fraction of all loads: largest f_n drawn for an unbounded S
ONE = {"ladder": "ladder", "stones": "stone"}  # a body of these scenes
# Gaps left by hand are closed up to here, relative to the largest radius if all are disks.
SNAP = 1e-6


def drawn(name: str, mu: float | None = None, built: str = "") -> dict[str, Any]:
    """The data for drawing a scene: plain numbers and arrays.

    Raises InputError for an invalid built scene.
    """
    packing = packing_of(name, mu, built)
    built = (built or BEGIN) if name == OWN else ""
    begins = built == BEGIN
    return {"name": name, "built": built, "begins": begins, "mu": packing.mu, **geometry(packing)}


def packing_of(name: str, mu: float | None = None, built: str = "") -> Packing:
    """The Packing of a scene, by name or built, balanced or not."""
    return built_packing(built, mu) if name == OWN else scenes.sketched(name, mu)


def geometry(packing: Packing) -> dict[str, Any]:
    """Disks, walls, contacts and the balance of a packing without its cones."""
    contacts, count, shapes = packing.contacts, _count(packing), packing.shapes
    walls = packing.walls
    outlines = [] if shapes is None else shapes.polygons()
    if outlines and not len(walls):
        walls = _touched_sides(outlines[count:], packing.contact_points[contacts.j >= count])
    lids = packing.info.get("pressing", [])
    loaded = bool(np.isfinite(packing.pressure) or np.nan_to_num(packing.load).any())
    space = hulls.hull(packing) if len(contacts.i) and loaded else None
    box = [float(side) if np.isfinite(side) else 0.0 for side in packing.box]
    return {
        "one": _one(packing),
        "outlines": [body.ravel().tolist() for body in outlines[:count]],
        "x": packing.x[:count].ravel(),
        "r": packing.r[:count],
        "load": packing.load[:count].ravel(),
        "walls": walls.ravel(),
        "pressing": np.array(lids, dtype=np.int32),
        "press": packing.load[count : count + len(lids), :2].ravel(),
        "idle": not loaded,  # nothing sets the scale of forces
        "packed": packing.info.get("packed_mu"),
        "box": box,
        "pressure": float(np.nan_to_num(packing.pressure)),
        "i": contacts.i.astype(np.int32),
        "j": contacts.j.astype(np.int32),
        "normal": contacts.normal.ravel(),
        "arm_i": contacts.arm_i,
        "arm_j": contacts.arm_j,
        "levers": contacts.offsets.ravel(),
        "names": names(packing, count),
        **({} if space is None else _balance(space)),
    }


def _touched_sides(bodies: Sequence[Floats], points: Floats) -> Floats:
    """The sides (k, 4) of polygons on which points (n, 2) lie: fixed bodies are drawn as walls."""
    sides = np.concatenate([np.hstack([body, np.roll(body, -1, axis=0)]) for body in bodies])
    begin, along = sides[:, :2], sides[:, 2:] - sides[:, :2]
    share = np.sum((points[:, None] - begin) * along, axis=-1) / np.sum(along**2, axis=-1)
    nearest = begin + np.clip(share, 0, 1)[..., None] * along
    return sides[(np.abs(points[:, None] - nearest).max(axis=-1) < SNAP).any(axis=0)]


def _balance(space: hulls.BalanceSpace) -> dict[str, Any]:
    return {
        "A": space.A.ravel(),
        "b": space.b,
        "lift": space.lift.ravel(),
        "axes": space.axes.ravel(),
        "h": len(space.axes),
        "equations": space.equations,
        "grains": space.grains.astype(np.int32),
    }


def _count(packing: Packing) -> int:
    """The number of disks, or of bodies that can move, which come first."""
    free = int(np.isfinite(packing.load[:, 0]).sum()) - len(packing.info.get("pressing", []))
    return int(packing.info.get("disks", len(packing.r) if packing.shapes is None else free))


def _one(packing: Packing) -> str:
    """The word for one body of a scene."""
    if packing.info.get("scene") != OWN or packing.shapes is None:
        return ONE.get(packing.info.get("scene", ""), "disk")
    return "block" if packing.shapes.sides[: _count(packing)].all() else "body"


def names(packing: Packing, count: int) -> list[str]:
    """The position of each contact, in words."""
    contacts, places = packing.contacts, []
    several, lids = count > 1, len(packing.info.get("pressing", []))
    one, ends = _one(packing), _ends(packing)
    many = "bodies" if one == "body" else f"{one}s"
    for i, j, (n_x, n_y), end in zip(contacts.i, contacts.j, contacts.normal, ends, strict=True):
        if j < count:
            places.append(f"between {many} {i + 1} and {j + 1}{end}")
            continue
        wall = "floor" if n_y < -0.9 else "ceiling" if n_y > 0.9 else "right wall"
        if wall == "right wall":  # the only one of a ladder
            wall = "wall" if one == "ladder" else "left wall" if n_x < 0 else wall
        wall = "press" if j < count + lids else wall
        places.append((f"{one} {i + 1} at the {wall}" if several else f"at the {wall}") + end)
    return places


def _ends(packing: Packing) -> list[str]:
    """For contacts at the two ends of a shared edge, which end, in words; empty for others."""
    i, j, points = packing.contacts.i, packing.contacts.j, packing.contact_points
    ends = [""] * len(i)
    for c in range(len(i)) if packing.shapes is not None else ():
        for other in np.flatnonzero((i == i[c]) & (j == j[c]) & (np.arange(len(i)) != c)):
            x, y = points[c] - points[other]
            upright = ("upper" if y > 0 else "lower", "right" if x > 0 else "left")
            ends[c] = f" ({upright[int(abs(y) < abs(x))]} end)"
    return ends


def falling(packing: Packing, load: npt.ArrayLike | None = None) -> Floats:
    """Motion (N, 3) of the disks and pressing walls that proves that nothing balances.

    Flat; empty without a proof.
    """
    packing, count = _loaded(packing, load), _count(packing)
    count += len(packing.info.get("pressing", []))
    try:
        motion = hulls.fall(packing)
    except NotJammedError:  # nothing touches: everything falls
        motion = np.where(np.isnan(packing.load), 0.0, packing.load)
        motion /= np.abs(motion).max() or 1.0
    return np.zeros(0) if motion is None else _straight(packing, motion)[:count].ravel()


def _straight(packing: Packing, motion: Floats) -> Floats:
    """The same motion, except that bodies that press on nothing fall straight along their load."""
    contacts, straight = packing.contacts, motion.copy()
    loads = np.nan_to_num(packing.load)
    loads /= np.abs(loads).max() or 1.0
    for grain in np.flatnonzero(np.abs(motion).max(axis=1) > SNAP):
        trial = straight.copy()
        trial[grain] = loads[grain]
        touched = (contacts.i == grain) | (contacts.j == grain)
        apart = trial[contacts.j[touched], :2] - trial[contacts.i[touched], :2]
        if np.all(np.sum(apart * contacts.normal[touched], axis=1) > -SNAP):
            straight = trial
    return straight


def measured(
    packing: Packing, load: npt.ArrayLike | None = None, plane: Sequence[int] = ()
) -> dict[str, Any]:
    """Exact results on S if it is not drawn whole: its bounds, and its outline in a plane.

    plane: two force components, 2 c for f_n and 2 c + 1 for f_t of contact c. bounds: [least,
    largest f_n] of every contact, None if not certified. outline: corners, flat, empty without an
    area. If S is unbounded there are no bounds, and the outline is that of the part in which no f_n
    is above `most`.
    """
    packing = _loaded(packing, load)
    intervals = hulls.bounds(packing)
    if intervals is None:
        most = DRAWN * float(np.nansum(np.hypot(*packing.load[:, :2].T)))
        return {"most": most, "outline": hulls.outline(packing, plane, most).ravel().tolist()}
    bounds = [None if np.isnan(low) else [float(low), float(high)] for low, high in intervals]
    return {"bounds": bounds, "outline": hulls.outline(packing, plane).ravel().tolist()}


def limit(packing: Packing, load: npt.ArrayLike) -> float | None:
    """How many times the change of loads to these, flat, the bodies can bear; None if endless."""
    least = hulls.limit(packing, np.nan_to_num(_loaded(packing, load).load - packing.load))
    return least if np.isfinite(least) else None


def _loaded(packing: Packing, load: npt.ArrayLike | None) -> Packing:
    """The packing under other loads on its disks, flat."""
    if load is None:
        return packing
    count = _count(packing)
    changed = packing.load.copy()
    changed[:count] = float_array(load, (3 * count,), "loads").reshape(-1, 3)
    return packing._replace(load=changed)


def built_packing(text: str, mu: float | None = None) -> Packing:
    """The Packing of a visitor's scene: "x,y,r;… | x,y,x,y;…", bodies and walls, under gravity.

    A body of five numbers is a block: x, y of its centre, width, height and turn in degrees. With a
    third part, such as "p1,2", there is no gravity, and walls 1 and 2 press with 1 per length.
    """
    bodies, walls, press = ([*(text or BEGIN).split("|"), "", ""])[:3]
    bodies = _rows(bodies, (3, 5), MOST_BODIES, "bodies")
    walls = np.reshape(_rows(walls, (4,), MOST_WALLS, "walls"), (-1, 4))
    if not len(bodies):
        raise InputError("there is no body; add one")
    lids = _pressing(press, len(walls)) if press else np.zeros(0, dtype=np.int64)
    pressing = np.zeros(len(walls))
    pressing[lids] = np.hypot(*(walls[lids, 2:] - walls[lids, :2]).T)
    mu = 0.5 if mu is None else friction(mu)
    if any(len(body) == 5 for body in bodies):
        packing = _of_blocks(bodies, walls, mu, None if not press else pressing)
    else:
        x, r = np.hsplit(np.array(bodies), [2])
        load = scenes.weights(r[:, 0]) * (not press)
        packing = scenes.assembled(x, r[:, 0], walls, load, mu, pressing=pressing, tolerance=SNAP)
    return packing._replace(info=packing.info | {"scene": OWN})


def _of_blocks(
    bodies: Sequence[Floats], walls: Floats, mu: float, pressing: Floats | None
) -> Packing:
    """The Packing of disks and blocks among thin walls; pressing (k,): forces of walls, if any.

    Pressing walls come first among the walls; they may slide along themselves, but not tilt.
    """
    count, force = len(bodies), np.zeros(len(walls)) if pressing is None else pressing
    lids = np.flatnonzero(force)
    order = np.argsort(force == 0, kind="stable")
    packing = assemblies.blocks(
        [*map(outline, bodies), *walls[order].reshape(-1, 2, 2)],
        mu,
        fixed=np.arange(count, count + len(walls)),
        tolerance=SNAP,
        balanced=False,
        names=[str(k + 1) for k in range(count)] + [f"wall {k + 1}" for k in order],
    )
    load, contacts = packing.load.copy(), packing.contacts
    levers = contacts.offsets.copy()
    if pressing is not None:
        load[:count] = 0
    for k, lid in enumerate(lids, start=count):
        touching = contacts.j == k
        inwards = scenes.inwards(packing.x[:count], walls[lid], contacts.normal[touching])
        load[k], levers[touching, 1] = [*inwards * force[lid], 0], 0
    return packing._replace(
        load=load,
        contacts=contacts._replace(levers=levers),
        info=packing.info | {"walls": walls.tolist(), "pressing": lids.tolist()},
    )


def outline(body: Floats) -> Floats:
    """A disk as it is; the corners (4, 2) of a block."""
    if len(body) == 3:
        return body
    x, (width, height), turn = body[:2], body[2:4], np.radians(body[4])
    along = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return x + masonry.rectangle(-width / 2, -height / 2, width / 2, height / 2) @ along


def _pressing(text: str, walls: int) -> Integers:
    """Numbers of the pressing walls."""
    lids = [int(k) for k in text[1:].split(",") if k] if PRESSED.fullmatch(text) else [walls]
    if max(lids, default=0) >= walls and lids:
        raise InputError("the pressing walls in this link cannot be read")
    return np.unique(np.array(lids, dtype=np.int64))


def _rows(text: str, widths: Sequence[int], most: int, what: str) -> list[Floats]:
    """The rows of a part of a built scene, each of one of these widths."""
    try:
        rows = [[float(part) for part in row.split(",")] for row in text.split(";") if row.strip()]
    except ValueError:
        rows = [[]]
    if any(len(row) not in widths for row in rows):
        raise InputError(f"this link's {what} cannot be read")
    if len(rows) > most:
        raise InputError(f"a scene may have {most} {what} at most, got {len(rows)}")
    return [float_array(row, (-1,), what) for row in rows]


def file_of(packing: Packing, load: npt.ArrayLike | None = None) -> bytes:
    """The packing under these loads as an NPZ file, with a network if there is one."""
    packing = _loaded(packing, load)
    try:
        packing = assemblies.with_network(packing)
    except (InputError, NotJammedError):
        pass  # kept unchanged: S is empty, and the library says why
    file = io.BytesIO()
    importers.save_packing(packing, file)
    return file.getvalue()
