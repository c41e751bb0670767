"""Contacts of given disks in a cell, and checks that a file's contacts match its positions."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from granforce.cell import Cell
from granforce.packing.closing import apart
from granforce.packing.importers.notes import with_notes
from granforce.packing.neighbours import find_pairs, separations
from granforce.records import (
    Contacts,
    InputError,
    Packing,
    brief_list,
    make_contacts,
    make_packing,
    positive,
    repeated,
)
from granforce.system.wording import counted
from granforce.tolerances import LARGEST_UNIT, LISTED_TOUCHING, RIGID_OVERLAP, UNUSUAL_GAP
from granforce.types import Floats, Integers, Mask

# Contacts may overlap, or have a gap, up to this fraction of the smaller radius.
OVERLAP_ALLOWED = 0.2

# Pairs whose gap is below this many tolerances, and which are no contacts, are in doubt.
NEARLY = 100.0
# Pairs with larger gaps, in largest radii, are in doubt only below the tolerance itself.
APART = 0.1

# Largest difference, in largest radii, between a given distance or branch and the positions: dumps
# with six digits pass; a wrong box or a wrong grain does not.
MISFIT = 1e-3

# Largest positions and box sides, in largest radii; beyond, float64 cannot resolve a gap.
EXTENT = 1e7

# Most pairs within one largest diameter that are checked for overlaps. Beyond, grains lie on top of
# each other (or sizes differ too much), and the list of pairs would not fit into memory.
CLOSE_PAIRS = 20_000_000

# Least contacts of a grain for its balance to count, and its rounding error in Σ |f|.
_ENOUGH, _ROUNDING = 3, 1e-12

# No direction is periodic.
OPEN = Cell(np.full(2, np.inf), 0.0)


def touching_contacts(
    x: Floats, r: Floats, cell: Cell, tolerance: float, rigid: Integers | None = None
) -> Contacts:
    """Contacts between all grains whose gap is below tolerance (in largest radii, at most 1).

    rigid (N,): as of `check_disks`; grains of one body have no contacts.
    """
    i, j, shift = find_pairs(x, r, cell, largest_gap(tolerance) * r.max())
    if rigid is not None:
        others = rigid[i] != rigid[j]
        i, j, shift = i[others], j[others], shift[others]
    normal, length, _ = separations(x, r, cell, i, j, shift)
    return make_contacts(i, j, normal, length, r)


def largest_gap(tolerance: float) -> float:
    """The tolerance, in largest radii, as a float; InputError unless it is > 0 and at most 1."""
    tolerance = positive(tolerance, "tolerance")
    if tolerance > 1:
        words = f"is in largest radii and must not exceed 1, got {tolerance:g}"
        raise InputError.of("tolerance", tolerance, words)
    return tolerance


def overlapping(x: Floats, r: Floats, cell: Cell) -> tuple[Integers, Integers, Floats]:
    """Grains i, j (P,) of all overlapping pairs, and their gaps (P,) < 0; centres may coincide."""
    i, j, shift = find_pairs(x, r, cell, 0.0)
    # `separations` needs a direction.
    return i, j, np.hypot(*(x[j] - x[i] + shift @ cell.vectors).T) - r[i] - r[j]


def with_doubts_noted(packing: Packing, tolerance: float | None) -> Packing:
    """The packing with notes in info on large overlaps, and on pairs near the tolerance.

    tolerance: which decided what touches, or None if contacts were listed. info["nearly_touching"]
    lists [i, j, gap] of pairs that are no contacts though their gap is below NEARLY tolerances and
    below APART (in largest radii), and of those that the tolerance makes contacts though their gap
    is far above those of other contacts; the gap is in the unit of x.
    """
    c, largest, notes = packing.contacts, packing.r.max(), []
    overlap = -c.gap.min(initial=0.0) / largest
    if overlap > RIGID_OVERLAP:
        mean = -c.gap[c.gap < 0].mean() / largest
        notes.append(
            f"disks overlap by up to {overlap:.2g} of the largest radius (mean {mean:.2g}): they "
            "count as soft, each contact at the middle of its overlap"
        )
    tolerance_used = tolerance or LISTED_TOUCHING
    near = min(NEARLY * tolerance_used, max(APART, tolerance_used))
    i, j, gap = apart(packing, near)
    if len(i):
        notes.append(
            f"{counted(len(i), 'pair is', 'pairs are')} in doubt: gaps below {near:.2g} of the "
            "largest radius, but no contacts; nearly_touching in the report by --json (in "
            "packing.info) lists them"
        )
    info: dict[str, Any] = {} if tolerance is None else {"tolerance": float(tolerance)}
    if tolerance is not None and len(doubted := _barely(c.gap / largest, tolerance)):
        named = brief_list([f"{c.i[k]} and {c.j[k]}" for k in doubted])
        notes.append(
            f"{counted(len(doubted), 'contact is', 'contacts are')} in doubt: gaps up to "
            f"{c.gap[doubted].max() / largest:.2g} of the largest radius, far above those of other "
            f"contacts, but below the tolerance {tolerance:.2g}; a smaller --tolerance "
            f"(tolerance=) leaves out grains {named} (counted from 0)"
        )
        i, j, gap = (
            np.concatenate([one, more[doubted]]) for one, more in ((i, c.i), (j, c.j), (gap, c.gap))
        )
    rows = zip(i.tolist(), j.tolist(), gap.tolist(), strict=True)
    info["nearly_touching"] = [list(row) for row in rows]
    return with_notes(packing._replace(info=packing.info | info), notes)


def _barely(gap: Floats, tolerance: float) -> Integers:
    """Contacts whose gap (in largest radii) is near the tolerance and far above the median."""
    usual = np.quantile(np.abs(gap), 0.5, method="lower") if len(gap) else 0.0
    return np.flatnonzero(gap > max(tolerance / NEARLY, UNUSUAL_GAP * usual))


def listed_contacts(
    x: Floats,
    r: Floats,
    cell: Cell,
    i: Integers,
    j: Integers,
    place: Callable[[int], str],
    branch: Floats | None = None,
) -> Contacts:
    """Contacts between grains i, j (N_c,), with given branches (N_c, 2) or nearest images.

    place(c) names contact c in messages. Raises InputError if a given branch does not lead from i
    to an image of j, if disks overlap or are apart too much, and for contacts given twice.
    """
    nearest = cell.nearest(x[j] - x[i])
    if branch is None:
        branch = nearest
    else:
        _check_branches(cell.nearest(branch - nearest), r.max(), place)
    length = np.hypot(*branch.T)
    for c in np.flatnonzero((i == j) | (length == 0)).tolist():
        raise InputError(f"{place(c)}: {_pair(i, j, c)} are at the same point; correct the grains")
    contacts = make_contacts(i, j, branch / length[:, None], length, r)
    check_contacts(contacts, r, place)
    return contacts


def distinct_pairs(
    i: Integers, j: Integers, force: Floats, allowed: float, place: Callable[[int], str]
) -> Integers:
    """Rows that remain when pairs listed twice, in either order, count once.

    force (k, 2): on j. Raises InputError if the two rows of a pair differ by more than `allowed`, a
    fraction of the mean force.
    """
    if len(i) < 2:
        return np.arange(len(i))
    low, high = np.minimum(i, j), np.maximum(i, j)
    order = np.lexsort((high, low))
    repeated = np.flatnonzero((np.diff(low[order]) == 0) & (np.diff(high[order]) == 0))
    first, second = order[repeated], order[repeated + 1]
    on_high = np.where((i > j)[:, None], -force, force)
    off = np.hypot(*(on_high[first] - on_high[second]).T)
    for c in np.flatnonzero(off > allowed * np.hypot(*force.T).mean())[:1]:
        raise InputError(
            f"{place(second[c])}: {_pair(i, j, second[c])} were given before "
            f"({place(first[c])}) with another force; give each contact once, or twice with the "
            "same force"
        )
    return np.delete(np.arange(len(i)), second)


def check_contacts(
    contacts: Contacts, r: Floats, place: Callable[[int], str], allowed: float = OVERLAP_ALLOWED
) -> None:
    """InputError naming a repeated contact, or one whose disks overlap or are apart too much."""
    i, j, gap = contacts.i, contacts.j, contacts.gap
    for c in np.flatnonzero(np.abs(gap) > allowed * np.minimum(r[i], r[j]))[:1]:
        state = "overlap" if gap[c] < 0 else "are apart"
        usual = np.median(contacts.length / (r[i] + r[j]))
        unit = "check numbers, positions, radii and box"
        if abs(usual - 1) > allowed:
            unit += (
                f" (distances are usually {usual:.3g} times the sum of the radii: do positions and "
                "radii have the same unit of length?)"
            )
        raise InputError(
            f"{place(c)}: {_pair(i, j, c)} {state} by {abs(gap[c]):.3g}, more than "
            f"{allowed:.0%} of a radius; {unit}"
        )
    if twice := repeated(contacts):
        before, c = twice
        raise InputError(
            f"{place(c)}: {_pair(i, j, c)} were given before ({place(before)}); give each contact "
            "once"
        )


def check_disks(
    x: Floats,
    r: Floats,
    cell: Cell,
    place: Callable[[int], str],
    allowed: float = OVERLAP_ALLOWED,
    rigid: Integers | None = None,
) -> None:
    """InputError if radii, positions or cell cannot form a packing; place(g) names grain g.

    rigid (N,): numbers of the rigid bodies to which disks belong; those of one may overlap.
    """
    for g in np.flatnonzero(r <= 0)[:1]:
        raise InputError(
            f"{place(g)}: radius {r[g]:g} is not positive; correct or remove the grain"
        )
    largest = r.max()
    if largest < 1e-100 or largest > LARGEST_UNIT:
        raise InputError(f"the largest radius is {largest:g}; give lengths in another unit")
    for g in np.flatnonzero(r < largest / EXTENT)[:1]:
        raise InputError(
            f"{place(g)}: radius {r[g]:g} is too small compared with the largest, {largest:g}; "
            "correct or remove the grain"
        )
    none, box = np.empty((0, 2)), cell.box
    make_packing(x, r, box, make_contacts([], [], none, [], r), none, 0, tilt=cell.tilt)
    extent = max(np.abs(x).max(), box[np.isfinite(box)].max(initial=0.0))
    if extent > EXTENT * largest:
        raise InputError(
            f"positions or box extend over {extent / largest:.2g} largest radii, too far to "
            "resolve a contact; shift the origin, or check the unit of the radii"
        )
    _check_crowding(x, r, cell)
    i, j, gap = overlapping(x, r, cell)
    free = np.ones(len(i), dtype=bool) if rigid is None else rigid[i] != rigid[j]
    for c in np.flatnonzero(free & (-gap > allowed * np.minimum(r[i], r[j])))[:1]:
        raise InputError(
            f"{place(j[c])}: {_pair(i, j, c)} overlap by {-gap[c]:.3g}, more than "
            f"{allowed:.0%} of a radius; check positions, radii and box, and that their unit of "
            "length is the same"
        )


def _check_crowding(x: Floats, r: Floats, cell: Cell) -> None:
    # Pairs across a side are left out, as the tree does not support tilted cells; crowding still
    # shows.
    tree = cKDTree(cell.wrapped(x))
    if tree.count_neighbors(tree, 2 * r.max()) > CLOSE_PAIRS:
        raise InputError("too many grains lie within one diameter of each other; check the unit")


def _check_branches(misfit: Floats, largest: float, place: Callable[[int], str]) -> None:
    """InputError if a branch leads to no image; misfit: its remainder without cell vectors."""
    for c in np.flatnonzero(np.hypot(*misfit.T) > MISFIT * largest)[:1]:
        raise InputError(
            f"{place(c)}: normal and length end {np.hypot(*misfit[c]):.2g} away from the second "
            "grain; check positions, box, and that the normal points from i to j"
        )


def _pair(i: Integers, j: Integers, c: int) -> str:
    return f"grains {i[c]} and {j[c]} (counted from 0)"


def components(force: Floats, normal: Floats) -> Floats:
    """f_n and f_t (k, 2) of forces (k, 2) on contacts with normals n (k, 2); t = (−n_y, n_x)."""
    across = np.column_stack([-normal[:, 1], normal[:, 0]])
    return np.column_stack([np.sum(force * way, axis=1) for way in (normal, across)])


def vectors(forces: Floats, normal: Floats) -> Floats:
    """The forces f_n n + f_t t (…, k, 2) of components (…, k, 2) along normals (k, 2)."""
    across = np.column_stack([-normal[:, 1], normal[:, 0]])
    return forces[..., :1] * normal + forces[..., 1:] * across


def gain_by_reversing(
    contacts: tuple[Integers, Integers, Floats], forces: Floats, load: Floats, inner: Mask
) -> float:
    """Fraction by which the unbalance of inner grains falls if all f_t change sign; below 0: grows.

    Programs differ in the sign of f_t. contacts: i, j (k,) and the normals (k, 2); forces (k, 2),
    load (N, 2); inner (N,): grains that count, if they have _ENOUGH contacts. Unbalance at the
    level of rounding counts as none.
    """
    i, j, normal = contacts
    inner = inner & (np.bincount(np.concatenate([i, j]), minlength=len(load)) >= _ENOUGH)
    off = []
    for sign in (1, -1):
        force = vectors(forces * [1, sign], normal)
        total = load.copy()
        np.add.at(total, j, force)
        np.add.at(total, i, -force)
        off.append(np.hypot(*total[inner].T).sum())
    return float(1 - off[1] / off[0]) if off[0] > _ROUNDING * np.abs(forces).sum() else 0.0
