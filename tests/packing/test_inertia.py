"""Rest by inertia alone, in a dynamics of its own: the drag of `pack` changes neither h nor η3.

From the state in which `pack` lets drag begin, exact implicit steps of contact dynamics follow
without any drag. A step solves the contact laws for accelerations U: inertia takes the momentum of
the step before, b − m v/Δt, and a gap closes as gap/Δt². Steps grow as the motion slows down, as
long as no grain moves farther than STRIDE in one of them.
"""

import numpy as np
import pytest

import granforce as gf
from granforce.motion import contact_dynamics
from granforce.motion.flow import Push, make_flows, outcome_of, start, until_one_ends
from granforce.motion.step import effective_masses
from granforce.numerics import contact_matrix
from granforce.numerics.lanes import ONE
from granforce.packing import compaction, settling
from granforce.packing.closing import packing_of
from granforce.packing.neighbours import separations
from granforce.packing.pair_list import cell_of, relisted
from granforce.system import cancelling

pytestmark = pytest.mark.slow

N, SEEDS, FRICTIONS = 100, range(1, 21), (0.5, 1.0, 3.0, 10.0)
BOX_MASS = 100.0  # of the default compaction, in masses of the largest disk
NEAR, APPROACHED = 0.06, 0.05  # pairs that take part, and motion after which they are chosen again
STRIDE, LONGEST, MOST_STEPS = 0.01, 100.0, 700
AT_REST = 1e-8  # ⟨f_n⟩, largest unbalanced force
PRESSING, TOUCHING = 1e-4, 1e-9  # ⟨f_n⟩, and largest gap in largest radii


def state_where_drag_begins(mu, seed):
    """The Motion of `pack` as soon as it is nearly balanced."""
    dt, sweeps = compaction.default_steps(mu, None, None)
    rng = np.random.default_rng(seed)
    r = compaction.draw_radii("uniform:0.5,1", N, rng)
    motion = compaction._dilute_gas(r / r.max(), rng, 1)
    shortest = compaction.SHORTEST * dt
    motion.pace[:] = shortest, contact_dynamics.MOST_RELAXATION
    settled = sweeps // compaction.SETTLING if mu >= compaction.SETTLED_FROM else 0
    pace = contact_dynamics.Pace(
        BOX_MASS, shortest, dt, compaction.STRIDE, int(sweeps), settled, 0.01
    )
    counters, work = np.zeros(4, np.int64), dict.fromkeys(compaction.WORK, 0)
    unbalance = np.inf
    while unbalance > compaction.NEARLY_BALANCED:
        motion, _, unbalance = compaction._advance(motion, mu, pace, counters, work)
        assert counters[0] < 100_000
    return motion


def gaps(motion):
    return separations(motion.x, motion.r, cell_of(motion), motion.i, motion.j, motion.shift)[2]


def pairs_near(motion):
    motion = relisted(motion)
    pairs = np.flatnonzero((gaps(motion) < NEAR) | (motion.force[:, 0] > 0))
    normal, length, _ = settling._geometry(motion, pairs)
    columns = settling._columns(motion, pairs, normal, length)
    network = contact_matrix.make_network(motion.x, motion.i[pairs], motion.j[pairs], *columns)
    return motion, settling._Near(pairs, network, float(motion.drift[0]))


def accelerations(motion, near, mu, dt):
    """One exact step: the place of its problem, U of grains and box, and its Outcome."""
    place = settling._place(motion, near, mu)
    step, box_mass = place.step, place.step.mass_border * (BOX_MASS / settling.BOX_MASS)
    before = np.zeros(len(step.mass))
    before[place.grains] = motion.velocity * np.column_stack([*np.ones((2, N)), motion.r])
    box_before = motion.dilation * place.unit
    closing = np.where(place.gap > 0, place.gap, np.maximum(0.5 * place.gap, -1e-3)) / dt**2
    step = step._replace(
        b=step.b - step.mass * before / dt,
        b_border=step.b_border - box_mass * box_before / dt,
        mass_border=box_mass,
        closing=closing,
        stiffness=effective_masses(step.network, step.mass, box_mass),
    )
    flows = make_flows(step, 1)
    start(step, flows, 0, Push(motion.force[near.pairs], 0, 0.0, 100, 1e-7))
    for velocity in (flows.velocity, flows.kept):
        velocity.rows[:, 0], velocity.border[:, 0] = before / dt, box_before / dt
    until_one_ends(step, flows, 1e-13, cancelling.flag(), ONE)
    outcome = outcome_of(step, flows, 0, 0.0)
    rows, border = np.split(outcome.velocity, [len(step.mass)])
    return place, rows.reshape(-1, 3), border, outcome


def coast(motion, mu):
    """Follow a Motion by inertia: (the packing when its grains came to rest, and at the end)."""
    motion, near = pairs_near(motion)
    dt, steps, at_rest = float(motion.pace[0]), 0, None
    while steps < MOST_STEPS:
        if motion.drift[0] - near.drift > APPROACHED:
            motion, near = pairs_near(motion)
        place, U, border, outcome = accelerations(motion, near, mu, dt)
        far = np.hypot(*(U[:, :2] * dt**2).T).max()
        failed = not outcome.converged and outcome.breach > max(1e-3, 1e-9 / far)
        if (failed or far > 2 * STRIDE) and dt > 1e-3:
            dt *= 0.5
            continue
        steps, velocity = steps + 1, motion.velocity.copy()
        motion.velocity[:] = U * dt
        motion.velocity[:, 2] /= motion.r
        motion.dilation[:] = border * dt / place.unit
        motion.force[:] = 0.0
        motion.force[near.pairs] = outcome.forces
        settling._displace(motion, U * dt**2, border * dt**2 / place.unit)
        change = motion.mass[:, None] * (motion.velocity - velocity)[:, :2] / dt
        mean = outcome.forces[outcome.forces[:, 0] > 0, 0].mean()
        if at_rest is None and np.abs(change).max() < AT_REST * mean:
            at_rest = measured(motion, mu, touching=True)
        dt = min(LONGEST, dt * np.clip(STRIDE / far, 0.5, 1.3))
    return at_rest, measured(motion, mu, touching=False), measured(motion, mu, touching=True)


def measured(motion, mu, *, touching):
    """h and exact η3 of the packing with all pairs that touch, or with those that press only."""
    gap, force = gaps(motion), motion.force[:, 0]
    force = force / force[force > 1e-6].mean()
    contacts = (gap < TOUCHING) | (force > 0) if touching else force > PRESSING
    forces = motion.force * contacts[:, None]
    return of_packing(packing_of(motion, motion.x, cell_of(motion), contacts, forces, mu))


def of_packing(packing):
    S = gf.ensemble(packing)
    exact = gf.intervals(S)
    return S.dimension, gf.measures.eta3(exact.low, exact.high)


@pytest.mark.parametrize("mu", FRICTIONS)
def test_drag_changes_neither_h_nor_eta3_of_grains_that_press(mu):
    """Three standard errors, the 95 % level of 16 comparisons.

    Pairs that touch without pressing become more for as long as the motion goes on.
    """
    rested, pressing, touching = np.transpose(
        [coast(state_where_drag_begins(mu, seed), mu) for seed in SEEDS], (1, 0, 2)
    )
    usual = np.array([of_packing(gf.pack(N, mu=mu, seed=seed)) for seed in SEEDS])
    for other in (rested, pressing):
        error = np.sqrt((usual.var(axis=0, ddof=1) + other.var(axis=0, ddof=1)) / len(SEEDS))
        assert np.all(np.abs(other.mean(axis=0) - usual.mean(axis=0)) < 3 * error)
    assert np.all(touching.mean(axis=0) > pressing.mean(axis=0))
