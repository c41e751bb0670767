"""Gauss–Seidel sweeps over a fixed geometry in lanes, until grains are at rest or move steadily."""

from typing import NamedTuple

import numpy as np

from granforce.motion.contact_dynamics import sweep
from granforce.numerics.lanes import allocating, larger, load, same, size, store, within
from granforce.types import Floats, Integers

# Sweeps between two checks of the residual, each of which costs about as much as a sweep.
LOOK_EVERY = 20
# Forces that change by less than this fraction of the residual in a sweep have settled while grains
# still move: contacts slide or open permanently, and the state is not an equilibrium.
SETTLED = 1e-6
# The same is concluded if the least residual falls by less than a third while the number of sweeps
# doubles, from 32,000 sweeps on: relaxations that reach rest are far faster.
STALL_AFTER = 32_000
STALLED = 0.7

UNDER_WAY, SETTLED_DOWN, ENDED = range(3)  # at rest or moving steadily; ended without either


class Looks(NamedTuple):
    """Record of the relaxation in each lane, between two checks of its residual."""

    dilation: Floats  # λ
    least: Floats  # residual so far
    earlier: Floats  # the least when half the sweeps until `back` were done
    back: Integers  # number of sweeps at which progress is judged next
    state: Integers  # UNDER_WAY, SETTLED_DOWN or ENDED


@allocating
def relax(problem, velocity, unit, mu, force, tolerance, most, sweeps, looks, rng, stop, lanes):
    """Sweep in all lanes until a relaxation in progress has ended."""
    order = np.arange(problem.i.shape[0])
    dilation = load(looks.dilation, 0, lanes)
    change = total = same(lanes, 0.0)
    residuals = np.empty(len(lanes))
    changes, totals = np.empty_like(residuals), np.empty_like(residuals)
    going_on = True
    while going_on and not stop[0]:
        for _ in range(_until_a_look(looks, sweeps, most)):
            if rng is not None:
                rng.shuffle(order)
            dilation, change, total = sweep(problem, order, mu, force, velocity, dilation, lanes)
            sweeps += 1
            if stop[0]:
                break
        store(residuals, 0, lanes, _residual(velocity, dilation, unit, lanes))
        store(changes, 0, lanes, change)
        store(totals, 0, lanes, total)
        for lane in range(sweeps.shape[0]):
            if looks.state[lane] != UNDER_WAY:
                continue
            settled = changes[lane] <= SETTLED * residuals[lane] * totals[lane]
            _look(looks, lane, sweeps[lane], residuals[lane], settled, tolerance, most)
            going_on &= looks.state[lane] == UNDER_WAY
    store(looks.dilation, 0, lanes, dilation)


@within
def _until_a_look(looks, sweeps, most):
    """Number of sweeps until the next check."""
    least = LOOK_EVERY
    for lane in range(sweeps.shape[0]):
        if looks.state[lane] == UNDER_WAY:
            done = sweeps[lane]
            least = min(least, LOOK_EVERY - done % LOOK_EVERY, most - done)
    return least


@within
def _look(looks, lane, done, residual, settled, tolerance, most):
    """Whether a relaxation has ended after this many sweeps."""
    if done % LOOK_EVERY == 0:
        looks.least[lane] = min(looks.least[lane], residual)
        if residual <= tolerance or settled:
            looks.state[lane] = SETTLED_DOWN
            return
    if done == looks.back[lane] // 2:
        looks.earlier[lane] = looks.least[lane]
    if done == looks.back[lane]:
        if looks.least[lane] > STALLED * looks.earlier[lane]:
            looks.state[lane] = SETTLED_DOWN
            return
        looks.earlier[lane] = looks.least[lane]
        looks.back[lane] *= 2
    if done >= most:
        looks.state[lane] = ENDED


@within
def _residual(velocity, dilation, unit, lanes):
    worst = size(dilation * unit[-1])
    for k in range(unit.shape[0] - 1):
        worst = larger(worst, size(load(velocity, k, lanes)) * unit[k])
    return worst
