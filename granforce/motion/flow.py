"""One step of contact dynamics from rest, solved to rounding: rest, or steady motion.

Gauss–Seidel sweeps from a given network, f_c ← Π(f_c − D A_cᵀ U) contact after contact with D the
effective masses, follow f' = −D Aᵀ U at a rate of one unit of time per sweep (M, D and Π as in
`step`). Here the same flow is integrated implicitly for the whole network at once, with steps of
any length τ,

    f⁺ = Π(f − τ D Aᵀ U⁺),    M U⁺ = A f⁺ − b,

each by Newton's method on the states of the contacts (sticking, sliding either way, open). The
result does not depend on any order of the contacts and is exact to rounding.

Friction has a memory: which network at rest a flow ends in, and whether it comes to rest at all,
depends on the τ of its steps. So does the critical force: without the line search other steps fail
and are shortened, and it changes by up to 0.1 ⟨f_n⟩.

LANES of flows run in parallel (see `lanes`), each with its own network, load, τ and Newton step,
and bit-identical to a single flow.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granforce.motion.step import Step
from granforce.numerics import contact_matrix, lu
from granforce.numerics.contact_matrix import Factors
from granforce.numerics.lanes import (
    ONE,
    allocating_part,
    compiled,
    inline,
    larger,
    load,
    pick,
    room,
    same,
    size,
    store,
    within,
)
from granforce.tolerances import BALANCED
from granforce.types import Floats, Integers, Mask

# Step length τ: first value, growth after a step, and cut if Newton's method failed.
FIRST, GROWTH, CUT = 1e2, 4.0, 0.2
LONGEST, SHORTEST = 1e7, 1e-2
# Most linear systems per step, and halvings of a Newton step.
NEWTON, HALVINGS = 12, 8
# Fraction by which a full Newton step must reduce the squared unbalance.
DECREASE = 0.1
# Error of velocities relative to the fastest, which contacts turn into forces τ times as large, and
# of balance relative to the load, which is large where overlaps are closed.
ROUNDING = 1e-14
# Steady motion: remaining violation of Coulomb's law, relative to the fastest contact.
STEADY = 1e-7

OPEN, STICKING, SLIDING = range(3)  # and −SLIDING, where f_t = −μ f_n
# How a Newton step ended: equations solved, unbalance reduced, or neither.
SOLVED, FELL, FAILED = range(3)


class RowVector(NamedTuple):
    """Rows of W flows: velocities or unbalanced forces."""

    rows: Floats  # (rows, W)
    border: Floats  # (m, W)


class Flows(NamedTuple):
    """The state of W flows and of their Newton steps. Numbers are (1, W), counters (W,)."""

    factors: Factors
    load: RowVector  # b, the pair included
    forces: Floats  # (2 N_c, W) f
    following: Floats  # (2 N_c, W) f⁺
    state: Floats  # (N_c, W) OPEN, STICKING, ±SLIDING
    before: Floats  # (N_c, W) the states of the last linear system
    velocity: RowVector  # U
    base: RowVector  # U before the Newton step
    kept: RowVector  # U before the implicit step
    rest: RowVector  # A f⁺ − b − M U
    direction: RowVector  # the Newton step
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
    most: Integers  # most implicit steps
    iterations: Integers  # linear systems
    outcome: Integers  # SOLVED, FELL, FAILED
    going: Mask  # bool
    ended: Mask  # bool: at rest, or in steady motion


class Push(NamedTuple):
    """A flow to compute: from forces, under a pair of `load` on a contact, or a load on grains."""

    forces: Floats  # (N_c, 2) ⟨f_n⟩
    contact: int  # its position
    load: float  # ⟨f_n⟩
    max_steps: int
    steady: float  # violation of Coulomb's law in steady motion, relative to the fastest contact
    direction: Floats | None = None  # (rows,) of the load on grains, instead of the contact


class Outcome(NamedTuple):
    """The result of a flow."""

    forces: Floats  # (N_c, 2) ⟨f_n⟩
    velocity: Floats  # (rows,) U, in the order of the ensemble's rows; 0 at rest
    at_rest: bool
    converged: bool  # at rest, or in steady motion
    breach: float  # of Coulomb's law, relative to the fastest contact; 0 at rest
    steps: int  # implicit steps of the flow
    iterations: int  # linear systems solved
    seconds: float  # its share of the time of the flows computed together


def make_flows(step: Step, width: int) -> Flows:
    """The Flows of `width` lanes, all at rest."""
    contacts, (rows, m) = len(step.stiffness), (len(step.b), len(step.b_border))

    def vector() -> RowVector:
        return RowVector(room(rows, width), room(m, width))

    def one() -> Floats:
        return room(1, width, value=1.0)

    def count() -> Integers:
        return np.zeros(width, dtype=np.int64)

    return Flows(
        factors=contact_matrix.make_factors(step.network, width, symmetric=False),
        load=vector(),
        forces=room(2 * contacts, width),
        following=room(2 * contacts, width),
        state=room(contacts, width),
        before=room(contacts, width),
        velocity=vector(),
        base=vector(),
        kept=vector(),
        rest=vector(),
        direction=vector(),
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
        outcome=count(),
        going=np.zeros(width, dtype=bool),
        ended=np.zeros(width, dtype=bool),
    )


def start(step: Step, flows: Flows, lane: int, push: Push) -> None:
    """Start a Push in a lane."""
    flows.load.rows[:, lane], flows.load.border[:, lane] = step.b, step.b_border
    if push.direction is None:
        pair = np.ascontiguousarray(flows.load.rows[:, [lane]])
        border = np.ascontiguousarray(flows.load.border[:, [lane]])
        _pushed(step.network, push.contact, -float(push.load), pair, border)
        flows.load.rows[:, [lane]], flows.load.border[:, [lane]] = pair, border
    else:
        rows = np.zeros(len(step.b) + len(step.b_border))
        rows[step.place] = push.load * push.direction
        flows.load.rows[:, lane] -= rows[: len(step.b)]
        flows.load.border[:, lane] -= rows[len(step.b) :]
    flows.forces[:, lane] = np.asarray(push.forces).ravel()
    for vector in (flows.velocity, flows.kept):
        vector.rows[:, lane], vector.border[:, lane] = 0.0, 0.0
    flows.pace[0, lane], flows.lately[0, lane], flows.steady[0, lane] = FIRST, np.inf, push.steady
    flows.newton[lane] = flows.steps[lane] = flows.iterations[lane] = 0
    flows.most[lane], flows.going[lane] = push.max_steps, True


@compiled
def _pushed(network, contact, force, rows, border):
    contact_matrix.push(network, contact, force, 0.0, rows, border, ONE)


def outcome_of(step: Step, flows: Flows, lane: int, seconds: float) -> Outcome:
    """The Outcome of a lane; seconds: its share of the time of all lanes."""
    rows = np.concatenate([flows.velocity.rows[:, lane], flows.velocity.border[:, lane]])
    ended, breach = bool(flows.ended[lane]), float(flows.lately[0, lane])
    return Outcome(
        forces=flows.forces[:, lane].reshape(-1, 2).copy(),
        velocity=rows[step.place],
        at_rest=ended and breach == 0.0,
        converged=ended,
        breach=breach,
        steps=int(flows.steps[lane]),
        iterations=int(flows.iterations[lane]),
        seconds=float(seconds),
    )


@compiled
def until_one_ends(step, flows, rest, stop, lanes):
    """Do Newton steps of all flows until one that is going has ended."""
    while not stop[0]:
        answer(step, flows, lanes)
        contact_matrix.copy(flows.merit, flows.least, lanes)
        find_direction(step, flows, stop, lanes)
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
    """Choose what follows a lane's Newton step: the next, the next implicit step, or the end."""
    flows.iterations[lane] += 1
    flows.newton[lane] += 1
    outcome = flows.outcome[lane]
    if outcome == FELL and flows.newton[lane] < NEWTON:
        return
    flows.newton[lane] = 0
    if outcome != SOLVED:
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


@allocating_part
def _search(step, flows, lanes):
    """Halve each lane's Newton step until the squared unbalance (over masses) falls.

    If a full step leaves every contact in its state, the step is solved: the equations are linear
    there.
    """
    undecided = 0
    for lane in range(len(lanes)):
        flows.length[0, lane] = 1.0
        flows.outcome[lane] = FAILED
        undecided += flows.going[lane]
    settled = ~flows.going
    for _ in range(HALVINGS):
        _go_along(step, flows, lanes)
        for lane in range(len(lanes)):
            if settled[lane]:
                continue
            whole = flows.length[0, lane] == 1.0
            if whole and flows.changed[0, lane] == 0.0 and _is_solved(step, flows, lane):
                flows.outcome[lane] = SOLVED
            elif flows.least[0, lane] < _wanted(flows, lane):
                flows.outcome[lane] = FELL
            else:
                flows.length[0, lane] *= 0.5
                continue
            settled[lane] = True
            undecided -= 1
        if undecided == 0:
            return
    _keep_solved(step, flows, settled, lanes)


@within
def _go_along(step, flows, lanes):
    """The velocities at the length of each lane's Newton step, and the answer to them."""
    length = load(flows.length, 0, lanes)
    step_along(flows.velocity.rows, flows.base.rows, length, flows.direction.rows, lanes)
    step_along(flows.velocity.border, flows.base.border, length, flows.direction.border, lanes)
    answer(step, flows, lanes)


@within
def _keep_solved(step, flows, settled, lanes):
    """Return lanes whose Newton step did not help to its base: SOLVED if the base was.

    Where forces lie on their cones to rounding, every step from a solution changes the state of
    some contact, and only rounding is left to reduce.
    """
    for lane in range(len(lanes)):
        if not settled[lane]:
            flows.length[0, lane] = 0.0
    _go_along(step, flows, lanes)
    for lane in range(len(lanes)):
        if not settled[lane] and _is_solved(step, flows, lane):
            flows.outcome[lane] = SOLVED


@within
def _wanted(flows, lane):
    """The squared unbalance below which a Newton step is accepted."""
    return (1.0 - DECREASE * flows.length[0, lane]) * flows.merit[0, lane]


@within
def _is_solved(step, flows, lane):
    """Whether rounding of the velocities and of the load, and no more, is left."""
    fastest, loaded, velocity, b = 0.0, 0.0, flows.velocity, flows.load
    for k in range(len(step.mass)):
        fastest = max(fastest, abs(velocity.rows[k, lane]))
        loaded += b.rows[k, lane] ** 2 / step.mass[k]
    for k in range(len(step.mass_border)):
        fastest = max(fastest, abs(velocity.border[k, lane]))
        loaded += b.border[k, lane] ** 2 / step.mass_border[k]
    left = BALANCED / 10 + ROUNDING * (flows.pace[0, lane] * fastest + np.sqrt(loaded))
    return flows.least[0, lane] <= left**2


@within
def step_along(values, given, length, direction, lanes):
    """values ← given + length · direction."""
    for k in range(len(values)):
        store(values, k, lanes, load(given, k, lanes) + length * load(direction, k, lanes))


@within
def _measure(step, flows, lanes):
    """Largest |M U|; largest relative velocity at changing forces over the fastest."""
    velocity, pace = flows.velocity, load(flows.pace, 0, lanes)
    heaviest = answered = fastest = same(lanes, 0.0)
    for k in range(len(step.mass)):
        heaviest = larger(size(step.mass[k] * load(velocity.rows, k, lanes)), heaviest)
    for k in range(len(step.mass_border)):
        heaviest = larger(size(step.mass_border[k] * load(velocity.border, k, lanes)), heaviest)
    for k in range(len(flows.forces)):
        change = size(load(flows.following, k, lanes) - load(flows.forces, k, lanes))
        answered = larger(change / (pace * step.stiffness[k // 2, k % 2]), answered)
    for c in range(len(step.stiffness)):
        w_n, w_t = contact_matrix.pull(step.network, c, velocity.rows, velocity.border, lanes)
        fastest = larger(size(w_n), larger(size(w_t), fastest))
    breach = pick(fastest, 0.0, larger(answered / fastest, 1e-300), 1e-300)
    store(flows.heaviest, 0, lanes, heaviest)
    store(flows.breach, 0, lanes, breach)


@within
def find_direction(step, flows, stop, lanes):
    """The Newton direction from the velocities, which become the base, using the last `answer`."""
    direction = flows.direction
    contact_matrix.copy(flows.before, flows.state, lanes)
    for to, given in ((flows.base, flows.velocity), (direction, flows.rest)):
        contact_matrix.copy(to.rows, given.rows, lanes)
        contact_matrix.copy(to.border, given.border, lanes)
    _factor(step, flows, stop, lanes)
    lu.solve(step.network, flows.factors, direction.rows, direction.border, lanes)


@within
def _factor(step, flows, stop, lanes):
    """Factor M + A (∂Π) τ D Aᵀ, unsymmetric because f_t of a sliding contact follows f_n."""
    network, m, factors = step.network, len(step.mass_border), flows.factors
    contact_matrix.begin(network, step.mass, factors, lanes)
    for a in range(m):
        store(factors.corner, m * a + a, lanes, step.mass_border[a])
    pace, closed, sliding = load(flows.pace, 0, lanes), 0.5, 1.5
    for c in range(len(step.stiffness)):
        state = load(flows.before, c, lanes)
        normal = pace * step.stiffness[c, 0]
        tangential = pace * step.stiffness[c, 1]
        across = 0.5 * state * step.mu[c] * normal
        slides = size(state)
        normal = pick(slides, closed, normal, 0.0)
        across = pick(slides, sliding, across, 0.0)
        tangential = pick(slides, sliding, 0.0, pick(slides, closed, tangential, 0.0))
        contact_matrix.add_skew(network, c, normal, 0.0, across, tangential, factors, lanes)
    lu.factor(network, factors, stop, lanes)


@within
def answer(step, flows, lanes):
    """Forces Π(f − τ D Aᵀ U), states of contacts, A f⁺ − b − M U, and Σ of its squares over M."""
    velocity, rest = flows.velocity, flows.rest
    for k in range(len(step.mass)):
        moved = step.mass[k] * load(velocity.rows, k, lanes)
        store(rest.rows, k, lanes, -load(flows.load.rows, k, lanes) - moved)
    for k in range(len(step.mass_border)):
        moved = step.mass_border[k] * load(velocity.border, k, lanes)
        store(rest.border, k, lanes, -load(flows.load.border, k, lanes) - moved)
    store(flows.changed, 0, lanes, 0.0)
    for c in range(len(step.stiffness)):
        f_n, f_t = _next_forces(step, flows, c, lanes)
        contact_matrix.push(step.network, c, f_n, f_t, rest.rows, rest.border, lanes)
    merit = same(lanes, 0.0)
    for k in range(len(step.mass)):
        off = load(rest.rows, k, lanes)
        merit = merit + off * off / step.mass[k]
    for k in range(len(step.mass_border)):
        off = load(rest.border, k, lanes)
        merit = merit + off * off / step.mass_border[k]
    store(flows.least, 0, lanes, merit)


@inline
def _next_forces(step, flows, c, lanes):
    """f⁺ of one contact; also sets its state and whether it changed."""
    pace = load(flows.pace, 0, lanes)
    rows, border = flows.velocity.rows, flows.velocity.border
    w_n, w_t = contact_matrix.pull(step.network, c, rows, border, lanes)
    f_n = load(flows.forces, 2 * c, lanes)
    f_n = f_n - pace * step.stiffness[c, 0] * (w_n + step.closing[c])
    f_t = load(flows.forces, 2 * c + 1, lanes) - pace * step.stiffness[c, 1] * w_t
    f_n = larger(f_n, 0.0)
    limit = step.mu[c] * f_n
    state = pick(f_t, limit, SLIDING, pick(-limit, f_t, -SLIDING, STICKING))
    f_t = pick(f_t, limit, limit, pick(-limit, f_t, -limit, f_t))
    state, f_t = pick(f_n, 0.0, state, 0.0), pick(f_n, 0.0, f_t, 0.0)
    store(flows.following, 2 * c, lanes, f_n)
    store(flows.following, 2 * c + 1, lanes, f_t)
    store(flows.state, c, lanes, state)
    change = size(state - load(flows.before, c, lanes))
    store(flows.changed, 0, lanes, larger(change, load(flows.changed, 0, lanes)))
    return f_n, f_t
