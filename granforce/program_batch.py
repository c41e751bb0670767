"""Batches of linear programs over one S: from the ensemble to lanes, and back to rows of A.

Every program starts at the analytic centre y° of S, where y° s° = 1 with s° = −Aᵀλ°: adding
θ (λ°, s°) to any cost gives a strictly feasible, nearly centred start on both sides.
"""

from collections import deque
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from scipy import sparse

from granforce import block_cholesky, interior
from granforce.block_cholesky import LANES
from granforce.tolerances import BALANCED, INTERVAL_GAP

# A row of A whose pivot (relative to its diagonal) is below this follows from the others.
_DEPENDENT = 1e-11
# θ relative to the smallest for which c + θ s° ≥ 0; from 1.2 to 20 it costs the same within 4 %.
_CENTRING = 1.5
# A program leaves its lane at this gap and unbalance, in ⟨f_n⟩; a Newton step or two on A y = b
# afterwards bring the unbalance to rounding error.
_LEAVE_GAP = 0.5 * INTERVAL_GAP
_LEAVE_UNBALANCE = 1e-7
# A gap so far below that does not improve the balance any more (large μ, degenerate vertices).
_HOPELESS = 1e-3
_MOST_STEPS = 60
_MOST_BALANCING = 4


class Program(NamedTuple):
    """One program: minimise Σ cost · y[columns], or, if loaded ≥ 0, maximise the load F there."""

    columns: list  # positions of the nonzero costs
    costs: list  # their values
    loaded: int  # contact that carries the load F, −1 without


class Outcome(NamedTuple):
    """Where a program ended: nothing is claimed about it before it is certified."""

    number: int  # place in the list of programs
    loaded: int  # as in its Program
    y: np.ndarray  # (n,)
    load: float  # F
    multiplier: np.ndarray  # (rows of A,) λ
    steps: int


class Batch(NamedTuple):
    """S laid out for the lanes; forces in ⟨f_n⟩."""

    layout: block_cholesky.Pattern
    columns: interior.Columns
    b: np.ndarray  # (3 grains,) right-hand side of the balance rows, in order of elimination
    b_border: float  # of the pressure row
    row: np.ndarray  # (rows of A,) place of each row of A in λ; the pressure row comes last
    loads: np.ndarray  # (N_c, 7) load column of each contact, the pressure row's entry last
    per_contact: int  # unknowns per contact
    y: np.ndarray  # (n,) the analytic centre
    s: np.ndarray  # (n,) its slack
    multiplier: np.ndarray  # (3 grains,) its λ
    border: float  # its λ of the pressure row
    centred: bool  # whether the centre was reached


def make_batch(ensemble):
    """The Batch of an ensemble: elimination order, independent rows and analytic centre."""
    grains, size = len(ensemble.grains), 1 + ensemble.per_contact
    pairs = np.searchsorted(ensemble.grains, np.c_[ensemble.contacts.i, ensemble.contacts.j])
    layout = block_cholesky.pattern(grains, pairs)
    column_pairs = np.repeat(pairs, ensemble.per_contact, axis=0)
    columns = _columns(ensemble, layout, column_pairs, size)
    row = (3 * layout.position[:, None] + np.arange(size)).ravel()
    scaled = ensemble.b / ensemble.force_scale
    b, b_border = np.zeros(3 * grains), 0.0
    b[row] = scaled[: len(row)]
    if ensemble.has_pressure_row:
        row, b_border = np.append(row, 3 * grains), float(scaled[-1])
    _pin_dependent_rows(layout, columns, b)
    return _with_centre(layout, columns, b, b_border, row, ensemble.per_contact)


def _columns(ensemble, layout, pairs, size):
    A, _ = ensemble.cone_form
    A = sparse.csc_matrix(A)
    place = layout.position[pairs]
    swapped = place[:, 0] < place[:, 1]
    later = np.where(swapped, pairs[:, 1], pairs[:, 0])
    earlier = np.where(swapped, pairs[:, 0], pairs[:, 1])
    number = np.repeat(np.arange(A.shape[1]), np.diff(A.indptr))
    grain, component = np.divmod(A.indices, size)
    pressed = ensemble.has_pressure_row & (A.indices == A.shape[0] - 1)
    value, pressure = np.zeros((A.shape[1], 6)), np.zeros(A.shape[1])
    pressure[number[pressed]] = A.data[pressed]
    for grains, first in ((later, 0), (earlier, 3)):
        here = ~pressed & (grain == grains[number])
        value[number[here], first + component[here]] = A.data[here]
    high, low = place.max(axis=1), place.min(axis=1)
    pinned = np.zeros((len(layout.position), 3))
    pinned[:, size:] = 1.0
    block = block_cholesky.block_of(layout, high, low)
    return interior.Columns(high, low, value, pressure, block, layout.start[:-1].copy(), pinned)


def _pin_dependent_rows(layout, columns, b):
    """Leave out, one by one, rows of the balance that follow from those eliminated before."""
    lanes, work = interior.make_lanes(columns), interior.make_workspace(layout, columns)
    work.D[:-1] = 1.0
    while True:
        interior.assemble(columns, lanes, work.D, work.L)
        before = work.L.reshape(-1, 9, LANES)[columns.diagonal, ::4, 0]
        block_cholesky.factor(work.L, layout.start, layout.target)
        inverse = work.L.reshape(-1, 9, LANES)[columns.diagonal, ::4, 0]
        # A pivot above the diagonal is not one: rounding had made it negative.
        with np.errstate(divide="ignore"):
            pivot = inverse**-2 / before
        dependent = ((pivot <= _DEPENDENT) | (pivot > 2.0)) & (columns.pinned == 0)
        if not dependent.any():
            return
        grain, component = np.argwhere(dependent)[0]
        columns.pinned[grain, component] = 1.0
        columns.value[columns.high == grain, component] = 0.0
        columns.value[columns.low == grain, 3 + component] = 0.0
        b[3 * grain + component] = 0.0


def _with_centre(layout, columns, b, b_border, row, per_contact):
    lanes, work = interior.make_lanes(columns), interior.make_workspace(layout, columns)
    lanes.c[-1] = 1.0
    centred = False
    for _ in range(_MOST_STEPS):
        interior.recentre(
            columns, lanes, work, b, b_border, layout.start, layout.row, layout.target
        )
        off = np.abs(lanes.y[:, 0] * lanes.s[:, 0] - 1).max()
        unbalance = max(lanes.unbalance[0], lanes.slackness[0])
        centred = bool(off < 0.3 and unbalance < BALANCED)
        if centred or not np.isfinite(off):
            break
    # f_n alone is a unit on both cone coordinates: their columns add up to that of f_n.
    loads = np.column_stack([columns.value, columns.pressure])
    loads = loads.reshape(-1, per_contact, 7).sum(axis=1)
    return Batch(
        layout, columns, b, b_border, row, loads, per_contact,
        lanes.y[:-1, 0].copy(), lanes.s[:-1, 0].copy(), lanes.multiplier[:, 0].copy(),
        float(lanes.border[0]), centred,
    )  # fmt: skip


def run(batch, programs, *, workers=1, finished, stop):
    """Carry programs to their optimum on ``workers`` threads.

    finished(list of Outcome) is called from the threads, at most LANES outcomes at a time; stop()
    is asked before every step. An outcome does not depend on the number of threads, bit for bit.
    """
    waiting = deque(enumerate(programs))
    if workers == 1:
        _work(batch, programs, waiting, finished, stop)
        return
    with ThreadPoolExecutor(workers) as pool:
        tasks = [
            pool.submit(_work, batch, programs, waiting, finished, stop) for _ in range(workers)
        ]
        for task in tasks:
            task.result()


def _work(batch, programs, waiting, finished, stop):
    """One thread: fill lanes from the queue, step, hand over what has arrived."""
    columns, layout = batch.columns, batch.layout
    lanes = interior.make_lanes(columns)
    work = interior.make_workspace(layout, columns)
    arguments = (batch.b, batch.b_border, layout.start, layout.row, layout.target)
    number = np.full(LANES, -1)
    steps = np.zeros(LANES, dtype=np.int64)
    arrived = []
    while not stop():
        there = (lanes.gap <= _LEAVE_GAP) & (lanes.unbalance <= _LEAVE_UNBALANCE)
        there |= (lanes.gap <= _HOPELESS * _LEAVE_GAP) | ~np.isfinite(lanes.gap)
        there |= steps >= _MOST_STEPS
        for lane in np.flatnonzero((number < 0) | (there & (steps > 0))):
            if number[lane] >= 0:
                loaded = programs[number[lane]].loaded
                arrived.append(_outcome(batch, lanes, lane, number[lane], loaded, steps[lane]))
            number[lane] = _fill(batch, lanes, lane, waiting)
            steps[lane] = 0
        while len(arrived) >= LANES or (arrived and not np.any(number >= 0)):
            finished(balanced(batch, arrived[:LANES], work))
            arrived = arrived[LANES:]
        if not np.any(number >= 0):
            return
        interior.advance(columns, lanes, work, *arguments)
        steps += 1


def _fill(batch, lanes, lane, waiting):
    """Start the next program in a lane; its number, or −1 where none is waiting."""
    try:
        number, program = waiting.popleft()
    except IndexError:
        number, program = -1, Program([0], [1.0], -1)
    cost = np.zeros(len(batch.y) + 1)
    cost[program.columns] = program.costs
    cost[-1] = -1.0 if program.loaded >= 0 else 1.0
    theta = _CENTRING * np.max(np.abs(cost[:-1]) / batch.s)
    lanes.loaded[lane] = max(program.loaded, 0) * batch.per_contact
    lanes.load[:, lane] = 0.0
    if program.loaded >= 0:
        theta = 1.0
        lanes.load[:, lane] = batch.loads[program.loaded]
    lanes.c[:, lane] = cost
    lanes.y[:-1, lane], lanes.y[-1, lane] = batch.y, theta
    lanes.s[:-1, lane], lanes.s[-1, lane] = cost[:-1] + theta * batch.s, 1.0
    lanes.multiplier[:, lane] = theta * batch.multiplier
    lanes.border[lane] = theta * batch.border
    return number


def _outcome(batch, lanes, lane, number, loaded, steps):
    multiplier = np.append(lanes.multiplier[:, lane], lanes.border[lane])[batch.row]
    load = float(lanes.y[-1, lane]) if loaded >= 0 else 0.0
    y = lanes.y[:-1, lane].copy()
    return Outcome(int(number), int(loaded), y, load, multiplier, int(steps))


def balanced(batch, outcomes, work=None):
    """Up to LANES outcomes moved into S, if they are close to it.

    First A y + a F = b is restored; what this drove below zero is then undone by mixing in as
    little as it takes of the centre, which is balanced and positive.
    """
    work = work or interior.make_workspace(batch.layout, batch.columns)
    lanes = interior.make_lanes(batch.columns)
    for lane, outcome in enumerate(outcomes):
        lanes.y[:-1, lane] = outcome.y
        if outcome.loaded >= 0:
            lanes.y[-1, lane] = outcome.load
            lanes.loaded[lane] = outcome.loaded * batch.per_contact
            lanes.load[:, lane] = batch.loads[outcome.loaded]
    layout = batch.layout
    arguments = (batch.b, batch.b_border, layout.start, layout.row, layout.target)
    for _ in range(_MOST_BALANCING):
        interior.residuals(batch.columns, lanes, work, *arguments[:2])
        balanced_already = lanes.unbalance <= 0.1 * BALANCED
        if balanced_already[: len(outcomes)].all():
            break
        # Those are put back, so that no outcome depends on the company it came in.
        kept = lanes.y[:, balanced_already]
        interior.rebalance(batch.columns, lanes, work, *arguments)
        lanes.y[:, balanced_already] = kept
    y, load = lanes.y[:-1], lanes.y[-1]
    if batch.centred:
        share = np.max(np.maximum(-y, 0.0) / (batch.y[:, None] + np.maximum(-y, 0.0)), axis=0)
        y += share * (batch.y[:, None] - y)
        load *= 1 - share
    return [
        outcome._replace(
            y=np.maximum(y[:, lane], 0.0), load=float(load[lane]) if outcome.loaded >= 0 else 0.0
        )
        for lane, outcome in enumerate(outcomes)
    ]
