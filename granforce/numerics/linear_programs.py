"""Linear contact programs in lanes, from the analytic centre to their optimum.

Every program starts at the analytic centre y°, where y° z° = 1 with z° = −Tᵀ Aᵀ v°: adding
θ (v°, z°) to any cost gives a strictly feasible, nearly centred start on both sides.
"""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from granforce.numerics import contact_program, interior_point
from granforce.numerics.contact_program import Iterate, Problem, Workspace
from granforce.numerics.interior_point import BALANCE, CENTRE, OPTIMUM, REFINED
from granforce.numerics.lanes import LANES, MANY, ONE
from granforce.system import cancelling
from granforce.tolerances import BALANCED, INTERVAL_GAP
from granforce.types import Floats

# θ relative to the smallest for which all multipliers are ≥ 0; from 1.2 to 20 the cost varies by 4
# %.
_CENTRING = 1.5
# A program leaves its lane at this gap and unbalance, in ⟨f_n⟩; one or two Newton steps on the
# balance then reduce the unbalance to rounding error. Further steps towards the optimum would
# increase it if many forces have bounds of their own.
_LEAVE_GAP = 0.5 * INTERVAL_GAP
_LEAVE_UNBALANCE = 1e-5
# A gap this far below the target no longer improves the balance (large μ, degenerate vertices).
_HOPELESS = 1e-3
_MOST_STEPS = 100
_MOST_BALANCING = 4
# Unbalance, relative to BALANCED, at which the balance is restored; the smaller value with external
# forces, where rows left out may follow from hundreds of others.
_RESTORED, _RESTORED_LOADED = 0.1, 1e-4


class Program(NamedTuple):
    """One program: minimise Σ cost · y[columns]; if loaded ≥ 0, maximise the load F there."""

    columns: list[int]  # positions of the nonzero costs
    costs: list[float]  # their values
    loaded: int  # contact that carries the load F, or −1


class ProgramOutcome(NamedTuple):
    """Where a program ended; nothing is claimed about it until it is certified."""

    number: int  # place in the list of programs
    loaded: int  # as in its Program
    y: Floats  # (n,)
    load: float  # F
    multiplier: Floats  # v of the balance; of all rows of A if z is None
    z: Floats | None  # (n,) multipliers of y ≥ 0
    steps: int


class Centre(NamedTuple):
    """The analytic centre y° (n,), its multipliers, and whether it converged."""

    y: Floats
    z: Floats
    v: Floats
    v_border: Floats
    converged: bool


def centre(problem: Problem, lanes: Any = ONE) -> Centre:
    """The analytic centre of a problem, by Newton's method on y z = 1.

    lanes: as in `interior_point.dependent_rows`.
    """
    at = contact_program.make_iterate(problem, len(lanes))
    work = contact_program.make_workspace(problem, len(lanes))
    at.c[-1] = 1.0
    converged = False
    for _ in range(_MOST_STEPS):
        interior_point.look(problem, True, at, work, lanes)
        off = np.abs(at.y * at.z - 1).max()
        unbalance = max(work.unbalance[0, 0], work.slackness[0, 0])
        converged = bool(off < 0.3 and unbalance < BALANCED)
        if converged or not np.isfinite(off):
            break
        cancelling.check()
        interior_point.advance(problem, True, CENTRE, at, work, lanes)
    return Centre(at.y[:-1, 0], at.z[:-1, 0], at.v[:, 0], at.v_border[:, 0], converged)


def run(
    problem: Problem,
    middle: Centre,
    programs: Sequence[Program],
    numbers: Iterable[int],
    *,
    refined: bool = False,
    workers: int = 1,
    finished: Callable[[Sequence[ProgramOutcome]], object],
) -> None:
    """Solve the programs of these numbers, starting from the centre, on ``workers`` threads.

    refined: each step is refined until only rounding is left of the unbalance. finished(list of
    ProgramOutcome) is called from the threads, with at most LANES outcomes at a time. Cancellation
    is polled before every step. Outcomes are bit-identical for any number of threads.
    """
    mode = REFINED if refined else OPTIMUM
    waiting = deque(numbers)

    def work() -> None:
        _work(problem, middle, programs, waiting, mode, finished)

    cancelling.on_threads(work, workers)


def _work(
    problem: Problem,
    middle: Centre,
    programs: Sequence[Program],
    waiting: deque[int],
    mode: int,
    finished: Callable[[Sequence[ProgramOutcome]], object],
) -> None:
    """One thread: fill lanes from the queue, step, and pass finished outcomes on."""
    if not waiting:
        return
    at = contact_program.make_iterate(problem, LANES)
    work = contact_program.make_workspace(problem, LANES)
    steps = np.zeros(LANES, dtype=np.int64)
    number = np.array([fill(middle, at, lane, programs, waiting) for lane in range(LANES)])
    arrived = []
    while True:
        cancelling.check()
        interior_point.look(problem, True, at, work, MANY)
        gap, unbalance = work.product[0], work.unbalance[0]
        done = (gap <= _LEAVE_GAP) & (unbalance <= _LEAVE_UNBALANCE)
        done |= (gap <= _HOPELESS * _LEAVE_GAP) | ~np.isfinite(gap) | (steps >= _MOST_STEPS)
        left = np.flatnonzero(done & (number >= 0))
        for lane in left.tolist():
            loaded = programs[number[lane]].loaded
            arrived.append(_outcome(problem, at, lane, number[lane], loaded, steps[lane]))
            number[lane] = fill(middle, at, lane, programs, waiting)
            steps[lane] = 0
        while len(arrived) >= LANES or (arrived and not np.any(number >= 0)):
            finished(balanced(problem, middle, arrived[:LANES], work))
            arrived = arrived[LANES:]
        if not np.any(number >= 0):
            return
        if len(left):
            interior_point.look(problem, True, at, work, MANY)
        interior_point.advance(problem, True, mode, at, work, MANY)
        steps += 1


def fill(
    middle: Centre, at: Iterate, lane: int, programs: Sequence[Program], waiting: deque[int]
) -> int:
    """Start the next program in a lane; return its number, or −1 if none is waiting."""
    try:
        number = waiting.popleft()
        program = programs[number]
    except IndexError:
        number, program = -1, Program([0], [1.0], -1)
    cost = np.zeros(len(middle.y) + 1)
    cost[program.columns] = program.costs
    cost[-1] = -1.0 if program.loaded >= 0 else 1.0
    theta = _CENTRING * np.max(np.abs(cost[:-1]) / middle.z)
    if program.loaded >= 0:
        theta = 1.0
    at.loaded[lane] = program.loaded
    at.c[:, lane] = cost
    at.y[:-1, lane], at.y[-1, lane] = middle.y, theta
    at.z[:-1, lane], at.z[-1, lane] = cost[:-1] + theta * middle.z, 1.0
    at.v[:, lane], at.v_border[:, lane] = theta * middle.v, theta * middle.v_border
    return number


def _outcome(
    problem: Problem, at: Iterate, lane: int, number: int, loaded: int, steps: int
) -> ProgramOutcome:
    multiplier = np.concatenate([at.v[:, lane], at.v_border[:, lane]])[problem.place]
    load = float(at.y[-1, lane]) if loaded >= 0 else 0.0
    y, z = at.y[:-1, lane].copy(), at.z[:-1, lane].copy()
    return ProgramOutcome(
        number=int(number),
        loaded=int(loaded),
        y=y,
        load=load,
        multiplier=multiplier,
        z=z,
        steps=int(steps),
    )


def multipliers(
    problem: Problem, A: sparse.csr_matrix, cost: Floats, balance: Floats, z: Floats | None
) -> Floats:
    """Multipliers of all rows of A, from those of the balance and z (n,); see `certified_values`.

    Those of the sides are −ζ, and those of pinned components account for the remaining costs.
    """
    if len(balance) == A.shape[0]:
        return balance
    assert z is not None  # z is None only if the multipliers are of all rows
    pairs = len(problem.w)
    sides = -z[pairs:]
    known = np.concatenate([balance, sides])
    left = (cost - z - A[: len(known)].T @ known)[:pairs].reshape(-1, 2)
    reaction = np.column_stack([left.sum(axis=1), left[:, 0] - left[:, 1]]).ravel()
    pinned = np.flatnonzero(problem.w >= contact_program.PINNED)
    if not problem.mu.any():
        pinned = pinned[::2]  # f_t is not a variable
    return np.concatenate([known, reaction[pinned]])


def balanced(
    problem: Problem,
    middle: Centre,
    outcomes: Sequence[ProgramOutcome],
    work: Workspace | None = None,
) -> list[ProgramOutcome]:
    """Move at most as many outcomes as lanes into S, if they are close to it.

    First A y + a F = b is restored; components that became negative are then corrected by mixing in
    as little as possible of the centre, which is balanced and positive.
    """
    work = work or contact_program.make_workspace(problem, LANES)
    at = contact_program.make_iterate(problem, LANES)
    for lane, outcome in enumerate(outcomes):
        at.y[:-1, lane] = outcome.y
        at.loaded[lane] = outcome.loaded
        if outcome.loaded >= 0:
            at.y[-1, lane] = outcome.load
    restored = BALANCED * (_RESTORED_LOADED if problem.b.any() else _RESTORED)
    for _ in range(_MOST_BALANCING):
        interior_point.look(problem, True, at, work, MANY)
        done = work.unbalance[0] <= restored
        if done[: len(outcomes)].all():
            break
        # Those are restored, so that no outcome depends on the others in its batch.
        kept = at.y[:, done].copy()
        interior_point.advance(problem, True, BALANCE, at, work, MANY)
        at.y[:, done] = kept
    y, load = at.y[:-1], at.y[-1]
    if middle.converged:
        share = np.max(np.maximum(-y, 0.0) / (middle.y[:, None] + np.maximum(-y, 0.0)), axis=0)
        y += share * (middle.y[:, None] - y)
        load *= 1 - share
    return [
        outcome._replace(
            y=np.maximum(y[:, lane], 0.0), load=float(load[lane]) if outcome.loaded >= 0 else 0.0
        )
        for lane, outcome in enumerate(outcomes)
    ]
