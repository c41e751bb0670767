"""One step of contact dynamics from rest, solved to rounding: rest, or steady motion.

With the geometry fixed, a step of implicit Euler from rest asks for contact forces f and
velocities U with

    M U = A f − b,    f = Π(f − D Aᵀ U)

where A f = b is the balance of S, M holds the masses of the grains and of the box, Aᵀ U are the
relative velocities at the contacts, and Π is Coulomb's law: f_n ← max(f_n, 0), then f_t clipped to
±μ f_n. Any D > 0 gives the same law. It is not the projection onto the cone: a sliding contact
does not dilate, so the problem is no convex program, and several solutions may exist side by side:
networks at rest (U = 0, any f in S), and motion, which goes on with constant acceleration because
the law is homogeneous in U. Which one is reached depends on where one comes from.

Gauss–Seidel sweeps from a given network, f_c ← Π(f_c − D A_cᵀ U) contact after contact with D the
effective masses, follow f' = −D Aᵀ U at the pace of one unit per sweep. Here the same flow is
integrated implicitly for a whole network at a time, with steps of any length τ,

    f⁺ = Π(f − τ D Aᵀ U⁺),    M U⁺ = A f⁺ − b,

each by Newton's method on the states of the contacts (sticking, sliding either way, open). That is
independent of any order of the contacts, and ends at rounding error.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from granforce.relax import dissection, frontal_lu
from granforce.relax.accelerated import geometry
from granforce.relax.gauss_seidel import BOX_MASS
from granforce.tolerances import BALANCED

# Pace τ: the first step's, its growth after a step, and its cut where Newton's method failed.
FIRST, GROWTH, CUT = 1e2, 4.0, 0.2
LONGEST, SHORTEST = 1e7, 1e-2
# Linear systems a step may take, and halvings of a Newton step.
NEWTON, HALVINGS = 12, 8
# Part of the squared unbalance by which a whole Newton step must lower it.
DECREASE = 0.1
# Error of velocities relative to the fastest; contacts turn it into forces τ times as large.
ROUNDING = 1e-14
# Steady motion: what contacts still breach Coulomb's law by, relative to the fastest contact.
STEADY = 1e-7

OPEN, STICKING, SLIDING = range(3)  # and −SLIDING, where f_t = −μ f_n


class Step(NamedTuple):
    """The step problem of one ensemble, in units of ⟨f_n⟩ and r_max; Δt = 1."""

    plan: dissection.Plan
    rows: np.ndarray  # (N_c, slots) rows of the ensemble that each contact meets
    columns: np.ndarray  # (N_c, slots, 2) what unit f_n, f_t do to them
    b: np.ndarray  # (rows,)
    mass: np.ndarray  # (rows,) M
    stiffness: np.ndarray  # (N_c, 2) D: effective masses of the contacts
    mu: float


class Outcome(NamedTuple):
    """Where the forces went."""

    forces: np.ndarray  # (N_c, 2) ⟨f_n⟩
    velocity: np.ndarray  # (rows,) U, by the ensemble's rows; 0 at rest
    at_rest: bool
    converged: bool  # at rest, or in steady motion
    breach: float  # of Coulomb's law, relative to the fastest contact; 0 at rest
    steps: int  # implicit steps of the flow
    iterations: int  # linear systems solved


def make_step(ensemble):
    """The step problem of an ensemble with the inertia of contact dynamics: m, I and box."""
    shape = geometry(ensemble)
    mass = _inertia(ensemble)
    yielding = np.einsum("csk,cs->ck", shape.columns**2, 1 / mass[shape.rows])
    stiffness = 1 / np.where(yielding > 0, yielding, 1.0)
    return Step(shape.plan, shape.rows, shape.columns, shape.b, mass, stiffness, shape.mu)


def _inertia(ensemble):
    packing, size = ensemble.packing, 1 + ensemble.per_contact
    longest = float(packing.r.max())
    # The velocity that goes with a torque/r is r ω: its inertia is I/r² = m/2.
    grain = np.pi * (packing.r[ensemble.grains] / longest) ** 2
    mass = (grain[:, None] * np.array([1.0, 1.0, 0.5])[:size]).ravel()
    if not ensemble.has_pressure_row:
        return mass
    # The one that goes with the mean normal force Σ f_n ℓ / Σ ℓ is λ Σ ℓ.
    return np.append(mass, 2 * packing.volume * BOX_MASS / ensemble.contacts.length.sum() ** 2)


def grain_velocities(ensemble, velocity):
    """Velocities (M, 3) of the backbone grains: intrinsic v_x, v_y and r ω."""
    size = 1 + ensemble.per_contact
    grains = velocity[: size * len(ensemble.grains)].reshape(-1, size)
    return np.column_stack([grains, np.zeros((len(grains), 3 - size))])


def relative_velocities(step, velocity):
    """Normal (opening > 0) and tangential relative velocity (N_c, 2) of the contacts, box included.

    They are the work conjugates of the forces: Aᵀ U.
    """
    return np.einsum("csk,cs->ck", step.columns, velocity[step.rows])


def relax(step, forces, contact, load, *, max_steps, steady=STEADY):
    """Follow the flow from forces (N_c, 2) under a pair of `load` on a contact, to its end.

    All in ⟨f_n⟩. Ends at rest (unbalance below BALANCED), in steady motion (a breach of Coulomb's
    law by at most `steady` of the fastest contact), or after max_steps.
    """
    b = step.b.copy()
    b[step.rows[contact]] -= load * step.columns[contact, :, 0]
    forces, velocity = np.array(forces, order="C"), np.zeros(len(b))
    ended, breach, steps, iterations = _follow(
        step, frontal_lu.room(step.plan), b, forces, velocity, max_steps, steady, BALANCED / 10
    )
    at_rest = ended and breach == 0.0
    return Outcome(forces, velocity, at_rest, ended, breach, steps, iterations)


@njit(cache=True, nogil=True)
def _follow(step, memory, b, forces, velocity, max_steps, steady, rest):
    """Change forces and velocity in place; whether it ended, breach, steps, linear systems."""
    pace, breach, iterations = FIRST, np.inf, 0
    following, trial = np.empty_like(forces), np.empty_like(velocity)
    for steps in range(1, max_steps + 1):
        solved = False
        while not solved and pace >= SHORTEST:
            trial[:] = velocity
            solved, used = _implicit_step(step, memory, forces, b, pace, trial, following)
            iterations += used
            if not solved:
                pace *= CUT
        if not solved:
            return False, breach, steps, iterations
        velocity[:] = trial
        breach = _breach(step, forces, following, velocity, pace)
        forces[:] = following
        if np.abs(step.mass * velocity).max() <= rest:
            velocity[:] = 0.0
            return True, 0.0, steps, iterations
        if breach <= steady:
            return True, breach, steps, iterations
        pace = min(LONGEST, pace * GROWTH)
    return False, breach, max_steps, iterations


@njit(cache=True, nogil=True)
def _breach(step, forces, following, velocity, pace):
    """Relative velocities that the forces still answer, relative to the fastest one."""
    answered = fastest = 0.0
    for c in range(forces.shape[0]):
        for component in range(2):
            w = 0.0
            for a in range(step.rows.shape[1]):
                w += step.columns[c, a, component] * velocity[step.rows[c, a]]
            change = abs(following[c, component] - forces[c, component])
            answered = max(answered, change / (pace * step.stiffness[c, component]))
            fastest = max(fastest, abs(w))
    return max(answered / fastest, 1e-300) if fastest > 0.0 else 1e-300


@njit(cache=True, nogil=True)
def _implicit_step(step, memory, forces, b, pace, velocity, following):
    """Whether Newton's method found f⁺ (in following) and U⁺ (in velocity); linear systems solved.

    It begins at the given U. The squared unbalance (over masses) must fall; otherwise the Newton
    step is halved. It ends when a whole one leaves every contact in its state: the equations are
    linear there, so that they are solved.
    """
    D = pace * step.stiffness
    state = np.empty(forces.shape[0], np.int8)
    unbalance, trial = np.empty_like(b), np.empty_like(b)
    blocks = np.empty((forces.shape[0], 2, 2))
    merit = _answer(step, forces, D, b, velocity, following, state, unbalance)
    for count in range(1, NEWTON + 1):
        before = state.copy()
        _slopes(D, state, step.mu, blocks)
        frontal_lu.factor(step.plan, step.columns, blocks, step.mass, memory)
        direction = unbalance.copy()
        frontal_lu.solve(step.plan, memory, direction)
        length = 1.0
        falls = False
        for _ in range(HALVINGS):
            for k in range(b.shape[0]):
                trial[k] = velocity[k] + length * direction[k]
            least = _answer(step, forces, D, b, trial, following, state, unbalance)
            if length == 1.0 and np.array_equal(state, before):
                # Rounding of the velocities, and no more, may be left.
                left = BALANCED / 10 + ROUNDING * pace * np.abs(trial).max()
                if least <= left**2:
                    velocity[:] = trial
                    return True, count
            if least < (1.0 - DECREASE * length) * merit:
                falls = True
                break
            length *= 0.5
        if not falls:
            return False, count
        velocity[:] = trial
        merit = least
    return False, NEWTON


@njit(cache=True, nogil=True)
def _slopes(D, state, mu, blocks):
    """(∂Π) D of each contact: not symmetric, as f_t of a sliding contact follows f_n."""
    blocks[:] = 0.0
    for c in range(state.shape[0]):
        if state[c] == OPEN:
            continue
        blocks[c, 0, 0] = D[c, 0]
        if state[c] == STICKING:
            blocks[c, 1, 1] = D[c, 1]
        else:
            blocks[c, 1, 0] = np.sign(state[c]) * mu * D[c, 0]


@njit(cache=True, nogil=True)
def _answer(step, forces, D, b, velocity, following, state, unbalance):
    """Forces Π(f − D Aᵀ U), states of the contacts and A f⁺ − b − M U; the latter's Σ /M."""
    rows, columns, mu = step.rows, step.columns, step.mu
    for k in range(b.shape[0]):
        unbalance[k] = -b[k] - step.mass[k] * velocity[k]
    for c in range(rows.shape[0]):
        w_n = w_t = 0.0
        for a in range(rows.shape[1]):
            value = velocity[rows[c, a]]
            w_n += columns[c, a, 0] * value
            w_t += columns[c, a, 1] * value
        f_n = max(forces[c, 0] - D[c, 0] * w_n, 0.0)
        f_t = forces[c, 1] - D[c, 1] * w_t
        limit = mu * f_n
        if f_n == 0.0:
            state[c] = OPEN
            f_t = 0.0
        elif f_t > limit:
            state[c] = SLIDING
            f_t = limit
        elif f_t < -limit:
            state[c] = -SLIDING
            f_t = -limit
        else:
            state[c] = STICKING
        following[c, 0] = f_n
        following[c, 1] = f_t
        for a in range(rows.shape[1]):
            unbalance[rows[c, a]] += columns[c, a, 0] * f_n + columns[c, a, 1] * f_t
    merit = 0.0
    for k in range(b.shape[0]):
        merit += unbalance[k] ** 2 / step.mass[k]
    return merit
