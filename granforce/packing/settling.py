"""The last phase of a compaction: from slow grains to a packing at rest, with a test.

1. Overdamped motion of stiff disks (`motion.overdamped`), starting with the forces of the dynamics,
   until every grain and the box are in balance to rounding. Disks then overlap by about the
   softness.
2. Overlaps are closed at constant forces: the least motion Σ M u² that brings the gaps of pressing
   contacts to 0 and leaves no other pair overlapping. As contacts turn, forces become unbalanced by
   about the displacements, and the motion resumes with stiffer disks; overlaps are closed again,
   and so on. The error converges quadratically, so that three rounds reach rounding: pressing pairs
   are contacts, all others have a gap.
3. The test of rest (`motion.rest`): from the forces of the last round, and with noise on all
   of them, the exact step of contact dynamics comes to rest without moving. If grains move, the
   motion resumes at 1.
"""

from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from granforce.forces.balance import stress_rows
from granforce.motion import overdamped
from granforce.motion.box_motion import BOX_MASS
from granforce.motion.contact_dynamics import Motion
from granforce.motion.flow import STEADY, Push
from granforce.motion.flow_lanes import relax
from granforce.motion.rest import Rest, rest
from granforce.motion.step import Step, effective_masses
from granforce.numerics import contact_matrix
from granforce.numerics.contact_matrix import Network
from granforce.packing.closing import packing_of, prescribed_of, strained
from granforce.packing.neighbours import separations
from granforce.packing.pair_list import cell_of, motionless, relisted
from granforce.packing.pouring import behind_floor, weights
from granforce.records import (
    NotJammedError,
    Packing,
    UndecidedError,
    make_contacts,
    with_friction,
)
from granforce.system import cancelling
from granforce.system.compiled import wait_for_kernels
from granforce.tolerances import CLOSED, MANY_DISKS, SAME_STATE, TOUCHING
from granforce.types import Floats, Integers, Mask

# Softness ε of the overdamped motion: the overlap of a pressing contact, in largest radii. At 10⁻⁴
# packings come to rest with more contacts than rigid disks: h is 13.0 ± 1.0 instead of 5.9 ± 0.9 (μ
# = 1, N = 200), and 8.1 ± 0.7 at 10⁻⁵.
SOFTNESS = 1e-6
# Displacement after which the geometry is updated, in largest radii: the neglected quadratic terms
# of the gaps change forces by a hundredth.
STRIDE = 0.1 * SOFTNESS**0.5
# Softness of disks that slump on a floor, and how often their linear systems may be used up.
SOFTER, SLUMPS = 1e-4, 50
# Implicit steps between two calls of `look`; linear systems after which the dynamics takes over:
# fewer beyond MANY_DISKS, in inverse proportion to their number, as a system then costs far more
# than a sweep.
STEPS_A_LOOK, MOST_SYSTEMS = 50, 500
FIRST_PACE = 100.0
# Pairs closer than NEAR take part; they are chosen again once two grains may have approached by
# APPROACHED (both in largest radii).
NEAR, APPROACHED = 0.02, 0.015
# Most rounds of closing, and the largest displacement in one of them, in largest radii.
CLOSINGS, FARTHEST = 8, 1e-2
# Factor on forces at the start of a closing, so that displacements open only contacts that press
# far less than others.
ENLARGED = 1e3
# Fraction of its gap that a closing leaves to a pair that does not press: without it, pairs would
# touch because of the closing alone. An overlap becomes a gap of this fraction of it.
KEPT_APART = 0.5
CLOSING_STEPS = 60
# How often grains that move under noise continue here before the dynamics takes over again.
ATTEMPTS = 20

Look = Callable[[Motion, float], object]
Mu = float | Floats  # friction coefficient, or (2,) those of disks and of the floor


class _Near(NamedTuple):
    """The pairs that take part."""

    pairs: Integers  # (K,) of the motion's list
    network: Network
    drift: float  # drift of the motion when they were chosen


class _Place(NamedTuple):
    """The step problem of a geometry, and the places of its rows."""

    step: Step
    gap: Floats  # (K,)
    grains: Integers  # (N, 3) rows of the grains
    unit: float  # Σ ℓ


def come_to_rest(
    motion: Motion, mu: Mu, work: dict[str, Any], look: Look | None = None
) -> tuple[Motion, Packing | None, Rest | None]:
    """The motion at rest, its packing in natural units and the test of rest; None if it moves.

    After ATTEMPTS tests in which noise moved grains, the last packing and its failed test. work:
    counters to increase. look(motion, unbalance) is called repeatedly.
    """
    motion.velocity[:], motion.dilation[:] = 0.0, 0.0
    wait_for_kernels(lambda: cancelling.check("compaction"))
    for _ in range(ATTEMPTS):
        motion, rested = _creep(motion, mu, work, look)
        if rested:
            motion, rested = _closed(motion, mu, work, look)
        if not rested:
            return motion, None, None
        packing, listed = _packing(motion, mu, work)
        work["certificates_tried"] += 1
        try:
            certificate = rest(packing, **prescribed_of(motion))
        except (NotJammedError, UndecidedError):
            return motion, None, None
        if certificate.at_rest:
            return motion, packing._replace(forces=certificate.forces), certificate
        motion.force[:] = 0.0
        motion.force[listed] = certificate.forces
    return motion, packing, certificate


def compile_kernels() -> None:
    """Compile the kernels of this phase: a crystal comes to rest."""
    row, place = np.divmod(np.arange(16), 4)
    x = np.column_stack([place + 0.5 * (row % 2), row * np.sqrt(0.75)])
    crystal = motionless(x, np.full(16, 0.5), np.array([4.0, 2 * np.sqrt(3)]), np.zeros(1))
    come_to_rest(crystal, 0.1, Counter())


def slump(motion: Motion, mu: Mu, work: dict[str, Any], look: Look | None = None) -> Motion:
    """Overdamped motion of softer disks, in longer strides, SLUMPS times or until they balance."""
    for _ in range(SLUMPS):
        motion, rested = _creep(motion, mu, work, look, SOFTER)
        if rested:
            break
    return motion


def same_state(one: Packing, other: Packing) -> bool:
    """Whether two packings of the same grains have the same contacts and forces to SAME_STATE."""
    if len(one.contacts.i) != len(other.contacts.i):
        return False
    sorted_rows = []
    for packing in (one, other):
        c, scale = packing.contacts, packing.forces[:, 0].mean()
        rows = np.column_stack([c.i, c.j, c.normal, packing.forces / scale])
        sorted_rows.append(rows[np.lexsort((c.j, c.i))])
    return bool(np.abs(sorted_rows[0] - sorted_rows[1]).max(initial=0.0) <= SAME_STATE)


def _creep(
    motion: Motion,
    mu: Mu,
    work: dict[str, Any],
    look: Look | None,
    softness: float = SOFTNESS,
) -> tuple[Motion, bool]:
    """Overdamped motion; returns whether everything came to rest."""
    stride = STRIDE * (softness / SOFTNESS) ** 0.5
    pace = FIRST_PACE
    counts, near, ended = np.zeros(3, dtype=np.int64), None, overdamped.MOVED
    fewer = min(1.0, MANY_DISKS / len(motion.r))
    steps = max(1, round(fewer * STEPS_A_LOOK))
    while counts[overdamped.SYSTEMS] < fewer * MOST_SYSTEMS:
        cancelling.check("compaction")
        motion, near = _chosen(motion, near)
        place = _place(motion, near, mu)
        moving = overdamped.make_overdamped(
            place.step, motion.force[near.pairs], place.gap, softness, pace
        )
        velocity = moving.flows.velocity
        velocity.rows[place.grains, 0] = motion.velocity
        velocity.border[:, 0] = motion.dilation.ravel()
        ended = overdamped.move(
            place.step, moving, softness, stride, steps, counts, cancelling.flag()
        )
        pace = float(moving.flows.pace[0, 0])
        motion.velocity[:] = velocity.rows[place.grains, 0]
        motion.dilation.ravel()[:] = velocity.border[:, 0]
        _displace(motion, moving.moved[place.grains], moving.strain / place.unit)
        _correct(motion, near, place.step, moving, softness)
        if look is not None:
            look(motion, _unbalance(place.step, velocity))
        if ended != overdamped.MOVED:
            break
    motion.velocity[:], motion.dilation[:] = 0.0, 0.0
    work["linear_systems"] += int(counts[overdamped.SYSTEMS])
    work["implicit_steps"] += int(counts[overdamped.STEPS])
    return motion, ended == overdamped.AT_REST


def _chosen(motion: Motion, near: _Near | None) -> tuple[Motion, _Near]:
    """Choose the pairs that take part again if others may have come close."""
    if near is not None and motion.drift[0] - near.drift < APPROACHED:
        return motion, near
    motion = relisted(motion)
    gap = separations(motion.x, motion.r, cell_of(motion), motion.i, motion.j, motion.shift)[2]
    pairs = np.flatnonzero((gap < NEAR) | (motion.force[:, 0] > 0))
    normal, length, _ = _geometry(motion, pairs)
    network = contact_matrix.make_network(
        motion.x, motion.i[pairs], motion.j[pairs], *_columns(motion, pairs, normal, length)
    )
    return motion, _Near(pairs, network, float(motion.drift[0]))


def _geometry(motion: Motion, pairs: Integers) -> tuple[Floats, Floats, Floats]:
    which = motion.i[pairs], motion.j[pairs], motion.shift[pairs]
    return separations(motion.x, motion.r, cell_of(motion), *which)


def _columns(
    motion: Motion, pairs: Integers, normal: Floats, length: Floats, frictionless: bool = False
) -> tuple[Floats, Floats, Floats]:
    """Action of unit f_n, f_t on the rows of both grains (K, 3, 2) and of the box (K, m, 2)."""
    first, second = np.zeros((2, len(pairs), 3, 2))
    second[:, :2, 0] = normal
    second[:, :2, 1] = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    first[:, :2] = -second[:, :2]
    first[:, 2, 1] = second[:, 2, 1] = -1.0  # torque/r of rigid disks
    i, j, r = motion.i[pairs], motion.j[pairs], motion.r
    if motion.dilation.size == 0:
        second[j >= len(r) // 2] = 0.0  # behind the floor nothing moves
    rows = stress_rows(make_contacts(i, j, normal, length, r)) / length.sum()
    if frictionless:
        first[..., 1] = second[..., 1] = rows[..., 1] = 0.0
    pressure = rows[0] + rows[1]
    if motion.dilation.size <= 1:
        return first, second, pressure[:, None][:, : motion.dilation.size]
    return first, second, np.stack([pressure, 0.5 * (rows[0] - rows[1]), rows[2]], axis=1)


def _place(motion: Motion, near: _Near, mu: Mu) -> _Place:
    normal, length, gap = _geometry(motion, near.pairs)
    i, j, unit = motion.i[near.pairs], motion.j[near.pairs], float(length.sum())
    network = contact_matrix.turned(
        near.network.layout, i, j, *_columns(motion, near.pairs, normal, length, np.max(mu) == 0)
    )
    grains = 3 * network.layout.position[:, None] + np.arange(3)
    mass, load = np.empty(grains.size), np.zeros(grains.size)
    mass[grains] = motion.mass[:, None] * np.array([1.0, 1.0, 0.5])
    box = b = np.zeros(0)
    if motion.dilation.size:
        volume = float(np.prod(motion.box))
        box = np.full(motion.dilation.size, 2 * volume * BOX_MASS / unit**2)
        b = np.zeros(len(box))
        b[0] = 2 * volume / unit
    else:
        load[grains[:, 1]] = weights(motion)
    stiffness = effective_masses(network, mass, box)
    everywhere = np.append(grains.ravel(), grains.size + np.arange(len(box)))
    closing, friction = np.zeros(len(gap)), _friction(motion, j, mu)
    step = Step(network, load, b, mass, box, stiffness, closing, friction, everywhere)
    return _Place(step, gap, grains, unit)


def _displace(motion: Motion, moved: Floats, strain: Floats) -> None:
    """Move grains (N, 3) and the box, by the strains (m,) conjugate to its rows."""
    if len(strain) == 3:
        mean, half, shear = strain
        strain = np.array([mean + 0.5 * half, mean - 0.5 * half, shear])
    if len(strain):
        x, cell = strained(motion.x, cell_of(motion), strain)
        motion.x[:], motion.box[:], motion.tilt[0] = x + moved[:, :2], cell.box, cell.tilt
    else:
        motion.x[:] = behind_floor(motion.x + moved[:, :2], motion.r)
    farthest = np.hypot(*moved[:, :2].T).max()
    motion.drift[0] += 2.0 * farthest + 3.0 * np.abs(strain).sum() * motion.r.max()


def _correct(
    motion: Motion, near: _Near, step: Step, moving: overdamped.Overdamped, softness: float
) -> None:
    """Keep the forces when the quadratic terms of displacements change the gaps."""
    gap = _geometry(motion, near.pairs)[2]
    forces = moving.flows.forces.reshape(-1, 2).copy()
    forces[:, 0] -= step.stiffness[:, 0] * (gap - moving.gap) / softness
    forces[forces[:, 0] <= 0] = 0.0
    motion.force[:] = 0.0
    motion.force[near.pairs] = forces


def _unbalance(step: Step, velocity: Any) -> float:
    return float(np.abs(step.mass * velocity.rows[:, 0]).max())


def _closed(motion: Motion, mu: Mu, work: dict[str, Any], look: Look | None) -> tuple[Motion, bool]:
    """The motion with overlaps closed and at rest again; returns whether it succeeded."""
    for _ in range(CLOSINGS):
        motion, near = _chosen(motion, None)
        if not _close(motion, near, work):
            return motion, False
        motion, rested = _creep(motion, mu, work, look)
        if not rested:
            return motion, False
        gap, pressing = _gaps(motion)
        if np.abs(gap[pressing]).max() < CLOSED and gap.min() > -CLOSED:
            return motion, True
    return motion, False


def _gaps(motion: Motion) -> tuple[Floats, Mask]:
    """Gaps of all listed pairs, and a mask of the pressing ones."""
    gap = separations(motion.x, motion.r, cell_of(motion), motion.i, motion.j, motion.shift)[2]
    return gap, motion.force[:, 0] > 0


def _close(motion: Motion, near: _Near, work: dict[str, Any]) -> bool:
    """Move grains and box by the least motion that closes pressing contacts without overlaps.

    It is a frictionless step from rest in which only the gaps are unbalanced. If overlaps had
    jammed more contacts than rigid disks can close at once, the weakest contacts open.
    """
    place = _place(motion, near, 0.0)
    forces = motion.force[near.pairs] * [ENLARGED, 0.0]
    network, rows = place.step.network, np.zeros(len(place.step.mass))
    for side, first in ((network.high, 0), (network.low, 3)):
        for k in range(3):
            np.add.at(rows, 3 * side + k, network.columns[:, first + k] * forces[:, 0])
    border = network.border[:, : len(place.step.b_border)].T @ forces[:, 0]
    apart = np.where(forces[:, 0] > 0, place.gap, place.gap - KEPT_APART * np.abs(place.gap))
    step = place.step._replace(b=rows, b_border=border, closing=apart)
    outcome = relax(step, Push(forces, 0, 0.0, CLOSING_STEPS, STEADY))
    work["linear_systems"] += outcome.iterations
    moved = outcome.velocity[: rows.size].reshape(-1, 3)
    if not outcome.converged or np.abs(moved).max() > FARTHEST:
        return False
    _displace(motion, moved, outcome.velocity[rows.size :] / place.unit)
    motion.force[near.pairs[outcome.forces[:, 0] == 0]] = 0.0
    return True


def _packing(motion: Motion, mu: Mu, work: dict[str, Any]) -> tuple[Packing, Integers]:
    """The packing in natural units, and the places of its contacts in the list."""
    gap, pressing = _gaps(motion)
    touching = pressing | (gap < TOUCHING)
    work["touching_without_force"] = int((touching & ~pressing).sum())
    packing = packing_of(
        motion, motion.x, cell_of(motion), touching, motion.force, float(np.max(mu))
    )
    if not motion.dilation.size:
        packing = _on_floor(packing, motion, mu)
    return packing, np.flatnonzero(touching)


def _friction(motion: Motion, j: Integers, mu: Mu) -> Floats:
    """Friction coefficients (k,) of pairs with second grains j (k,)."""
    friction = np.full(len(j), np.max(mu))
    if np.ndim(mu):
        friction[j >= len(motion.r) // 2] = np.ravel(mu)[1]
    return friction


def _on_floor(packing: Packing, motion: Motion, mu: Mu) -> Packing:
    """The packing of disks on a floor, whose grains behind it are those that are touched."""
    disks, c = len(packing.r) // 2, packing.contacts
    behind = np.unique(c.j[c.j >= disks])
    kept = np.append(np.arange(disks), behind)
    load = np.zeros((len(kept), 3))
    load[:, 1] = -weights(motion)[kept]
    load[disks:] = np.nan
    j = np.where(c.j < disks, c.j, disks + np.searchsorted(behind, c.j))
    c, _ = with_friction(c, _friction(motion, c.j, mu))
    return packing._replace(
        x=packing.x[kept],
        r=packing.r[kept],
        contacts=c._replace(j=j),
        load=load,
        pressure=np.nan,
        info={"walls": [[0.0, 0.0, float(packing.box[0]), 0.0]], "disks": disks, "pressing": []},
    )
