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

from granforce.forces.contact_problem import balance_of
from granforce.forces.gauss_seidel import BOX_MASS
from granforce.numerics import contact_matrix
from granforce.numerics.contact_matrix import Network
from granforce.numerics.lanes import ONE, compiled, within
from granforce.records import InputError
from granforce.system import cancelling
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
    """The step problem of one ensemble, in units of ⟨f_n⟩ and r_max; Δt = 1.

    Rows of grains are in order of elimination; those of the pressure (m = 1, or 0) come apart.
    """

    network: Network
    b: np.ndarray  # (rows, 1)
    b_border: np.ndarray  # (m, 1)
    mass: np.ndarray  # (rows,) M
    mass_border: np.ndarray  # (m,)
    stiffness: np.ndarray  # (N_c, 2) D: effective masses of the contacts
    mu: float
    place: np.ndarray  # (rows of the ensemble,) where they are among rows and border


class Motion(NamedTuple):
    """Velocities U, and the unbalance A f − b − M U."""

    velocity: np.ndarray  # (rows, 1)
    border: np.ndarray  # (m, 1)
    unbalance: np.ndarray  # (rows, 1)
    unbalance_border: np.ndarray  # (m, 1)


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
    """The step problem of an ensemble with the inertia of contact dynamics: m, I and box.

    Raises InputError where forces are known: contact dynamics does not hold to that.
    """
    if ensemble.known is not None:
        raise InputError(
            "grains that move change their forces, whatever is known of them: perturb the packing "
            "without known forces (its limit loads can be had with them)"
        )
    network, b, b_border, _, place = balance_of(ensemble)
    # Rows that nothing acts on (torques without friction) may have any mass.
    inertia = np.ones(len(b) + len(b_border))
    inertia[place] = _inertia(ensemble)
    mass, mass_border = inertia[: len(b)], inertia[len(b) :]
    rows = 3 * np.stack([network.high, network.low], axis=1)[:, :, None] + np.arange(3)
    columns = network.columns.reshape(-1, 2, 2, 3)
    yielding = np.einsum("cpgk,cgk->cp", columns**2, 1 / mass[rows])
    yielding += network.border.reshape(len(rows), 2, len(b_border)) ** 2 @ (1 / mass_border)
    stiffness = 1 / np.where(yielding > 0, yielding, 1.0)
    return Step(
        network, b[:, None], b_border[:, None], mass, mass_border, stiffness, ensemble.mu, place
    )


def _inertia(ensemble):
    packing, size = ensemble.packing, 1 + ensemble.per_contact
    longest = float(packing.r.max())
    # The velocity that goes with a torque/r is r ω: its inertia is I/r² = m/2.
    grain = np.pi * (packing.r[ensemble.grains] / longest) ** 2
    mass = (grain[:, None] * np.array([1.0, 1.0, 0.5])[:size]).ravel()
    if not ensemble.has_pressure_row:
        return mass
    # The one that goes with the mean normal force Σ f_n ℓ / Σ ℓ is λ Σ ℓ; where the whole stress is
    # prescribed the box may shear as well, with the same inertia.
    box = 2 * packing.volume * BOX_MASS / ensemble.contacts.length.sum() ** 2
    return np.append(mass, np.full(ensemble.A.shape[0] - ensemble.pressure_row, box))


def grain_velocities(ensemble, velocity):
    """Velocities (M, 3) of the backbone grains: intrinsic v_x, v_y and r ω."""
    size = 1 + ensemble.per_contact
    grains = velocity[: size * len(ensemble.grains)].reshape(-1, size)
    return np.column_stack([grains, np.zeros((len(grains), 3 - size))])


def relative_velocities(step, velocity):
    """Normal (opening > 0) and tangential relative velocity (N_c, 2) of the contacts, box included.

    They are the work conjugates of the forces: Aᵀ U. velocity (rows,) by the ensemble's rows.
    """
    rows = np.zeros(len(step.b) + len(step.b_border))
    rows[step.place] = velocity
    relative = np.empty_like(step.stiffness)
    _relative(step.network, rows[: len(step.b), None], rows[len(step.b) :, None], relative)
    return relative


@compiled
def _relative(network, velocity, border, relative):
    for c in range(len(relative)):
        pulled = contact_matrix.pull(network, c, velocity, border, ONE)
        relative[c, 0], relative[c, 1] = pulled


def relax(step, forces, contact, load, *, max_steps, steady=STEADY):
    """Follow the flow from forces (N_c, 2) under a pair of `load` on a contact, to its end.

    All in ⟨f_n⟩. Ends at rest (unbalance below BALANCED), in steady motion (a breach of Coulomb's
    law by at most `steady` of the fastest contact), or after max_steps.
    """
    loaded = step._replace(b=step.b.copy(), b_border=step.b_border.copy())
    forces = np.array(forces, order="C")
    motion = Motion(*(np.zeros_like(rows) for rows in (step.b, step.b_border) * 2))
    ended, breach, steps, iterations = _follow(
        loaded,
        contact_matrix.make_factors(step.network, 1, symmetric=False),
        contact,
        load,
        forces,
        motion,
        max_steps,
        steady,
        BALANCED / 10,
        cancelling.flag(),
    )
    cancelling.check("perturbation")
    at_rest = ended and breach == 0.0
    velocity = np.concatenate([motion.velocity[:, 0], motion.border[:, 0]])[step.place]
    return Outcome(forces, velocity, at_rest, ended, breach, steps, iterations)


@compiled
def _follow(step, factors, contact, load, forces, motion, max_steps, steady, rest, stop):
    """Change forces and motion in place; whether it ended, breach, steps, linear systems."""
    contact_matrix.push(step.network, contact, -load, 0.0, step.b, step.b_border, ONE)
    pace, breach, iterations = FIRST, np.inf, 0
    following = np.empty_like(forces)
    for steps in range(1, max_steps + 1):
        solved = False
        kept, kept_border = motion.velocity.copy(), motion.border.copy()
        while not solved and pace >= SHORTEST and not stop[0]:
            solved, used = _implicit_step(step, factors, forces, pace, motion, following, stop)
            iterations += used
            if not solved:
                _set(motion.velocity, kept)
                _set(motion.border, kept_border)
                pace *= CUT
        if not solved:
            return False, breach, steps, iterations
        breach = _breach(step, forces, following, motion, pace)
        _set(forces, following)
        if _heaviest(step, motion) <= rest:
            motion.velocity[:], motion.border[:] = 0.0, 0.0
            return True, 0.0, steps, iterations
        if breach <= steady:
            return True, breach, steps, iterations
        pace = min(LONGEST, pace * GROWTH)
    return False, breach, max_steps, iterations


@within
def _set(values, given):
    """values ← given, number by number: arrays set to slices take numba a second to compile."""
    for k in range(values.shape[0]):
        for a in range(values.shape[1]):
            values[k, a] = given[k, a]


@within
def _step_along(values, given, length, direction):
    """values ← given + length · direction."""
    for k in range(len(values)):
        values[k, 0] = given[k, 0] + length * direction[k, 0]


@within
def _heaviest(step, motion):
    """Largest |M U|."""
    worst = 0.0
    for k in range(len(step.mass)):
        worst = max(worst, abs(step.mass[k] * motion.velocity[k, 0]))
    for k in range(len(step.mass_border)):
        worst = max(worst, abs(step.mass_border[k] * motion.border[k, 0]))
    return worst


@within
def _breach(step, forces, following, motion, pace):
    """Relative velocities that the forces still answer, relative to the fastest one."""
    answered = fastest = 0.0
    for c in range(len(forces)):
        pulled = contact_matrix.pull(step.network, c, motion.velocity, motion.border, ONE)
        fastest = max(fastest, abs(pulled[0]), abs(pulled[1]))
        for component in range(2):
            change = abs(following[c, component] - forces[c, component])
            answered = max(answered, change / (pace * step.stiffness[c, component]))
    return max(answered / fastest, 1e-300) if fastest > 0.0 else 1e-300


@within
def _implicit_step(step, factors, forces, pace, motion, following, stop):
    """Whether Newton's method found f⁺ (in following) and U⁺ (in motion); linear systems solved.

    It begins at the given U. The squared unbalance (over masses) must fall; otherwise the Newton
    step is halved. It ends when a whole one leaves every contact in its state: the equations are
    linear there, so that they are solved.
    """
    state = np.empty(len(forces), np.int8)
    merit = _answer(step, forces, pace, motion, following, state)
    for count in range(1, NEWTON + 1):
        if stop[0]:
            return False, count
        before = state.copy()
        velocity, border = motion.velocity.copy(), motion.border.copy()
        _factor(step, state, pace, factors, stop)
        direction, direction_border = motion.unbalance.copy(), motion.unbalance_border.copy()
        contact_matrix.solve_lu(step.network, factors, direction, direction_border, ONE)
        length = 1.0
        falls = False
        for _ in range(HALVINGS):
            _step_along(motion.velocity, velocity, length, direction)
            _step_along(motion.border, border, length, direction_border)
            least = _answer(step, forces, pace, motion, following, state)
            if length == 1.0 and np.array_equal(state, before):
                # Rounding of the velocities, and no more, may be left.
                left = BALANCED / 10 + ROUNDING * pace * _fastest(motion)
                if least <= left**2:
                    return True, count
            if least < (1.0 - DECREASE * length) * merit:
                falls = True
                break
            length *= 0.5
        if not falls:
            return False, count
        merit = least
    return False, NEWTON


@within
def _fastest(motion):
    """Largest |U|."""
    worst = 0.0
    for k in range(len(motion.velocity)):
        worst = max(worst, abs(motion.velocity[k, 0]))
    for k in range(len(motion.border)):
        worst = max(worst, abs(motion.border[k, 0]))
    return worst


@within
def _factor(step, state, pace, factors, stop):
    """Factor M + A (∂Π) τ D Aᵀ, not symmetric, as f_t of a sliding contact follows f_n."""
    network, m = step.network, len(step.mass_border)
    contact_matrix.begin(network, step.mass, factors, ONE)
    for a in range(m):
        factors.corner[m * a + a, 0] = step.mass_border[a]
    for c in range(len(state)):
        if state[c] == OPEN:
            continue
        normal, tangential = pace * step.stiffness[c, 0], 0.0
        across = np.sign(state[c]) * step.mu * normal
        if state[c] == STICKING:
            tangential, across = pace * step.stiffness[c, 1], 0.0
        contact_matrix.add_skew(network, c, normal, 0.0, across, tangential, factors, ONE)
    contact_matrix.factor_lu(network, factors, stop, ONE)


@within
def _answer(step, forces, pace, motion, following, state):
    """Forces Π(f − τ D Aᵀ U), states of the contacts and A f⁺ − b − M U; the latter's Σ /M."""
    network, mu, rest, rest_border = (
        step.network,
        step.mu,
        motion.unbalance,
        motion.unbalance_border,
    )
    for k in range(len(step.mass)):
        rest[k, 0] = -step.b[k, 0] - step.mass[k] * motion.velocity[k, 0]
    for k in range(len(step.mass_border)):
        rest_border[k, 0] = -step.b_border[k, 0] - step.mass_border[k] * motion.border[k, 0]
    for c in range(len(forces)):
        w_n, w_t = contact_matrix.pull(network, c, motion.velocity, motion.border, ONE)
        f_n = max(forces[c, 0] - pace * step.stiffness[c, 0] * w_n, 0.0)
        f_t = forces[c, 1] - pace * step.stiffness[c, 1] * w_t
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
        contact_matrix.push(network, c, f_n, f_t, rest, rest_border, ONE)
    merit = 0.0
    for k in range(len(step.mass)):
        merit += rest[k, 0] ** 2 / step.mass[k]
    for k in range(len(step.mass_border)):
        merit += rest_border[k, 0] ** 2 / step.mass_border[k]
    return merit
