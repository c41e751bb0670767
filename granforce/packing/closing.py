"""Contacts of a finished packing, and the linear programs that finish one without friction.

At μ = 0 contact dynamics does not reach isostaticity; instead linear programs shrink the box under
linearised non-overlap. A box with a free shape has three strains instead of one (e_x, e_y, g as in
`box_motion`), and its networks must carry the same pressure along x and y and no shear stress.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy import sparse

from granforce.cell import Cell
from granforce.fields import record
from granforce.forces.build import ensemble
from granforce.forces.nearest import nearest
from granforce.motion.contact_dynamics import Motion
from granforce.numerics import highs as programs
from granforce.packing.neighbours import find_pairs, separations
from granforce.packing.pair_list import SKIN, cell_of
from granforce.records import (
    Contacts,
    NotJammedError,
    Packing,
    UndecidedError,
    make_contacts,
    make_packing,
    refuse_shapes,
    takes,
)
from granforce.system import cancelling
from granforce.tolerances import CLOSED, TOUCHING
from granforce.types import Floats, Integers, Mask

# Largest displacement of a grain per linear program, along each axis.
TRUST = 0.05
# Bounds of each strain of the box, and its share of the change of area, by the number of strains.
STRAINS = {
    1: ((-TRUST / 2,), (0.0,), (1.0,)),
    3: ((-TRUST / 3,) * 3, (TRUST / 3,) * 3, (0.5, 0.5, 0.0)),
}


def _rates(motion: Motion) -> int:
    """Number of strain rates of the box."""
    return motion.dilation.size


def prescribed_of(motion: Motion) -> dict[str, Any]:
    """What the ensemble prescribes in addition to the pressure, in units of it."""
    if _rates(motion) <= 1:
        return {}
    return {"prescribed": "stress", "stress": (1.0, 1.0, 0.0)}


@record
class Margin(NamedTuple):
    """How clearly contacts differ from other pairs; gaps in largest radii."""

    contact: Annotated[float, "largest |gap| of a contact"]
    other: Annotated[float, "least gap of any other pair of disks; SKIN / 2 if none is that close"]

    @property
    def certain(self) -> bool:
        """Whether contacts are closed to rounding, 10⁻¹¹, and other pairs open by more than 10⁻⁹.

        Otherwise it is not certain that some pair without force touches.
        """
        return self.contact < CLOSED and self.other > TOUCHING


@takes(Packing)
def margin(packing: Packing) -> Margin:
    """The Margin of a packing's contacts, from the gaps of all its pairs.

    In a packing of rigid disks at rest, contacts that carry force are closed to rounding, 10⁻¹³. A
    pair without force is a contact if its gap is below 10⁻⁹; gaps near this limit, on both sides,
    make the list of contacts uncertain. Soft or measured disks overlap, and their contacts have no
    margin.

    Parameters
    ----------
    packing : Packing
        Disks.

    Returns
    -------
    Margin
        Largest gap of a contact, and least gap of any other pair.
    """
    refuse_shapes(packing, "the margin is defined")
    if not len(packing.r):
        return Margin(0.0, SKIN / 2)
    unit = packing.r.max()
    _, _, gap = apart(packing, SKIN / 2)
    return Margin(
        float(np.abs(packing.contacts.gap).max(initial=0.0) / unit),
        float(gap.min(initial=SKIN / 2 * unit) / unit),
    )


def apart(packing: Packing, near: float) -> tuple[Integers, Integers, Floats]:
    """Grains i, j (P,) of pairs that are no contacts, and their gaps (P,) below `near`.

    near is in largest radii, gaps are in the unit of x. Each image of a grain counts by itself.
    """
    x, r = packing.x, packing.r
    i, j, shift = find_pairs(x, r, packing.cell, near * r.max())
    normal, _, gap = separations(x, r, packing.cell, i, j, shift)
    other = ~_listed(packing.contacts, i, j, normal, len(r))
    return i[other], j[other], gap[other]


def _listed(contacts: Contacts, i: Integers, j: Integers, normal: Floats, n: int) -> Mask:
    """Mask of the pairs i < j (P,) with normals (P, 2) that are contacts of a list."""
    turned = contacts.i > contacts.j
    direction = np.where(turned[:, None], -contacts.normal, contacts.normal)
    key = np.minimum(contacts.i, contacts.j) * n + np.maximum(contacts.i, contacts.j)
    order = np.argsort(key, kind="stable")
    first, last = (np.searchsorted(key[order], i * n + j, side) for side in ("left", "right"))
    listed = np.zeros(len(i), bool)
    # Two grains touch twice only through different images, with normals at 60° or more.
    for k in range(int((last - first).max(initial=0))):
        some = np.flatnonzero(first + k < last)
        same = direction[order[first[some] + k]]
        listed[some] |= np.sum(normal[some] * same, axis=1) >= 0.75
    return listed


def _on_backbone(packing: Packing, **conditions: Any) -> Packing | None:
    """The packing with forces on its backbone alone, balanced to rounding, or None."""
    try:
        S = ensemble(packing, **conditions)
    except (NotJammedError, UndecidedError):
        return None
    forces = nearest(S, S.original).forces
    return packing._replace(forces=S.expand(forces)) if S.admits(forces) else None


def packing_of(
    motion: Motion, x: Floats, cell: Cell, touching: Mask, force: Floats, mu: float
) -> Packing:
    i, j, shift = motion.i[touching], motion.j[touching], motion.shift[touching]
    normal, length, _ = separations(x, motion.r, cell, i, j, shift)
    contacts = make_contacts(i, j, normal, np.maximum(length, 0), motion.r)
    # Overlap left by contact dynamics is removed from the finished packing: rigid arms.
    contacts = contacts._replace(arm_i=motion.r[i], arm_j=motion.r[j])
    return make_packing(x, motion.r, cell.box, contacts, force[touching], mu, 1.0, tilt=cell.tilt)


def _stretch(normal: Floats, length: Floats, rates: int) -> Floats:
    """First-order change (pairs, rates) of each gap with the strain of the box."""
    if rates == 1:
        return length[:, None]
    n_x, n_y = normal.T
    return np.column_stack([n_x * n_x, n_y * n_y, n_x * n_y]) * length[:, None]


def strained(x: Floats, cell: Cell, strain: Floats) -> tuple[Floats, Cell]:
    """Points (N, 2) and cell after a strain (1,) of a square box, or (3,) of a free cell."""
    if len(strain) == 1:
        return x * (1 + strain), Cell(cell.box * (1 + strain), cell.tilt)
    e_x, e_y, g = strain
    D = np.array([[e_x, g], [0.0, e_y]])
    a, b = cell.vectors + cell.vectors @ D.T
    return x + x @ D.T, Cell(np.array([a[0], b[1]]), float(b[0]))


def _approach(i: Integers, j: Integers, normal: Floats, n: int) -> sparse.csc_matrix:
    """Sparse (pairs, 2n) matrix: first-order change of each gap with the displacements."""
    row = np.repeat(np.arange(len(i)), 4)
    column = np.column_stack([2 * i, 2 * i + 1, 2 * j, 2 * j + 1]).ravel()
    value = np.column_stack([-normal, normal]).ravel()
    return sparse.csc_matrix((value, (row, column)), shape=(len(i), 2 * n))


def shrink_to_isostatic(motion: Motion, mu: float, work: dict[str, Any]) -> Packing | None:
    """Finish a frictionless packing by linear programs that shrink the box until no grain can move.

    minimise ε subject to gap_c + n_c·(u_j − u_i) + ε ℓ_c ≥ 0, |u| ≤ TRUST. Distances are convex in
    the displacements, so no step creates an overlap; at the end the contacts that carry force are
    exactly isostatic, N_c = 2M − 1.
    """
    x, cell = _without_overlap(motion)
    for _ in range(60):
        cancelling.check("compaction")
        i, j, shift = find_pairs(x, motion.r, cell, 4 * TRUST)
        normal, length, gap = separations(x, motion.r, cell, i, j, shift)
        stretch = _stretch(normal, length, _rates(motion))
        move, strain = _shrink_program(i, j, normal, stretch, gap, len(x))
        work["linear_programs"] += 1
        x, cell = strained(x, cell, strain)
        x = x + move
        # Rattlers move arbitrarily to the end; only the box shows that nothing is left to do.
        if strain[:2].mean() > -1e-13:
            break
    i, j, shift = find_pairs(x, motion.r, cell, TOUCHING)
    at_rest = motion._replace(i=i, j=j, shift=shift)
    touching = np.ones(len(i), bool)
    packing = packing_of(at_rest, x, cell, touching, np.zeros((len(i), 2)), mu)
    return _on_backbone(packing, **prescribed_of(motion))


def _without_overlap(motion: Motion) -> tuple[Floats, Cell]:
    """Centres and cell, expanded until no disks overlap: a feasible start for the programs."""
    pairs = motion.i, motion.j, motion.shift
    _, length, gap = separations(motion.x, motion.r, cell_of(motion), *pairs)
    growth = 1 + max(0.0, float(np.max(-gap / length, initial=0.0)))
    return motion.x * growth, Cell(motion.box * growth, float(motion.tilt[0]) * growth)


def _shrink_program(
    i: Integers, j: Integers, normal: Floats, stretch: Floats, gap: Floats, n: int
) -> tuple[Floats, Floats]:
    """Displacements (n, 2) and strain (1,) or (3,) that solve the linear program, by HiGHS."""
    R = sparse.hstack([_approach(i, j, normal, n), sparse.csc_matrix(stretch)])
    # Two grains approach by at most 2√2 TRUST, and by TRUST with the box: within the list's reach.
    least, most, along = STRAINS[stretch.shape[1]]
    lower = np.append(np.full(2 * n, -TRUST), least)
    upper = np.append(np.full(2 * n, TRUST), most)
    # The duals are the contact forces: this cost makes their mean about 1, as tolerances expect.
    cost = np.append(np.zeros(2 * n), 4.0 * n * np.array(along))
    rows = -gap, np.full(len(gap), np.inf)
    model = programs.bounded(R, rows, (lower, upper), cost)
    u = programs.optimal(model)
    if u is None:
        raise UndecidedError(
            "the last step of the compaction is undecided: no solver found the optimum of one of "
            "its linear programs; use another seed"
        )
    return u[: 2 * n].reshape(-1, 2), u[2 * n :]
