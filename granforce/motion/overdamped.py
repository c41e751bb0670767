"""Overdamped motion of stiff disks: the flow of contact dynamics while grains move.

On a fixed geometry the forces of contact dynamics follow f' = −D AᵀU with M U = A f − b (see
`flow`), regardless of how the geometry would change. If grains move with their velocities, x' = ε
U, a closed contact is a spring of stiffness D/ε: its overlap is ε f_n/D, as small as desired by the
choice of the softness ε, and f_t grows with the tangential displacement until it slides. U is
proportional to the unbalanced force, so nothing overshoots, and grains without contacts do not
move. The motion ends when every grain is in balance.

The normal force is −(D/ε) gap. For an open gap this is negative and no force acts; when it reaches
0 the disks touch. With this one number for both, an implicit step of length τ is

    φ⁺ = φ − τ D Aᵀ U⁺,    f⁺ = Π(φ⁺),    M U⁺ = A f⁺ − b,

which is piecewise linear in U⁺ and solved by Newton's method on the states of the contacts. Full
Newton steps find the states in two or three systems or not at all; a step that fails is shortened.
A line search takes five times as many systems, as sliding contacts lie on the kink of Π. Steps need
not be solved to rounding while grains move: the remaining unbalance of a step enters the velocities
of the next one.
"""

from typing import NamedTuple

import numpy as np

from granforce.motion.flow import Flows, answer, find_direction, make_flows, step_along
from granforce.motion.step import Step
from granforce.numerics import contact_matrix
from granforce.numerics.lanes import ONE, compiled, within
from granforce.tolerances import BALANCED
from granforce.types import Floats

# Growth of τ after a step, its cut after a failed one, and its bounds.
GROWTH, CUT = 3.0, 0.1
LONGEST, SHORTEST = 1e7, 1e-2
# Most Newton steps per implicit step.
NEWTON = 5
# Unbalance of an implicit step, as a fraction of the norm of velocities.
INEXACT = 0.03
# How a motion ended: grains moved by the stride or the steps were used up; balance; no step was
# short enough.
MOVED, AT_REST, STUCK = range(3)
# Indices of the counters.
SYSTEMS, STEPS, REPEATED = range(3)


class Overdamped(NamedTuple):
    """State of the motion; rows and places as in its Step. Arrays change in place."""

    flows: Flows  # of one lane: `forces` holds φ_n, f_t, `following` the forces f
    gap: Floats  # (N_c,) linear in the displacements
    moved: Floats  # (rows,) displacements since the geometry was updated
    strain: Floats  # (m,) strain of the box


def make_overdamped(
    step: Step, forces: Floats, gap: Floats, softness: float, pace: float
) -> Overdamped:
    """The motion from acting forces (N_c, 2) and gaps (N_c,), with the first τ."""
    flows = make_flows(step, 1)
    flows.load.rows[:, 0], flows.load.border[:, 0] = step.b, step.b_border
    acting = forces[:, 0] > 0
    open_ = np.minimum(-step.stiffness[:, 0] * gap / softness, 0.0)
    flows.forces[::2, 0] = np.where(acting, forces[:, 0], open_)
    flows.forces[1::2, 0] = np.where(acting, forces[:, 1], 0.0)
    flows.pace[0, 0] = pace
    return Overdamped(flows, gap.copy(), np.zeros(len(step.b)), np.zeros(len(step.b_border)))


@compiled
def move(step, motion, softness, stride, steps, counts, stop):
    """Do up to `steps` implicit steps; return MOVED, AT_REST or STUCK.

    Ends once a grain has moved by `stride` (in largest radii), or once stop[0] is set.
    """
    flows = motion.flows
    for _ in range(steps):
        if stop[0]:
            return MOVED
        counts[STEPS] += 1
        if not _solved(step, flows, counts, stop):
            counts[REPEATED] += 1
            contact_matrix.copy(flows.velocity.rows, flows.kept.rows, ONE)
            contact_matrix.copy(flows.velocity.border, flows.kept.border, ONE)
            flows.pace[0, 0] *= CUT
            if flows.pace[0, 0] < SHORTEST:
                return STUCK
            continue
        pace = flows.pace[0, 0]
        heaviest, fastest, farthest = _carried(step, motion, softness)
        if heaviest <= BALANCED / 10:
            return AT_REST
        flows.pace[0, 0] = min(LONGEST, GROWTH * pace, stride / (softness * fastest))
        if farthest > stride:
            return MOVED
    return MOVED


@within
def _solved(step, flows, counts, stop):
    """Newton's method on the states of the contacts; returns whether they agree with the forces."""
    rows, border, direction = flows.velocity.rows, flows.velocity.border, flows.direction
    contact_matrix.copy(flows.kept.rows, rows, ONE)
    contact_matrix.copy(flows.kept.border, border, ONE)
    answer(step, flows, ONE)
    for _ in range(NEWTON):
        find_direction(step, flows, stop, ONE)
        counts[SYSTEMS] += 1
        step_along(rows, flows.base.rows, 1.0, direction.rows, ONE)
        step_along(border, flows.base.border, 1.0, direction.border, ONE)
        answer(step, flows, ONE)
        if flows.changed[0, 0] == 0.0 or flows.least[0, 0] <= INEXACT**2 * _energy(step, flows):
            return True
    return False


@within
def _energy(step, flows):
    """Σ M U²."""
    energy = 0.0
    for k in range(len(step.mass)):
        energy += step.mass[k] * flows.velocity.rows[k, 0] ** 2
    for k in range(len(step.mass_border)):
        energy += step.mass_border[k] * flows.velocity.border[k, 0] ** 2
    return energy


@within
def _carried(step, motion, softness):
    """Move grains, gaps and φ by a step; return largest |M U|, |U| and displacement of a grain."""
    flows, pace = motion.flows, motion.flows.pace[0, 0]
    rows, border = flows.velocity.rows, flows.velocity.border
    for c in range(len(step.stiffness)):
        w_n, _ = contact_matrix.pull(step.network, c, rows, border, ONE)
        flows.forces[2 * c, 0] -= pace * step.stiffness[c, 0] * w_n
        flows.forces[2 * c + 1, 0] = flows.following[2 * c + 1, 0]
        motion.gap[c] += softness * pace * w_n
    heaviest, fastest, farthest = 0.0, 1e-300, 0.0
    for k in range(len(step.mass)):
        motion.moved[k] += softness * pace * rows[k, 0]
        heaviest = max(heaviest, abs(step.mass[k] * rows[k, 0]))
        fastest = max(fastest, abs(rows[k, 0]))
        farthest = max(farthest, abs(motion.moved[k]))
    for k in range(len(step.mass_border)):
        motion.strain[k] += softness * pace * border[k, 0]
        heaviest = max(heaviest, abs(step.mass_border[k] * border[k, 0]))
    return heaviest, fastest, farthest
