"""Contact dynamics of rigid disks in a box of variable size: one contact, one sweep, one step.

Implicit Euler with the intrinsic velocities v of the grains and the dilation rate λ of the box
(arXiv:0803.3566, Eqs. 17–32). Velocities are rows (v_x, v_y, ω). Contact forces are found by
Gauss–Seidel sweeps in which λ is updated with every contact, so that it agrees with the final
forces. Relaxation on a fixed geometry is one such step with all gaps zero and grains and box
initially at rest. A sweep updates one set of forces, or eight in parallel.
"""

from typing import NamedTuple

import numpy as np
from numba import types

from granforce.motion.box_motion import (
    by_type,
    carried,
    driven,
    fastest,
    keep_rate,
    pushed,
    rate_in,
    sheared,
    soften,
    stretched,
)
from granforce.motion.contact_groups import (
    breach_of_groups,
    grouped,
    stiffen,
    sweep_groups,
    ungroup,
)
from granforce.numerics.lanes import (
    ONE,
    allocating,
    allocating_part,
    compiled,
    larger,
    load,
    pick,
    same,
    size,
    store,
    vanishes,
    within,
)
from granforce.types import Floats, Integers


class StepProblem(NamedTuple):
    """The contact problem of one time step; all arrays (N_c,) but the last two (N,)."""

    i: Integers
    j: Integers
    n_x: Floats
    n_y: Floats
    length: Floats
    arm_i: Floats
    arm_j: Floats
    closing: Floats  # gap/Δt: approach velocity that just closes the gap; < 0 pushes overlaps apart
    stiff_n: Floats  # Δf_n per normal velocity to be stopped
    stiff_t: Floats  # Δf_t per tangential velocity to be stopped
    inverse_mass: Floats  # Δt/m
    inverse_inertia: Floats  # Δt/I
    box_compliance: float  # Δt/(2 V M_λ): change of λ per unit f_n ℓ


@compiled
def set_stiffness(problem):
    """Fill stiff_n and stiff_t, the inverses of the velocity change by a unit force in one step."""
    i, j = problem.i, problem.j
    w, u = problem.inverse_mass, problem.inverse_inertia
    for c in range(i.shape[0]):
        common = w[i[c]] + w[j[c]]
        box = problem.box_compliance * problem.length[c] ** 2
        spin = problem.arm_i[c] ** 2 * u[i[c]] + problem.arm_j[c] ** 2 * u[j[c]]
        problem.stiff_n[c] = 1.0 / (common + box)
        problem.stiff_t[c] = 1.0 / (common + spin)


@compiled
def add_forces(problem, force, velocity, dilation):
    """Velocities (N, 3) after the contact forces act for one step; returns the new λ."""
    for c in range(problem.i.shape[0]):
        f_n, f_t = force[c, 0], force[c, 1]
        if f_n == 0.0 and f_t == 0.0:
            continue
        i, j = problem.i[c], problem.j[c]
        w_i, w_j = problem.inverse_mass[i], problem.inverse_mass[j]
        n_x, n_y = problem.n_x[c], problem.n_y[c]
        f_x, f_y = f_n * n_x - f_t * n_y, f_n * n_y + f_t * n_x
        velocity[i, 0] -= w_i * f_x
        velocity[i, 1] -= w_i * f_y
        velocity[j, 0] += w_j * f_x
        velocity[j, 1] += w_j * f_y
        velocity[i, 2] -= problem.inverse_inertia[i] * problem.arm_i[c] * f_t
        velocity[j, 2] -= problem.inverse_inertia[j] * problem.arm_j[c] * f_t
        compliance = problem.box_compliance * problem.length[c]
        dilation = pushed(dilation, compliance, f_n, f_t, n_x, n_y)
    return dilation


@compiled
def sweep(problem, order, mu, force, velocity, dilation, lanes):
    """Update every contact once, in the given order (N_c,), in each lane.

    A contact whose predicted gap would be negative gets the f_n that makes the gap zero and the f_t
    that stops sliding, clipped to |f_t| ≤ μ f_n; force (N_c, 2, lanes) and velocity (N, 3, lanes)
    change in place. Returns the new λ, Σ (|Δf_n| + |Δf_t|) and Σ f_n over contacts.
    """
    zero = same(lanes, 0.0)
    change = total = x = y = turn = zero
    held = -1
    for k in range(order.shape[0]):
        c = order[k]
        a, b = problem.i[c], problem.j[c]
        i, j = 3 * a, 3 * b
        # Most contacts follow another one of the same grain, whose velocity need not be stored and
        # loaded in between: each update waits for the last.
        if i != held:
            held = i
            x, y = load(velocity, i, lanes), load(velocity, i + 1, lanes)
            turn = load(velocity, i + 2, lanes)
        x_j, y_j = load(velocity, j, lanes), load(velocity, j + 1, lanes)
        n_x, n_y = same(lanes, load(problem.n_x, c, ONE)), same(lanes, load(problem.n_y, c, ONE))
        v_x, v_y = x_j - x, y_j - y
        reach = load(problem.length, c, ONE)
        length, closing = same(lanes, reach), same(lanes, load(problem.closing, c, ONE))
        v_n = v_x * n_x + v_y * n_y + stretched(dilation, n_x, n_y) * length + closing
        old_n, old_t = load(force, 2 * c, lanes), load(force, 2 * c + 1, lanes)
        f_n = larger(old_n - v_n * same(lanes, load(problem.stiff_n, c, ONE)), zero)
        if vanishes(f_n) and vanishes(old_n) and vanishes(old_t):
            continue
        arm_i, arm_j = load(problem.arm_i, c, ONE), load(problem.arm_j, c, ONE)
        turn_j = load(velocity, j + 2, lanes)
        v_t = v_y * n_x - v_x * n_y - same(lanes, arm_i) * turn - same(lanes, arm_j) * turn_j
        v_t = sheared(dilation, v_t, length, n_x, n_y)
        most = same(lanes, mu) * f_n
        f_t = larger(old_t - v_t * same(lanes, load(problem.stiff_t, c, ONE)), -most)
        f_t = pick(f_t, most, most, f_t)
        d_n, d_t = f_n - old_n, f_t - old_t
        store(force, 2 * c, lanes, f_n)
        store(force, 2 * c + 1, lanes, f_t)
        f_x, f_y = d_n * n_x - d_t * n_y, d_n * n_y + d_t * n_x
        w_i = same(lanes, load(problem.inverse_mass, a, ONE))
        w_j = same(lanes, load(problem.inverse_mass, b, ONE))
        x, y = x - w_i * f_x, y - w_i * f_y
        turn = turn - same(lanes, load(problem.inverse_inertia, a, ONE) * arm_i) * d_t
        store(velocity, i, lanes, x)
        store(velocity, i + 1, lanes, y)
        store(velocity, i + 2, lanes, turn)
        store(velocity, j, lanes, x_j + w_j * f_x)
        store(velocity, j + 1, lanes, y_j + w_j * f_y)
        u_j = same(lanes, load(problem.inverse_inertia, b, ONE) * arm_j)
        store(velocity, j + 2, lanes, turn_j - u_j * d_t)
        compliance = same(lanes, problem.box_compliance * reach)
        dilation = pushed(dilation, compliance, d_n, d_t, n_x, n_y)
        change = change + (size(d_n) + size(d_t))
        total = total + f_n
    return dilation, change, total


class Motion(NamedTuple):
    """State of a moving packing; arrays change in place."""

    x: Floats  # (N, 2)
    velocity: Floats  # (N, 3) intrinsic v_x, v_y, ω
    r: Floats  # (N,)
    mass: Floats  # (N,) π r²
    box: Floats  # (2,)
    tilt: Floats  # (1,) tilt of the cell
    dilation: Floats  # (1,) λ; or (1, 3) e_x, e_y, g of a cell with a free shape
    i: Integers  # (P,) neighbour list
    j: Integers  # (P,)
    shift: Integers  # (P, 2)
    force: Floats  # (P, 2) of the last step, the warm start of the next
    drift: Floats  # (1,) bound on the approach of any pair since the list was built
    pace: Floats  # (2,) Δt of the next step, relaxation factor of its sweeps


class Pace(NamedTuple):
    """The length and accuracy of steps."""

    box_mass: float  # M_λ
    shortest: float  # Δt
    longest: float
    stride: float  # displacement of the fastest carrying grain in a step that Δt grows up to
    sweeps: int  # at most, in a step
    settling: int  # how many of the last of them use LEAST_RELAXATION only
    accuracy: float  # largest violation of the contact laws after a step, of the fastest grain


# Index of each of advance()'s counters.
STEPS, SWEEPS, UPDATES, UNFINISHED = range(4)
# Sweeps between two checks of convergence.
LOOK = 10
# If the violation has not fallen below FALLEN times its minimum after STALLED checks, the sweeps
# cycle: the relaxation factor is multiplied by CAUTION, then grows by COURAGE per step.
FALLEN, STALLED, CAUTION, COURAGE = 0.7, 20, 0.8, 1.03
# Bounds of the relaxation factor; the lower bound is 1.6 − μ if that is larger. At small μ
# over-relaxation (Young) converges six times faster and never cycles; at μ = 10 only 0.7 converges.
LEAST_RELAXATION, MOST_RELAXATION = 0.7, 1.7
# Fraction of an overlap that a step pushes out, and the largest such length.
PUSHED, FARTHEST = 0.5, 1e-3
# Pairs farther apart than this (in largest radii) are skipped; neighbour lists hold all closer
# pairs.
REACH = 0.1
# Growth of Δt from step to step.
GROWTH = 1.3
# Violation (velocity times Δt, a length) below which only rounding remains.
ROUNDING = 1e-14


@allocating
def advance(motion, mu, pressure, pace, moved, steps, counters, stop, lanes):
    """Do up to `steps` time steps, ending early when the neighbour list has to be rebuilt.

    That is when two grains may have approached by `moved`. Also returns once stop[0] is set.
    Contacts are updated one by one, or in groups if `lanes` are MANY.

    Returns the last step's mean overlap of carrying contacts (in largest radii) and unbalance: the
    largest change of momentum of a grain per step, in units of the mean contact force.
    """
    overlap, unbalance = 0.0, np.inf
    for _ in range(steps):
        if motion.drift[0] > moved or stop[0]:
            break
        overlap, unbalance = _step(motion, mu, pressure, pace, counters, stop, lanes)
        counters[STEPS] += 1
    return overlap, unbalance


@allocating_part
def _step(motion, mu, pressure, pace, counters, stop, lanes):
    velocity, box = motion.velocity, motion.box
    volume, dt = box[0] * box[1], motion.pace[0]
    active, problem, overlap = _near_contacts(motion, dt, pace.box_mass * 2.0 * volume)
    before = velocity.copy()
    free = rate_in(motion.dilation)
    free = driven(free, velocity, motion.mass, pressure, volume, dt, pace.box_mass)

    count = active.shape[0]
    force = np.empty((count, 2))
    for c in range(count):
        force[c, 0], force[c, 1] = motion.force[active[c], 0], motion.force[active[c], 1]
    set_stiffness(problem)
    soften(free, problem)
    free = add_forces(problem, force, velocity, free)
    dilation = _swept(motion, problem, mu, pace, force, velocity, free, dt, counters, stop, lanes)
    for p in range(motion.force.shape[0]):
        motion.force[p, 0] = motion.force[p, 1] = 0.0
    for c in range(count):
        motion.force[active[c], 0], motion.force[active[c], 1] = force[c, 0], force[c, 1]
    keep_rate(dilation, motion.dilation)
    _move(motion, dilation, dt)
    stride = _fastest(problem, force, velocity) * dt
    growth = min(GROWTH, max(1.0 / GROWTH, pace.stride / max(stride, 1e-300)))
    motion.pace[0] = min(pace.longest, max(pace.shortest, dt * growth))
    return overlap / _largest(motion.r), _unbalance(motion, before, force, dt)


@allocating_part
def _swept(motion, problem, mu, pace, force, velocity, dilation, dt, counters, stop, lanes):
    """Sweep until the violation of the contact laws is small enough; return λ.

    If that is not reached, the step uses the forces with the smallest violation: at large μ a few
    contacts keep opening and closing, and the last sweep may be worse. Over-relaxed sweeps move
    slow modes fastest but keep those contacts cycling, so the last sweeps are under-relaxed.
    Otherwise the jitter would shake the packing and delay rest.
    """
    count = force.shape[0]
    factor, lasting = motion.pace[1], motion.pace[1]
    cautious = max(LEAST_RELAXATION, 1.6 - mu)
    _scale(problem, factor)
    order = _ordered(problem, force, velocity, lanes)
    best, best_force, best_velocity, best_dilation = np.inf, force, velocity, dilation
    least, looks, breach = np.inf, 0, np.inf
    for done in range(1, pace.sweeps + 1):
        if done > pace.sweeps - pace.settling and factor > LEAST_RELAXATION:
            _rescale(problem, order, LEAST_RELAXATION / factor)
            factor = LEAST_RELAXATION
        dilation = _once(problem, order, mu, force, velocity, dilation)
        counters[SWEEPS] += 1
        counters[UPDATES] += count
        if stop[0]:
            break
        if done % LOOK and done > 3 and done < pace.sweeps:
            continue
        breach, speed = _breached(problem, order, mu, force, velocity, dilation, factor)
        if breach <= max(pace.accuracy * speed, ROUNDING / dt):
            _update(order, force, velocity)
            break
        if breach < best:
            _update(order, force, velocity)
            best, best_dilation = breach, dilation
            best_force, best_velocity = force.copy(), velocity.copy()
        looks += 1
        if breach < FALLEN * least:
            least, looks = breach, 0
        elif looks >= STALLED and factor > cautious:
            _rescale(problem, order, CAUTION)
            factor, least, looks = CAUTION * factor, breach, 0
            lasting = factor
    else:
        counters[UNFINISHED] += 1
        dilation = best_dilation
        _copy(force, best_force)
        _copy(velocity, best_velocity)
    motion.pace[1] = min(COURAGE * lasting, MOST_RELAXATION)
    return dilation


@by_type
def _ordered(problem, force, velocity, lanes):
    """The order of a sweep over single contacts, or their groups."""
    if len(lanes) == 1:
        return lambda problem, force, velocity, lanes: np.arange(force.shape[0])
    return lambda problem, force, velocity, lanes: grouped(problem, force, velocity)


@by_type
def _once(problem, order, mu, force, velocity, dilation):
    """λ after one sweep, which changes the forces and velocities, or those of groups."""
    if _single(order):
        return lambda problem, order, mu, force, velocity, dilation: sweep(
            problem, order, mu, force, velocity, dilation, ONE
        )[0]
    return lambda problem, order, mu, force, velocity, dilation: sweep_groups(order, mu, dilation)


@by_type
def _breached(problem, order, mu, force, velocity, dilation, factor):
    """Largest violation of the contact laws, and largest velocity component of carrying grains."""
    if _single(order):
        return lambda problem, order, mu, force, velocity, dilation, factor: (
            _breach(problem, mu, force, velocity, dilation, factor),
            _fastest(problem, force, velocity),
        )
    return lambda problem, order, mu, force, velocity, dilation, factor: breach_of_groups(
        order, mu, dilation, factor
    )


@by_type
def _update(order, force, velocity):
    """Set forces and velocities to those that sweeps have reached."""
    if _single(order):
        return lambda order, force, velocity: None
    return lambda order, force, velocity: ungroup(order, force, velocity)


@by_type
def _rescale(problem, order, factor):
    """Multiply the relaxation factor of the contacts that are swept."""
    if _single(order):
        return lambda problem, order, factor: _scale(problem, factor)
    return lambda problem, order, factor: stiffen(order, factor)


def _single(order):
    return isinstance(order, types.Array | np.ndarray)


@within
def _copy(values, given):
    """values ← given, element by element: a slice assignment takes seconds to compile."""
    for k in range(values.shape[0]):
        for a in range(values.shape[1]):
            values[k, a] = given[k, a]


@within
def _scale(problem, factor):
    for c in range(problem.stiff_n.shape[0]):
        problem.stiff_n[c] *= factor
        problem.stiff_t[c] *= factor


@within
def _breach(problem, mu, force, velocity, dilation, factor):
    """Largest violation of Signorini's and Coulomb's laws: the velocity an update would stop."""
    worst = 0.0
    for c in range(force.shape[0]):
        i, j = problem.i[c], problem.j[c]
        n_x, n_y = problem.n_x[c], problem.n_y[c]
        v_x, v_y = velocity[j, 0] - velocity[i, 0], velocity[j, 1] - velocity[i, 1]
        length = problem.length[c]
        v_n = v_x * n_x + v_y * n_y + stretched(dilation, n_x, n_y) * length + problem.closing[c]
        stiff_n, stiff_t = problem.stiff_n[c] / factor, problem.stiff_t[c] / factor
        f_n = max(force[c, 0] - v_n * stiff_n, 0.0)
        if f_n == 0.0 and force[c, 0] == 0.0:
            continue
        spin = problem.arm_i[c] * velocity[i, 2] + problem.arm_j[c] * velocity[j, 2]
        v_t = sheared(dilation, v_y * n_x - v_x * n_y - spin, length, n_x, n_y)
        f_t = force[c, 1] - v_t * stiff_t
        f_t = min(max(f_t, -mu * f_n), mu * f_n)
        worst = max(worst, abs(f_n - force[c, 0]) / stiff_n, abs(f_t - force[c, 1]) / stiff_t)
    return worst


@within
def _fastest(problem, force, velocity):
    """Largest velocity component of the grains that carry."""
    fastest = 0.0
    for c in range(force.shape[0]):
        if force[c, 0] > 0.0:
            for k in (problem.i[c], problem.j[c]):
                fastest = max(fastest, abs(velocity[k, 0]), abs(velocity[k, 1]))
    return fastest


@allocating_part
def _near_contacts(motion, dt, box_inertia):
    """The pairs that may touch during this step, as a StepProblem, and the mean overlap."""
    x, r, box = motion.x, motion.r, motion.box
    speed = 0.0
    for k in range(x.shape[0]):
        speed = max(speed, motion.velocity[k, 0] ** 2 + motion.velocity[k, 1] ** 2)
    # Twice the fastest free approach, and the distance that forces may push grains in this step.
    largest = _largest(r)
    margin = 2.0 * dt * (2.0 * np.sqrt(speed) + 2.0 * fastest(rate_in(motion.dilation)) * largest)
    margin = min(margin + (2e-3 + 4.0 * dt * dt) * largest, REACH * largest)
    pairs = motion.i.shape[0]
    active, ends = np.empty(pairs, np.int64), np.empty((2, pairs), np.int64)
    table = np.empty((6, pairs))
    count = 0
    overlap = 0.0
    touching = 0
    for p in range(pairs):
        i, j = motion.i[p], motion.j[p]
        d_x = x[j, 0] - x[i, 0] + motion.shift[p, 0] * box[0] + motion.shift[p, 1] * motion.tilt[0]
        d_y = x[j, 1] - x[i, 1] + motion.shift[p, 1] * box[1]
        reach = r[i] + r[j] + margin
        square = d_x * d_x + d_y * d_y
        if square >= reach * reach:
            continue
        length = np.sqrt(square)
        gap = length - r[i] - r[j]
        if motion.force[p, 0] > 0.0:
            overlap += max(-gap, 0.0)
            touching += 1
        active[count], ends[0, count], ends[1, count] = p, i, j
        table[0, count] = d_x / length
        table[1, count] = d_y / length
        table[2, count] = length
        table[3, count] = r[i]
        table[4, count] = r[j]
        table[5, count] = max(gap, PUSHED * min(gap, 0.0), -FARTHEST) / dt
        count += 1
    active = active[:count]
    inertia = 0.5 * motion.mass * r**2
    problem = StepProblem(
        ends[0, :count],
        ends[1, :count],
        table[0, :count],
        table[1, :count],
        table[2, :count],
        table[3, :count],
        table[4, :count],
        table[5, :count],
        np.empty(count),
        np.empty(count),
        dt / motion.mass,
        dt / inertia,
        dt / box_inertia,
    )
    return active, problem, overlap / max(touching, 1)


@within
def _largest(values):
    largest = values[0]
    for k in range(values.shape[0]):
        largest = max(largest, values[k])
    return largest


@within
def _move(motion, dilation, dt):
    quickest = 0.0
    for k in range(motion.x.shape[0]):
        v_x, v_y = motion.velocity[k, 0], motion.velocity[k, 1]
        x, y = carried(dilation, motion.x[k, 0], motion.x[k, 1], dt)
        motion.x[k, 0] = x + v_x * dt
        motion.x[k, 1] = y + v_y * dt
        quickest = max(quickest, v_x * v_x + v_y * v_y)
    motion.box[0], _ = carried(dilation, motion.box[0], 0.0, dt)
    motion.tilt[0], motion.box[1] = carried(dilation, motion.tilt[0], motion.box[1], dt)
    # Two grains at a distance of twice the largest radius approach by at most this much.
    approach = fastest(dilation) * dt * 3.0 * _largest(motion.r)
    motion.drift[0] += 2.0 * np.sqrt(quickest) * dt + approach


@within
def _unbalance(motion, before, force, dt):
    total = 0.0
    count = 0
    for c in range(force.shape[0]):
        if force[c, 0] > 0.0:
            total += force[c, 0]
            count += 1
    if count == 0:
        return np.inf
    worst = 0.0
    for k in range(motion.x.shape[0]):
        for a in range(2):
            worst = max(worst, motion.mass[k] * abs(motion.velocity[k, a] - before[k, a]) / dt)
    return worst / (total / count)
