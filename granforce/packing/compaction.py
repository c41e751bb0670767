"""From a dilute gas of disks to a jammed packing, at constant pressure (arXiv:0803.3566).

The dynamics runs until a network certifies that it is jammed: an admissible force network on the
present contacts, close to the dynamic forces. Then the grains move by the least amount that closes
every contact exactly. At μ = 0 contact dynamics alone does not reach isostaticity, and below 1e-4
it takes ever longer to come to rest: there linear programs shrink the box under linearised
non-overlap.
"""

from typing import NamedTuple

import numpy as np
import piqp
from scipy import sparse

from granforce.forces import contact_dynamics as dynamics
from granforce.forces.ensemble import ensemble
from granforce.forces.nearest import nearest
from granforce.numerics import highs as programs
from granforce.numerics.lanes import compiled
from granforce.packing.neighbours import find_pairs, separations
from granforce.records import (
    Cell,
    InputError,
    NotJammedError,
    UndecidedError,
    float_array,
    friction,
    make_contacts,
    make_packing,
    moderate,
    positive,
)
from granforce.system import cancelling
from granforce.tolerances import JAMMED_DISTANCE, LARGEST_FRICTION, OVERLAP, TOUCHING

INITIAL_FRACTION = 0.5
# A network is looked for every so many steps, once grains and box are nearly at rest.
CHECK_EVERY = 100
NEARLY_BALANCED = 0.3
# Up to this μ a packing is finished like a frictionless one, from which its geometry differs by
# order μ: contact dynamics takes ever longer to reach rest there.
NEARLY_FRICTIONLESS = 1e-4
# Strain of the box per step below which frictionless grains are handed to the linear programs.
BOX_AT_REST = 1e-6
# Steps of the quadratic program that finds it: where a network exists it was found in 9 to 21
# (N = 400), where none exists the program would go on to its limit.
NETWORK_ITERATIONS = 60
# Skin of the neighbour list and reach of the finishing programs, in largest radii; the list is made
# anew once two grains may have approached by MOVED.
SKIN = 0.2
MOVED = 0.5 * SKIN
# Largest displacement of a grain that the finishing of a frictional packing may need.
LARGEST_CORRECTION = 1e-2
# Largest move of a grain in one of the linear programs, along each axis.
TRUST = 0.05
# Steps between two looks of whoever watches.
WATCH_EVERY = 5


class Glimpse(NamedTuple):
    """A packing while it is compressed, as `watch` of `pack` gets it; all arrays are its own."""

    step: int
    x: np.ndarray  # (N, 2) centres inside the box, length
    r: np.ndarray  # (N,)
    box: np.ndarray  # (2,)
    i: np.ndarray  # (k,) grains of the contacts that carry force
    j: np.ndarray
    reach: np.ndarray  # (k, 2) from the centre of grain i to that of grain j, length
    forces: np.ndarray  # (k, 2) f_n, f_t, force
    packing_fraction: float
    unbalance: float  # largest change of a grain's momentum per step, ⟨f_n⟩
    tilt: float = 0.0  # of the cell, length


@cancelling.cancellable
def pack(
    n,
    mu,
    seed,
    *,
    radii="uniform:0.5,1",
    pressure=1.0,
    dt=0.01,
    box_mass=100.0,
    sweeps=100,
    accuracy=1e-9,
    max_steps=100_000,
    progress=None,
    watch=None,
    cancel=None,
):
    """A jammed packing of n disks with friction coefficient μ in a doubly periodic square box.

    radii: "uniform:LOW,HIGH", "bidisperse:SMALL,LARGE,FRACTION_LARGE" or a list of n radii.
    pressure: P0. dt, box_mass (M_λ): time step and inertia of the box in units of the largest
    radius, P0 and the mass density; sweeps, accuracy: Gauss–Seidel sweeps a step ends after, or
    the relative change of forces in a sweep. progress(step, message) is called now and then,
    watch(Glimpse) at least every WATCH_EVERY steps; neither changes a bit of the result. cancel()
    returning True raises Cancelled.

    Returns a Packing whose forces balance to BALANCED ⟨f_n⟩ and whose overlaps are below OVERLAP.
    Raises NotJammedError after max_steps, with the state reached, and InputError for bad input.
    """
    mu = friction(mu)
    if mu > LARGEST_FRICTION:
        raise InputError(
            f"friction coefficient {mu:g} is too large for the balance of forces in double "
            f"precision; take at most {LARGEST_FRICTION:g}"
        )
    pressure = moderate(pressure, "pressure")
    if int(n) != n or n < 3:
        raise InputError(f"a packing needs at least 3 disks, got {n}")
    for name, value in (("dt", dt), ("box_mass", box_mass), ("accuracy", accuracy)):
        positive(value, name)
    if sweeps < 1 or max_steps < 1:
        raise InputError("sweeps and max_steps must be at least 1")
    rng = np.random.default_rng(seed)
    r = draw_radii(radii, int(n), rng)
    unit = r.max()
    motion = _dilute_gas(r / unit, rng)
    settings = {"dt": dt, "box_mass": box_mass, "sweeps": sweeps, "accuracy": accuracy}
    counters = np.zeros(3, dtype=np.int64)
    work = {"list_rebuilds": 0, "certificates_tried": 0, "linear_programs": 0}
    tell = progress or (lambda step, message: None)
    look = None if watch is None else _looking(watch, unit, pressure, counters)
    if look is not None:
        look(motion, np.inf)
    while True:
        motion, overlap, unbalance = _advance(motion, mu, settings, counters, work, look)
        step = int(counters[dynamics.STEPS])
        tell(step, f"φ = {_fraction(motion):.4f}, unbalance {unbalance:.1e} ⟨f_n⟩")
        cancelling.check("compaction")
        finished = _finish(motion, mu, settings, unbalance, work)
        if finished is not None:
            break
        if step >= max_steps:
            raise NotJammedError(
                f"not jammed after {step} steps: φ = {_fraction(motion):.4f}, unbalance "
                f"{unbalance:.1e} ⟨f_n⟩, strain rate {motion.dilation[0]:.1e}; allow more steps "
                "(max_steps) or more sweeps"
            )
    info = {
        "seed": seed,
        "radii": radii if isinstance(radii, str) else "list",
        **settings,
        "steps": step,
        "sweeps_done": int(counters[dynamics.SWEEPS]),
        "contact_updates": int(counters[dynamics.UPDATES]),
        "mean_overlap_of_dynamics": overlap,
        **work,
    }
    return _in_users_units(finished, unit, pressure, info)


def draw_radii(spec, n, rng):
    """n radii from "uniform:LOW,HIGH", "bidisperse:SMALL,LARGE,FRACTION_LARGE" or a list."""
    if not isinstance(spec, str):
        r = float_array(spec, (n,), "radii")
    else:
        kind, _, numbers = spec.partition(":")
        try:
            values = [float(v) for v in numbers.split(",")]
        except ValueError:
            values = []
        if kind == "uniform" and len(values) == 2 and 0 < values[0] <= values[1] < np.inf:
            r = rng.uniform(*values, n)
        elif kind == "bidisperse" and len(values) == 3 and 0 <= values[2] <= 1:
            r = np.full(n, values[0])
            r[rng.permutation(n)[: round(values[2] * n)]] = values[1]
        else:
            raise InputError(
                f"radii {spec!r} not understood: give uniform:LOW,HIGH or "
                "bidisperse:SMALL,LARGE,FRACTION_LARGE with 0 < LOW ≤ HIGH"
            )
    for extreme in (r.min(), r.max()):
        moderate(extreme, "radii")
    return r


def _dilute_gas(r, rng):
    fraction = INITIAL_FRACTION
    largest_first = np.argsort(-r, kind="stable")
    while True:
        side = np.sqrt(np.pi * np.sum(r**2) / fraction)
        x, placed = _insert(r, largest_first, side, rng, 20_000, cancelling.flag())
        cancelling.check("compaction")
        if placed:
            break
        # Few or very unequal disks may not fit at once: begin more dilute.
        fraction *= 0.9
    n = len(r)
    velocity = np.zeros((n, 3))
    return _with_new_list(
        dynamics.Motion(
            x, velocity, r, np.pi * r**2, np.full(2, side), np.zeros(1), *_no_pairs(), np.zeros(1)
        )
    )


def _no_pairs():
    return (
        np.zeros(0, np.int64),
        np.zeros(0, np.int64),
        np.zeros((0, 2), np.int64),
        np.zeros((0, 2)),
    )


@compiled
def _insert(r, order, side, rng, attempts, stop):
    """Random sequential insertion in a periodic square; False where a disk found no place.

    Ends early once stop[0] is raised.
    """
    x = np.empty((len(r), 2))
    for k in range(len(order)):
        a = order[k]
        for _ in range(attempts):
            x[a, 0] = rng.random() * side
            x[a, 1] = rng.random() * side
            if stop[0]:
                return x, False
            free = 2.0 * r[a] < side
            for m in range(k):
                b = order[m]
                d_x = abs(x[a, 0] - x[b, 0])
                d_y = abs(x[a, 1] - x[b, 1])
                d_x = min(d_x, side - d_x)
                d_y = min(d_y, side - d_y)
                if d_x * d_x + d_y * d_y < (r[a] + r[b]) ** 2:
                    free = False
                    break
            if free:
                break
        else:
            return x, False
    return x, True


def _with_new_list(motion):
    if motion.box[0] <= 2 * motion.r.max():
        raise NotJammedError(
            "the box shrank to the largest disk's diameter without jamming: too few disks"
        )
    i, j, shift = find_pairs(motion.x, motion.r, Cell(motion.box, 0.0), SKIN)
    # In an order of their own, pairs are swept in the same order however often the list is made.
    order = np.lexsort((shift[:, 1], shift[:, 0], j, i))
    i, j, shift = i[order], j[order], shift[order]
    force = _carry_over(motion.i, motion.j, motion.shift, motion.force, i, j, shift)
    return motion._replace(i=i, j=j, shift=shift, force=force, drift=np.zeros(1))


@compiled
def _carry_over(old_i, old_j, old_shift, old_force, i, j, shift):
    """Forces of the old pairs on the new ones, by grain numbers and image."""
    grains = 0
    for a in old_i:
        grains = max(grains, a + 1)
    for a in i:
        grains = max(grains, a + 1)
    start = np.zeros(grains + 1, np.int64)
    # Lists come grouped by i, so the old pairs of one grain lie side by side.
    for a in old_i:
        start[a + 1] += 1
    for a in range(grains):
        start[a + 1] += start[a]
    force = np.zeros((len(i), 2))
    for p in range(len(i)):
        for q in range(start[i[p]], start[i[p] + 1]):
            same = shift[p, 0] == old_shift[q, 0] and shift[p, 1] == old_shift[q, 1]
            if old_j[q] == j[p] and same:
                force[p, 0], force[p, 1] = old_force[q, 0], old_force[q, 1]
    return force


def _looking(watch, unit, pressure, counters):
    """look(motion, unbalance): have it watched, in the user's units."""

    def look(motion, unbalance):
        carrying = motion.force[:, 0] > 0
        i, j, shift = motion.i[carrying], motion.j[carrying], motion.shift[carrying]
        glimpse = Glimpse(
            int(counters[dynamics.STEPS]),
            np.mod(motion.x, motion.box) * unit,
            motion.r * unit,
            motion.box * unit,
            i,
            j,
            (motion.x[j] - motion.x[i] + shift * motion.box) * unit,
            motion.force[carrying] * (unit * pressure),
            _fraction(motion),
            float(unbalance),
        )
        watch(glimpse)

    return look


def _advance(motion, mu, settings, counters, work, look=None):
    """CHECK_EVERY time steps; returns the motion, mean overlap and unbalance."""
    goal = counters[dynamics.STEPS] + CHECK_EVERY
    while (left := int(goal - counters[dynamics.STEPS])) > 0:
        overlap, unbalance = dynamics.advance(
            motion,
            mu,
            1.0,
            settings["box_mass"],
            settings["dt"],
            settings["sweeps"],
            settings["accuracy"],
            MOVED,
            left if look is None else min(left, WATCH_EVERY),
            counters,
            cancelling.flag(),
        )
        cancelling.check("compaction")
        if motion.drift[0] > MOVED:
            motion = _with_new_list(motion)
            work["list_rebuilds"] += 1
        if look is not None:
            look(motion, unbalance)
    return motion, overlap, unbalance


def _fraction(motion):
    return float(np.pi * np.sum(motion.r**2) / np.prod(motion.box))


def _finish(motion, mu, settings, unbalance, work):
    """The finished packing in natural units, or None while it is not jammed."""
    if mu <= NEARLY_FRICTIONLESS:
        if abs(motion.dilation[0]) * settings["dt"] > BOX_AT_REST:
            return None
        return _shrink_to_isostatic(motion, mu, work)
    if unbalance > NEARLY_BALANCED:
        return None
    work["certificates_tried"] += 1  # so are the networks looked for called in stored packings
    return _jammed_network(motion, mu)


def _jammed_network(motion, mu):
    """The packing at rest, if an admissible network lies close to the dynamic forces."""
    pairs = motion.i, motion.j, motion.shift
    normal, _, gap = separations(motion.x, motion.r, Cell(motion.box, 0.0), *pairs)
    touching = (motion.force[:, 0] > 0) | (gap < TOUCHING)
    if not touching.any():
        return None
    as_it_moves = _packing_of(motion, motion.x, motion.box, touching, motion.force, mu)
    if _near_forces(as_it_moves) is None:
        return None
    closed = _close_contacts(motion, touching, normal, gap)
    if closed is None:
        return None
    x, box, touching = closed
    packing = _packing_of(motion, x, box, touching, motion.force, mu)
    found = _near_forces(packing)
    if found is None:
        # Overlap had jammed more contacts than rigid disks can have: go on from where they fit.
        motion.x[:], motion.box[:] = x, box
        return None
    return _on_backbone(packing._replace(forces=found))


def _near_forces(packing):
    """The balanced network nearest to the packing's forces, or None if it is not close to them."""
    S = ensemble(packing, prune=False)
    forces = nearest(S, S.original, max_iterations=NETWORK_ITERATIONS).forces
    far = np.linalg.norm(forces - packing.forces) / np.linalg.norm(packing.forces)
    return forces if S.admits(forces) and far <= JAMMED_DISTANCE else None


def _on_backbone(packing):
    """The packing with forces on its backbone alone, balanced to the last digits; None if not."""
    try:
        S = ensemble(packing)
    except (NotJammedError, UndecidedError):
        return None
    forces = nearest(S, S.original).forces
    return packing._replace(forces=S.expand(forces)) if S.admits(forces) else None


def _packing_of(motion, x, box, touching, force, mu):
    i, j, shift = motion.i[touching], motion.j[touching], motion.shift[touching]
    normal, length, _ = separations(x, motion.r, Cell(box, 0.0), i, j, shift)
    contacts = make_contacts(i, j, normal, np.maximum(length, 0), motion.r)
    # Overlap that contact dynamics left is closed before the packing is handed out: rigid arms.
    contacts = contacts._replace(arm_i=motion.r[i], arm_j=motion.r[j])
    return make_packing(x, motion.r, box, contacts, force[touching], mu, 1.0)


def _close_contacts(motion, touching, normal, gap):
    """Centres and box moved as little as brings touching gaps to 0 and keeps others ≥ 0.

    Least Σ|u|² + N (ε L)², u the displacements and ε the strain of the box: near μ = 0 the
    contacts are as many as the coordinates, and close only together with the box. Newton on the
    gaps, each step a quadratic program; None where the contacts cannot all close.
    """
    x, box = motion.x.copy(), motion.box.copy()
    near = touching | (gap < SKIN / 2)
    i, j, shift = motion.i[near], motion.j[near], motion.shift[near]
    exact = touching[near]
    force = motion.force[near, 0]
    for _ in range(8):
        normal, length, gap = separations(x, motion.r, Cell(box, 0.0), i, j, shift)
        if max(np.abs(gap[exact]).max(), -gap.min()) < 1e-3 * OVERLAP:
            closed = np.zeros(len(touching), bool)
            closed[near] = exact
            return x, box, closed
        weight = box[0] * np.sqrt(len(x))
        R = sparse.hstack(
            [_approach(i, j, normal, len(x)), sparse.csc_matrix(length[:, None] / weight)]
        )
        move, opened = _least_motion(sparse.csr_matrix(R), gap, exact, force)
        exact &= ~opened
        if np.abs(move[:-1]).max() > LARGEST_CORRECTION or not exact.any():
            return None
        strain = move[-1] / weight
        x = x * (1 + strain) + move[:-1].reshape(-1, 2)
        box = box * (1 + strain)
    return None


def _approach(i, j, normal, n):
    """Sparse (pairs, 2n) matrix: first-order change of each gap with the displacements."""
    row = np.repeat(np.arange(len(i)), 4)
    column = np.column_stack([2 * i, 2 * i + 1, 2 * j, 2 * j + 1]).ravel()
    value = np.column_stack([-normal, normal]).ravel()
    return sparse.csc_matrix((value, (row, column)), shape=(len(i), 2 * n))


def _least_motion(R, gap, exact, force):
    """u with the least |u|² such that R u = −gap (exact) and R u ≥ −gap (others); who had to open.

    Overlap that piled up during the dynamics can leave more contacts than rigid disks can close
    at once (near μ = 0). Then those open whose work Σ f_n · opening is least.
    """
    others = ~exact
    n, closed = R.shape[1], int(exact.sum())
    # Scaled by the largest gap to be closed, so that the solver's tolerance is relative to it.
    scale = max(np.abs(gap[exact]).max(), -gap.min(), 1e-300)
    cost = 1e4 * (force[exact] / max(force.mean(), 1e-300) + 1e-3)
    for slack in (0, closed):
        opening = sparse.eye(closed, slack)
        solver = piqp.SparseSolver()
        solver.settings.eps_abs = solver.settings.eps_rel = 1e-14
        solver.setup(
            sparse.block_diag([sparse.identity(n), 1e-8 * sparse.identity(slack)], format="csc"),
            np.concatenate([np.zeros(n), cost[:slack]]),
            sparse.csc_matrix(sparse.hstack([R[exact], -opening])),
            -gap[exact] / scale,
            sparse.csc_matrix(
                sparse.hstack([R[others], sparse.csr_matrix((int(others.sum()), slack))])
            ),
            -gap[others] / scale,
            np.full(int(others.sum()), np.inf),
            np.concatenate([np.full(n, -np.inf), np.zeros(slack)]),
        )
        solver.solve()
        move = np.array(solver.result.x)[:n]
        left = R[exact] @ move + gap[exact] / scale
        if np.abs(left).max() < 1e-3:
            break
    opened = np.zeros(len(gap), bool)
    opened[exact] = left > 1e-3
    return move * scale, opened


def _shrink_to_isostatic(motion, mu, work):
    """Frictionless finish: linear programs that shrink the box until no grain can make room.

    minimise ε subject to gap_c + n_c·(u_j − u_i) + ε ℓ_c ≥ 0, |u| ≤ TRUST. Distances are convex
    in the displacements, so no step makes an overlap; at the end the contacts that carry force
    are exactly isostatic, N_c = 2M − 1.
    """
    x, box = motion.x.copy(), motion.box.copy()
    x, box = _without_overlap(x, box, motion)
    for _ in range(60):
        cancelling.check("compaction")
        i, j, shift = find_pairs(x, motion.r, Cell(box, 0.0), 4 * TRUST)
        normal, length, gap = separations(x, motion.r, Cell(box, 0.0), i, j, shift)
        move, strain = _shrink_program(i, j, normal, length, gap, len(x))
        work["linear_programs"] += 1
        x = x * (1 + strain) + move
        box = box * (1 + strain)
        # Rattlers move at the programs' whim to the end; only the box tells that nothing is left.
        if strain > -1e-13:
            break
    i, j, shift = find_pairs(x, motion.r, Cell(box, 0.0), TOUCHING)
    at_rest = motion._replace(i=i, j=j, shift=shift)
    touching = np.ones(len(i), bool)
    packing = _packing_of(at_rest, x, box, touching, np.zeros((len(i), 2)), mu)
    return _on_backbone(packing)


def _without_overlap(x, box, motion):
    """Expand the box until the largest overlap is gone: the programs start feasible."""
    pairs = motion.i, motion.j, motion.shift
    _, length, gap = separations(x, motion.r, Cell(box, 0.0), *pairs)
    growth = 1 + max(0.0, float(np.max(-gap / length, initial=0.0)))
    return x * growth, box * growth


def _shrink_program(i, j, normal, length, gap, n):
    """Displacements (n, 2) and strain of the box of the linear program, by HiGHS."""
    R = sparse.hstack([_approach(i, j, normal, n), sparse.csc_matrix(length[:, None])])
    # Two grains approach by at most 2√2 TRUST, and by TRUST with the box: within the pairs' reach.
    lower = np.append(np.full(2 * n, -TRUST), -TRUST / 2)
    upper = np.append(np.full(2 * n, TRUST), 0.0)
    # The duals are the contact forces: this cost makes their mean about 1, the tolerances' scale.
    cost = np.append(np.zeros(2 * n), 4.0 * n)
    rows = -gap, np.full(len(gap), np.inf)
    model = programs.bounded(R, rows, (lower, upper), cost)
    u = programs.optimal(model)
    if u is None:
        raise UndecidedError(
            "the last step of the compaction is undecided: no solver found the optimum of one of "
            "its linear programs; take another seed"
        )
    return u[:-1].reshape(-1, 2), float(u[-1])


def _in_users_units(packing, unit, pressure, info):
    contacts = packing.contacts
    lengths = {name: getattr(contacts, name) * unit for name in ("length", "gap", "arm_i", "arm_j")}
    return make_packing(
        np.mod(packing.x, packing.box) * unit,
        packing.r * unit,
        packing.box * unit,
        contacts._replace(**lengths),
        packing.forces * unit * pressure,
        packing.mu,
        pressure,
        info=info,
    )
