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
from scipy import sparse
from scipy.sparse.linalg import splu

from granforce.relax import dissection
from granforce.relax.gauss_seidel import BOX_MASS
from granforce.tolerances import BALANCED

# Pace τ: the first step's, its growth after a step, and its cut where Newton's method failed.
FIRST, GROWTH, CUT = 1e2, 4.0, 0.2
LONGEST, SHORTEST = 1e7, 1e-2
# Linear systems a step may take, and halvings of a Newton step.
NEWTON, HALVINGS = 12, 8
# Part of the squared unbalance by which a whole Newton step must lower it.
DECREASE = 0.1
# Steady motion: what contacts still breach Coulomb's law by, relative to the fastest contact.
STEADY = 1e-7

OPEN, STICKING, SLIDING = range(3)  # and −SLIDING, where f_t = −μ f_n


class Step(NamedTuple):
    """The step problem of one ensemble, in units of ⟨f_n⟩ and r_max; Δt = 1."""

    rows: np.ndarray  # (N_c, slots) rows each contact meets, numbered in order of elimination
    columns: np.ndarray  # (N_c, slots, 2) what unit f_n, f_t do to them
    b: np.ndarray  # (rows,)
    mass: np.ndarray  # (rows,) M
    stiffness: np.ndarray  # (N_c, 2) D: effective masses of the contacts
    mu: float
    order: np.ndarray  # (rows,) the ensemble's rows in order of elimination
    index: np.ndarray  # row numbers of the Jacobian's entries, column after column
    start: np.ndarray  # (rows + 1,) where its columns begin
    place: np.ndarray  # (N_c, slots, slots) entry of each pair of rows of a contact
    diagonal: np.ndarray  # (rows,) entries on the diagonal


class Outcome(NamedTuple):
    """Where the forces went."""

    forces: np.ndarray  # (N_c, 2) ⟨f_n⟩
    velocity: np.ndarray  # (rows,) U, by the step's rows; 0 at rest
    at_rest: bool
    converged: bool  # at rest, or in steady motion
    breach: float  # of Coulomb's law, relative to the fastest contact; 0 at rest
    steps: int  # implicit steps of the flow
    iterations: int  # linear systems solved


def make_step(ensemble):
    """The step problem of an ensemble with the inertia of contact dynamics: m, I and box."""
    packing, contacts, grains = ensemble.packing, ensemble.contacts, ensemble.grains
    size, border = 1 + ensemble.per_contact, ensemble.has_pressure_row
    row_of = np.full(len(packing.r), -1)
    row_of[grains] = np.arange(len(grains))
    i, j = row_of[contacts.i], row_of[contacts.j]
    plan = dissection.make_plan(packing.x[grains], i, j, size, border)
    fronts = zip(plan.first_row[:-1], plan.pivots, strict=True)
    order = np.concatenate([plan.rows[first : first + count] for first, count in fronts])
    by_row = dissection.slots(i, j, size, border, len(grains))
    rows = np.argsort(order)[by_row]
    columns = np.zeros((*rows.shape, 2))
    A = ensemble.A.tocsr()
    for component in range(ensemble.per_contact):
        unknown = ensemble.per_contact * np.arange(len(rows)) + component
        columns[:, :, component] = np.asarray(A[by_row, unknown[:, None]].todense())
    mass = _inertia(ensemble, size, border)[order]
    yielding = np.einsum("csk,cs->ck", columns**2, 1 / mass[rows])
    stiffness = 1 / np.where(yielding > 0, yielding, 1.0)
    b = np.ascontiguousarray(ensemble.b[order] / ensemble.force_scale)
    pattern = _pattern(rows, len(order))
    return Step(rows, columns, b, mass, stiffness, float(ensemble.mu), order, *pattern)


def _inertia(ensemble, size, border):
    packing = ensemble.packing
    longest = float(packing.r.max())
    # The velocity that goes with a torque/r is r ω: its inertia is I/r² = m/2.
    grain = np.pi * (packing.r[ensemble.grains] / longest) ** 2
    mass = (grain[:, None] * np.array([1.0, 1.0, 0.5])[:size]).ravel()
    if not border:
        return mass
    # The one that goes with the mean normal force Σ f_n ℓ / Σ ℓ is λ Σ ℓ.
    return np.append(mass, 2 * packing.volume * BOX_MASS / ensemble.contacts.length.sum() ** 2)


def _pattern(rows, count):
    """Structure of M + Σ E K Eᵀ by columns, and where each contact's and M's entries stand."""
    slots = rows.shape[1]
    row = np.repeat(rows, slots, axis=1).ravel()
    column = np.tile(rows, (1, slots)).ravel()
    every = np.arange(count)
    keys, place = np.unique(
        np.concatenate([column * count + row, every * (count + 1)]), return_inverse=True
    )
    start = np.searchsorted(keys, np.arange(count + 1) * count)
    return (
        (keys % count).astype(np.int32),
        start.astype(np.int32),
        place[: row.size].reshape(len(rows), slots, slots).astype(np.int64),
        place[row.size :].astype(np.int64),
    )


def grain_velocities(step, ensemble, velocity):
    """Velocities (M, 3) of the backbone grains: intrinsic v_x, v_y and r ω."""
    by_row = np.empty(len(velocity))
    by_row[step.order] = velocity
    size = 1 + ensemble.per_contact
    grains = by_row[: size * len(ensemble.grains)].reshape(-1, size)
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
    velocity = np.zeros(len(b))
    pace, iterations, breach = FIRST, 0, np.inf
    for steps in range(1, max_steps + 1):
        found = None
        while found is None and pace >= SHORTEST:
            found, used = _implicit_step(step, forces, b, pace, velocity)
            iterations += used
            if found is None:
                pace *= CUT
        if found is None:
            break
        following, velocity = found
        breach = _breach(step, forces, following, velocity, pace)
        forces = following
        if np.abs(step.mass * velocity).max() <= BALANCED / 10:
            return Outcome(forces, np.zeros(len(b)), True, True, 0.0, steps, iterations)
        if breach <= steady:
            return Outcome(forces, velocity, False, True, breach, steps, iterations)
        pace = min(LONGEST, pace * GROWTH)
    return Outcome(forces, velocity, False, False, breach, max_steps, iterations)


def _breach(step, forces, following, velocity, pace):
    """Relative velocities that the forces still answer, relative to the fastest one."""
    answered = np.abs(following - forces) / (pace * step.stiffness)
    fastest = np.abs(relative_velocities(step, velocity)).max()
    return float(answered.max() / fastest) if fastest > 0 else 0.0


def _implicit_step(step, forces, b, pace, velocity):
    """((f⁺, U⁺), linear systems solved); None in place of the pair where Newton's method fails.

    The first U is the given one. The squared unbalance (over masses) must fall; otherwise the
    step is halved. It ends when a whole step leaves every contact in its state: the equations are
    linear there, so that they are solved.
    """
    D = pace * step.stiffness
    following, state = np.empty_like(forces), np.empty(len(forces), np.int8)
    unbalance, data = np.empty(len(b)), np.empty(len(step.index))
    merit = _answer(step, forces, D, b, velocity, following, state, unbalance)
    before = state.copy()
    for count in range(1, NEWTON + 1):
        _jacobian(step, D, state, data)
        J = sparse.csc_matrix((data, step.index, step.start), shape=(len(b), len(b)))
        try:
            factors = splu(
                J, permc_spec="NATURAL", diag_pivot_thresh=0.1, options={"SymmetricMode": True}
            )
        except RuntimeError:  # singular to rounding
            return None, count
        direction, length = factors.solve(unbalance), 1.0
        before[:] = state
        for _ in range(HALVINGS):
            trial = velocity + length * direction
            least = _answer(step, forces, D, b, trial, following, state, unbalance)
            if length == 1.0 and np.array_equal(state, before):
                return (following, trial), count
            if least < (1 - DECREASE * length) * merit:
                break
            length *= 0.5
        else:
            return None, count
        velocity, merit = trial, least
    return None, NEWTON


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


@njit(cache=True, nogil=True)
def _jacobian(step, D, state, data):
    """Entries of M + A (∂Π) D Aᵀ: not symmetric, as f_t of a sliding contact follows f_n."""
    rows, columns = step.rows, step.columns
    data[:] = 0.0
    for k in range(step.mass.shape[0]):
        data[step.diagonal[k]] = step.mass[k]
    for c in range(rows.shape[0]):
        if state[c] == OPEN:
            continue
        d_t = D[c, 1] if state[c] == STICKING else 0.0
        coupling = 0.0 if state[c] == STICKING else np.sign(state[c]) * step.mu
        for a in range(rows.shape[1]):
            pushed = D[c, 0] * (columns[c, a, 0] + coupling * columns[c, a, 1])
            turned = d_t * columns[c, a, 1]
            for k in range(rows.shape[1]):
                data[step.place[c, a, k]] += pushed * columns[c, k, 0] + turned * columns[c, k, 1]
