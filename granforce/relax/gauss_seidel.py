"""Relaxation by contact dynamics: the paper's Gauss–Seidel-like sweeps on a fixed geometry."""

import time

import numpy as np
from numba import njit

from granforce.contact_dynamics import StepProblem, add_forces, set_stiffness, sweep
from granforce.records import Relaxation
from granforce.relax.nearest import nearest
from granforce.tolerances import AT_REST, BALANCED

# Inertia M_λ of the box in masses ρ r_max²: between 1 and 100 it changes the number of sweeps by
# less than 10 % for μ from 0.01 to 10.
BOX_MASS = 10.0
# Sweeps between two looks at the residual, which costs about as much as a sweep.
LOOK_EVERY = 20
# Forces that change by less than this part of the residual in a sweep have settled while grains
# still move: contacts slide or open for good, and the state is no equilibrium.
SETTLED = 1e-6
# The same is concluded where the least residual falls by less than a third while the number of
# sweeps doubles, at 32,000 sweeps or later: relaxations that end at rest are far faster by then.
STALL_AFTER = 32_000
STALLED = 0.7


def gauss_seidel(
    ensemble,
    start,
    *,
    tolerance=BALANCED,
    max_iterations=100_000,
    rest=AT_REST,
    order="sequential",
    seed=0,
):
    """One step of contact dynamics from rest, with the given forces (N_c, 2) as first guess.

    Sweeps until the residual (in ⟨f_n⟩) is below `rest`, until grains are seen to move steadily
    (``converged`` with a residual above the tolerance: no equilibrium), or until max_iterations.
    Once at rest the nearest admissible network takes the last digits, down to the tolerance.
    rest=None leaves that out and sweeps to the tolerance. order: "sequential" or "random" (a fresh
    permutation each sweep, from seed).
    """
    begin = time.perf_counter()
    problem, velocity, dilation, unit = _from_rest(ensemble)
    force = np.ascontiguousarray(start, dtype=np.float64) / ensemble.force_scale
    sweeps, settled = _relax(
        problem,
        velocity,
        dilation,
        unit,
        ensemble.mu,
        force,
        tolerance if rest is None else rest,
        max_iterations,
        order == "random",
        np.random.default_rng(seed),
    )
    forces = force * ensemble.force_scale
    residual = ensemble.residual(forces)
    if rest is not None and tolerance < residual <= rest:
        forces = nearest(ensemble, forces).forces
        residual = ensemble.residual(forces)
    return Relaxation(
        forces,
        int(sweeps),
        residual,
        ensemble.violation(forces),
        bool(settled or residual <= tolerance),
        time.perf_counter() - begin,
    )


def _from_rest(ensemble):
    """The step problem in units of r_max and ⟨f_n⟩, and the velocities before contact forces act.

    The right-hand side b of the balance (loads, frozen contacts, pressure) is what acts on the
    grains and on the box besides the unknown contact forces. Δt = 1 throughout.
    """
    contacts, grains = ensemble.contacts, ensemble.grains
    longest = float(ensemble.packing.r.max())
    r = ensemble.packing.r[grains] / longest
    row_of = np.full(len(ensemble.packing.r), -1)
    row_of[grains] = np.arange(len(grains))
    size = 1 + ensemble.per_contact
    count = len(contacts.i)
    velocity = np.zeros((len(grains), 3))
    outer = -ensemble.b[: size * len(grains)].reshape(-1, size) / ensemble.force_scale
    mass = np.pi * r**2
    inertia = 0.5 * mass * r**2
    velocity[:, :2] = outer[:, :2] / mass[:, None]
    if size == 3:
        velocity[:, 2] = outer[:, 2] * r / inertia
    compliance = dilation = 0.0
    length = contacts.length / longest
    if ensemble.has_pressure_row:
        # 2 V in units of r_max² and P0 in ⟨f_n⟩/r_max: P0 · 2 V = Σ ℓ, by the choice of ⟨f_n⟩.
        twice_volume = 2 * ensemble.packing.volume / longest**2
        compliance = 1 / (twice_volume * BOX_MASS)
        dilation = -length.sum() * compliance
    problem = StepProblem(
        row_of[contacts.i],
        row_of[contacts.j],
        contacts.normal[:, 0].copy(),
        contacts.normal[:, 1].copy(),
        length,
        contacts.arm_i / longest,
        contacts.arm_j / longest,
        np.zeros(count),
        np.empty(count),
        np.empty(count),
        1 / mass,
        1 / inertia,
        compliance,
    )
    # What turns velocities (v_x, v_y, ω) and λ back into forces in ⟨f_n⟩.
    box_unit = 1 / (compliance * length.sum()) if compliance else 0.0
    unit = np.append(np.column_stack([mass, mass, inertia / r]).ravel(), box_unit)
    return problem, velocity, dilation, unit


@njit(cache=True, nogil=True)
def _relax(problem, velocity, dilation, unit, mu, force, tolerance, max_sweeps, shuffle, rng):
    set_stiffness(problem)
    dilation = add_forces(problem, force, velocity, dilation)
    order = np.arange(force.shape[0])
    look_back = STALL_AFTER
    least = earlier = np.inf
    for k in range(1, max_sweeps + 1):
        if shuffle:
            rng.shuffle(order)
        dilation, change, total = sweep(problem, order, mu, force, velocity, dilation)
        if k % LOOK_EVERY == 0:
            residual = _residual(velocity, dilation, unit)
            least = min(least, residual)
            if residual <= tolerance or change <= SETTLED * residual * total:
                return k, True
        if k == look_back // 2:
            earlier = least
        if k == look_back:
            if least > STALLED * earlier:
                return k, True
            earlier = least
            look_back *= 2
    return max_sweeps, False


@njit(cache=True, nogil=True)
def _residual(velocity, dilation, unit):
    worst = abs(dilation * unit[-1])
    for k in range(velocity.shape[0]):
        for a in range(3):
            worst = max(worst, abs(velocity[k, a]) * unit[3 * k + a])
    return worst
