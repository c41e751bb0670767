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

LANES of flows go side by side (see `lanes`), each with its own network, load, pace and Newton step;
none changes a bit of another.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from granforce.forces.contact_problem import balance_of
from granforce.forces.gauss_seidel import BOX_MASS
from granforce.numerics import contact_matrix, lu
from granforce.numerics.contact_matrix import Factors, Network
from granforce.numerics.lanes import (
    ONE,
    compiled,
    inline,
    lanes_for,
    larger,
    load,
    pick,
    room,
    same,
    size,
    store,
    within,
)
from granforce.records import Floats, InputError, Integers, Mask
from granforce.system import cancelling
from granforce.tolerances import BALANCED

if TYPE_CHECKING:  # it needs this file to run
    from granforce.forces.ensemble import Ensemble

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
# How a Newton step ended: no equation is left, the unbalance fell, or neither.
SOLVED, FELL, FAILED = range(3)


class Step(NamedTuple):
    """The step problem of one ensemble, in units of ⟨f_n⟩ and r_max; Δt = 1.

    Rows of grains are in order of elimination; those of the pressure (m = 1, or 0) come apart.
    """

    network: Network
    b: Floats  # (rows,)
    b_border: Floats  # (m,)
    mass: Floats  # (rows,) M
    mass_border: Floats  # (m,)
    stiffness: Floats  # (N_c, 2) D: effective masses of the contacts
    mu: float
    place: Integers  # (rows of the ensemble,) where they are among rows and border


class Motion(NamedTuple):
    """Rows of W flows: velocities, or what is out of balance."""

    rows: Floats  # (rows, W)
    border: Floats  # (m, W)


class Flows(NamedTuple):
    """Where W flows stand, and what a Newton step needs. Numbers are (1, W), counters (W,)."""

    factors: Factors
    load: Motion  # b, the pair included
    forces: Floats  # (2 N_c, W) f
    following: Floats  # (2 N_c, W) f⁺
    state: Floats  # (N_c, W) OPEN, STICKING, ±SLIDING
    before: Floats  # (N_c, W) the states that the last linear system was made for
    velocity: Motion  # U
    base: Motion  # U before the Newton step
    kept: Motion  # U before the implicit step
    rest: Motion  # A f⁺ − b − M U
    direction: Motion  # the Newton step
    pace: Floats  # τ
    length: Floats  # of the Newton step
    least: Floats  # squared unbalance over masses, now,
    merit: Floats  # and before the Newton step
    changed: Floats  # largest |state − before|
    heaviest: Floats  # largest |M U|
    breach: Floats  # of Coulomb's law, relative to the fastest contact
    lately: Floats  # breach of the last implicit step
    steady: Floats  # breach at which motion counts as steady
    newton: Integers  # linear systems of the implicit step
    steps: Integers  # implicit steps
    most: Integers  # implicit steps that are allowed
    iterations: Integers  # linear systems
    found: Integers  # SOLVED, FELL, FAILED
    going: Mask  # bool
    ended: Mask  # bool: at rest, or in steady motion


class Push(NamedTuple):
    """What is asked of a flow: from forces, under a pair of `load` on a contact (its position)."""

    forces: Floats  # (N_c, 2) ⟨f_n⟩
    contact: int
    load: float  # ⟨f_n⟩
    max_steps: int
    steady: float  # breach of Coulomb's law, relative to the fastest contact, of steady motion


class Outcome(NamedTuple):
    """Where the forces went."""

    forces: Floats  # (N_c, 2) ⟨f_n⟩
    velocity: Floats  # (rows,) U, by the ensemble's rows; 0 at rest
    at_rest: bool
    converged: bool  # at rest, or in steady motion
    breach: float  # of Coulomb's law, relative to the fastest contact; 0 at rest
    steps: int  # implicit steps of the flow
    iterations: int  # linear systems solved
    seconds: float  # its part of those that it was carried for beside others


# What asks for one flow after another: it is sent the outcome of each.
Work = Generator[Push, Outcome, Any]


def make_step(ensemble: Ensemble) -> Step:
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
    return Step(network, b, b_border, mass, mass_border, stiffness, ensemble.mu, place)


def _inertia(ensemble: Ensemble) -> Floats:
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


def grain_velocities(ensemble: Ensemble, velocity: Floats) -> Floats:
    """Velocities (M, 3) of the backbone grains: intrinsic v_x, v_y and r ω."""
    size = 1 + ensemble.per_contact
    grains = velocity[: size * len(ensemble.grains)].reshape(-1, size)
    return np.column_stack([grains, np.zeros((len(grains), 3 - size))])


def relative_velocities(step: Step, velocity: Floats) -> Floats:
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


def relax(step: Step, asked: Push) -> Outcome:
    """The Outcome of the flow that a Push asks for."""

    def one() -> Generator[Push, Outcome, Outcome]:
        return (yield asked)

    found: list[Outcome] = []
    follow(step, [one()], lambda _, outcome: found.append(outcome))
    return found[0]


def follow(
    step: Step,
    works: Sequence[Work],
    finished: Callable[[int, Any], object],
    workers: int = 1,
) -> None:
    """Carry works side by side on threads: generators of Push that are sent the Outcome of each.

    A flow ends at rest (unbalance below BALANCED), in steady motion, or after max_steps.
    finished(number, value) is called, by one thread at a time, as a work returns its value; if it
    raises, it is still called for what other threads have ended by then. No outcome depends on the
    number of threads, nor on what it is carried beside, bit for bit.
    """
    waiting, told, failed = deque(enumerate(works)), threading.Lock(), threading.Event()

    def tell(number: int, value: Any) -> None:
        with told:
            finished(number, value)

    def carry() -> None:
        try:
            _carry(step, waiting, tell, failed)
        except BaseException:
            failed.set()  # the other threads end as well
            raise

    if workers == 1:
        carry()
        return
    with cancelling.threads(workers) as pool:
        for task in [pool.submit(carry) for _ in range(workers)]:
            task.result()


def _carry(
    step: Step,
    waiting: deque[tuple[int, Work]],
    finished: Callable[[int, Any], object],
    failed: threading.Event,
) -> None:
    """One thread: fill lanes with works, and carry each until it has nothing more to ask."""
    if not waiting:
        return
    lanes = lanes_for(len(waiting))
    flows, stop = _make_flows(step, len(lanes)), cancelling.flag()
    seconds = np.zeros(len(lanes))
    carried: list[tuple[int, Work] | None] = [None] * len(lanes)
    while True:
        for lane in np.flatnonzero(~flows.going).tolist():
            sent = _outcome(step, flows, lane, seconds[lane]) if carried[lane] else None
            carried[lane] = _go_on(step, flows, lane, carried[lane], sent, waiting, finished)
            seconds[lane] = 0.0
        going = flows.going.copy()
        if failed.is_set() or not going.any():
            return
        begin = time.perf_counter()
        _follow(step, flows, BALANCED / 10, stop, lanes)
        cancelling.check("perturbation")
        seconds[going] += (time.perf_counter() - begin) / going.sum()


def _go_on(
    step: Step,
    flows: Flows,
    lane: int,
    carried: tuple[int, Work] | None,
    sent: Outcome | None,
    waiting: deque[tuple[int, Work]],
    finished: Callable[[int, Any], object],
) -> tuple[int, Work] | None:
    """Send a lane's work its outcome and start what it asks for next, or else what waits first.

    carried: number and work of the lane; it and what is sent are None without. Returns the same.
    """
    while True:
        try:
            number, work = carried or waiting.popleft()
        except IndexError:
            return None
        try:
            _start(step, flows, lane, next(work) if sent is None else work.send(sent))
        except StopIteration as ended:
            finished(number, ended.value)
            carried = sent = None
        else:
            return number, work


def _make_flows(step: Step, width: int) -> Flows:
    """The Flows of `width` lanes that rest."""
    contacts, (rows, m) = len(step.stiffness), (len(step.b), len(step.b_border))

    def motion() -> Motion:
        return Motion(room(rows, width), room(m, width))

    def one() -> Floats:
        return room(1, width, value=1.0)

    def count() -> Integers:
        return np.zeros(width, dtype=np.int64)

    return Flows(
        factors=contact_matrix.make_factors(step.network, width, symmetric=False),
        load=motion(),
        forces=room(2 * contacts, width),
        following=room(2 * contacts, width),
        state=room(contacts, width),
        before=room(contacts, width),
        velocity=motion(),
        base=motion(),
        kept=motion(),
        rest=motion(),
        direction=motion(),
        pace=one(),
        length=one(),
        least=one(),
        merit=one(),
        changed=one(),
        heaviest=one(),
        breach=one(),
        lately=one(),
        steady=one(),
        newton=count(),
        steps=count(),
        most=count(),
        iterations=count(),
        found=count(),
        going=np.zeros(width, dtype=bool),
        ended=np.zeros(width, dtype=bool),
    )


def _start(step: Step, flows: Flows, lane: int, asked: Push) -> None:
    """Put what is asked into a lane."""
    flows.load.rows[:, lane], flows.load.border[:, lane] = step.b, step.b_border
    pair = np.ascontiguousarray(flows.load.rows[:, [lane]])
    border = np.ascontiguousarray(flows.load.border[:, [lane]])
    _pushed(step.network, asked.contact, -float(asked.load), pair, border)
    flows.load.rows[:, [lane]], flows.load.border[:, [lane]] = pair, border
    flows.forces[:, lane] = np.asarray(asked.forces).ravel()
    for motion in (flows.velocity, flows.kept):
        motion.rows[:, lane], motion.border[:, lane] = 0.0, 0.0
    flows.pace[0, lane], flows.lately[0, lane], flows.steady[0, lane] = FIRST, np.inf, asked.steady
    flows.newton[lane] = flows.steps[lane] = flows.iterations[lane] = 0
    flows.most[lane], flows.going[lane] = asked.max_steps, True


@compiled
def _pushed(network, contact, force, rows, border):
    contact_matrix.push(network, contact, force, 0.0, rows, border, ONE)


def _outcome(step: Step, flows: Flows, lane: int, seconds: float) -> Outcome:
    rows = np.concatenate([flows.velocity.rows[:, lane], flows.velocity.border[:, lane]])
    ended, breach = bool(flows.ended[lane]), float(flows.lately[0, lane])
    return Outcome(
        flows.forces[:, lane].reshape(-1, 2).copy(),
        rows[step.place],
        ended and breach == 0.0,
        ended,
        breach,
        int(flows.steps[lane]),
        int(flows.iterations[lane]),
        float(seconds),
    )


@compiled
def _follow(step, flows, rest, stop, lanes):
    """Newton steps of all flows, until one that is going has ended."""
    while not stop[0]:
        _answer(step, flows, lanes)
        contact_matrix.copy(flows.merit, flows.least, lanes)
        contact_matrix.copy(flows.before, flows.state, lanes)
        for to, given in ((flows.base, flows.velocity), (flows.direction, flows.rest)):
            contact_matrix.copy(to.rows, given.rows, lanes)
            contact_matrix.copy(to.border, given.border, lanes)
        _factor(step, flows, stop, lanes)
        direction = flows.direction
        lu.solve(step.network, flows.factors, direction.rows, direction.border, lanes)
        _search(step, flows, lanes)
        _measure(step, flows, lanes)
        ended = False
        for lane in range(len(lanes)):
            if flows.going[lane]:
                _judge(flows, lane, rest)
                ended = ended or not flows.going[lane]
        if ended:
            return


@within
def _judge(flows, lane, rest):
    """What comes after a lane's Newton step: the next, the next implicit step, or the end."""
    flows.iterations[lane] += 1
    flows.newton[lane] += 1
    found = flows.found[lane]
    if found == FELL and flows.newton[lane] < NEWTON:
        return
    flows.newton[lane] = 0
    if found != SOLVED:
        _copy_lane(flows.velocity.rows, flows.kept.rows, lane)
        _copy_lane(flows.velocity.border, flows.kept.border, lane)
        flows.pace[0, lane] *= CUT
        if flows.pace[0, lane] < SHORTEST:
            flows.steps[lane] += 1
            flows.going[lane], flows.ended[lane] = False, False
        return
    flows.steps[lane] += 1
    _copy_lane(flows.forces, flows.following, lane)
    _copy_lane(flows.kept.rows, flows.velocity.rows, lane)
    _copy_lane(flows.kept.border, flows.velocity.border, lane)
    flows.lately[0, lane] = flows.breach[0, lane]
    flows.pace[0, lane] = min(LONGEST, flows.pace[0, lane] * GROWTH)
    resting = flows.heaviest[0, lane] <= rest
    if resting:
        _clear_lane(flows.velocity.rows, lane)
        _clear_lane(flows.velocity.border, lane)
        flows.lately[0, lane] = 0.0
    flows.ended[lane] = resting or flows.lately[0, lane] <= flows.steady[0, lane]
    flows.going[lane] = not flows.ended[lane] and flows.steps[lane] < flows.most[lane]


@within
def _copy_lane(values, given, lane):
    for k in range(len(values)):
        values[k, lane] = given[k, lane]


@within
def _clear_lane(values, lane):
    for k in range(len(values)):
        values[k, lane] = 0.0


@within
def _search(step, flows, lanes):
    """Halve each lane's Newton step until the squared unbalance (over masses) falls.

    It is solved where a whole one leaves every contact in its state: the equations are linear
    there.
    """
    undecided = 0
    for lane in range(len(lanes)):
        flows.length[0, lane] = 1.0
        flows.found[lane] = FAILED
        undecided += flows.going[lane]
    settled = ~flows.going
    for _ in range(HALVINGS):
        length = load(flows.length, 0, lanes)
        _step_along(flows.velocity.rows, flows.base.rows, length, flows.direction.rows, lanes)
        _step_along(flows.velocity.border, flows.base.border, length, flows.direction.border, lanes)
        _answer(step, flows, lanes)
        for lane in range(len(lanes)):
            if settled[lane]:
                continue
            whole = flows.length[0, lane] == 1.0
            if whole and flows.changed[0, lane] == 0.0 and _is_solved(flows, lane):
                flows.found[lane] = SOLVED
            elif flows.least[0, lane] < _wanted(flows, lane):
                flows.found[lane] = FELL
            else:
                flows.length[0, lane] *= 0.5
                continue
            settled[lane] = True
            undecided -= 1
        if undecided == 0:
            return


@within
def _wanted(flows, lane):
    """The squared unbalance below which a Newton step is taken."""
    return (1.0 - DECREASE * flows.length[0, lane]) * flows.merit[0, lane]


@within
def _is_solved(flows, lane):
    """Whether rounding of the velocities, and no more, is left."""
    fastest, rows, border = 0.0, flows.velocity.rows, flows.velocity.border
    for k in range(len(rows)):
        fastest = max(fastest, abs(rows[k, lane]))
    for k in range(len(border)):
        fastest = max(fastest, abs(border[k, lane]))
    left = BALANCED / 10 + ROUNDING * flows.pace[0, lane] * fastest
    return flows.least[0, lane] <= left**2


@within
def _step_along(values, given, length, direction, lanes):
    """values ← given + length · direction."""
    for k in range(len(values)):
        store(values, k, lanes, load(given, k, lanes) + length * load(direction, k, lanes))


@within
def _measure(step, flows, lanes):
    """Largest |M U|, and the relative velocities that forces still answer over the fastest one."""
    zero, least, velocity = same(lanes, 0.0), same(lanes, 1e-300), flows.velocity
    pace = load(flows.pace, 0, lanes)
    heaviest = answered = fastest = zero
    for k in range(len(step.mass)):
        heaviest = larger(size(same(lanes, step.mass[k]) * load(velocity.rows, k, lanes)), heaviest)
    for k in range(len(step.mass_border)):
        moved = same(lanes, step.mass_border[k]) * load(velocity.border, k, lanes)
        heaviest = larger(size(moved), heaviest)
    for k in range(len(flows.forces)):
        change = size(load(flows.following, k, lanes) - load(flows.forces, k, lanes))
        stiffness = same(lanes, step.stiffness[k // 2, k % 2])
        answered = larger(change / (pace * stiffness), answered)
    for c in range(len(step.stiffness)):
        w_n, w_t = contact_matrix.pull(step.network, c, velocity.rows, velocity.border, lanes)
        fastest = larger(size(w_n), larger(size(w_t), fastest))
    breach = pick(fastest, zero, larger(answered / fastest, least), least)
    store(flows.heaviest, 0, lanes, heaviest)
    store(flows.breach, 0, lanes, breach)


@within
def _factor(step, flows, stop, lanes):
    """Factor M + A (∂Π) τ D Aᵀ, not symmetric, as f_t of a sliding contact follows f_n."""
    network, m, factors = step.network, len(step.mass_border), flows.factors
    contact_matrix.begin(network, step.mass, factors, lanes)
    for a in range(m):
        store(factors.corner, m * a + a, lanes, same(lanes, step.mass_border[a]))
    zero, half, pace = same(lanes, 0.0), same(lanes, 0.5), load(flows.pace, 0, lanes)
    closed, sliding = same(lanes, 0.5), same(lanes, 1.5)
    for c in range(len(step.stiffness)):
        state = load(flows.before, c, lanes)
        normal = pace * same(lanes, step.stiffness[c, 0])
        tangential = pace * same(lanes, step.stiffness[c, 1])
        across = half * state * same(lanes, step.mu) * normal
        slides = size(state)
        normal = pick(slides, closed, normal, zero)
        across = pick(slides, sliding, across, zero)
        tangential = pick(slides, sliding, zero, pick(slides, closed, tangential, zero))
        contact_matrix.add_skew(network, c, normal, zero, across, tangential, factors, lanes)
    lu.factor(network, factors, stop, lanes)


@within
def _answer(step, flows, lanes):
    """Forces Π(f − τ D Aᵀ U), states of the contacts and A f⁺ − b − M U; the latter's Σ /M."""
    velocity, rest = flows.velocity, flows.rest
    for k in range(len(step.mass)):
        moved = same(lanes, step.mass[k]) * load(velocity.rows, k, lanes)
        store(rest.rows, k, lanes, -load(flows.load.rows, k, lanes) - moved)
    for k in range(len(step.mass_border)):
        moved = same(lanes, step.mass_border[k]) * load(velocity.border, k, lanes)
        store(rest.border, k, lanes, -load(flows.load.border, k, lanes) - moved)
    store(flows.changed, 0, lanes, same(lanes, 0.0))
    for c in range(len(step.stiffness)):
        f_n, f_t = _followed(step, flows, c, lanes)
        contact_matrix.push(step.network, c, f_n, f_t, rest.rows, rest.border, lanes)
    merit = same(lanes, 0.0)
    for k in range(len(step.mass)):
        off = load(rest.rows, k, lanes)
        merit = merit + off * off / same(lanes, step.mass[k])
    for k in range(len(step.mass_border)):
        off = load(rest.border, k, lanes)
        merit = merit + off * off / same(lanes, step.mass_border[k])
    store(flows.least, 0, lanes, merit)


@inline
def _followed(step, flows, c, lanes):
    """f⁺ of one contact; sets that, its state, and whether it changed."""
    zero, pace = same(lanes, 0.0), load(flows.pace, 0, lanes)
    rows, border = flows.velocity.rows, flows.velocity.border
    w_n, w_t = contact_matrix.pull(step.network, c, rows, border, lanes)
    f_n = load(flows.forces, 2 * c, lanes) - pace * same(lanes, step.stiffness[c, 0]) * w_n
    f_t = load(flows.forces, 2 * c + 1, lanes) - pace * same(lanes, step.stiffness[c, 1]) * w_t
    f_n = larger(f_n, zero)
    limit = same(lanes, step.mu) * f_n
    slides, sticks = same(lanes, 1.0 * SLIDING), same(lanes, 1.0 * STICKING)
    state = pick(f_t, limit, slides, pick(-limit, f_t, -slides, sticks))
    f_t = pick(f_t, limit, limit, pick(-limit, f_t, -limit, f_t))
    state, f_t = pick(f_n, zero, state, zero), pick(f_n, zero, f_t, zero)
    store(flows.following, 2 * c, lanes, f_n)
    store(flows.following, 2 * c + 1, lanes, f_t)
    store(flows.state, c, lanes, state)
    change = size(state - load(flows.before, c, lanes))
    store(flows.changed, 0, lanes, larger(change, load(flows.changed, 0, lanes)))
    return f_n, f_t
