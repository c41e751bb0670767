"""Uniform sampling of S: states of equal density in the affine hull of S, and how well it mixed.

Unlike the paper's walk, whose measure is not known, the walks used here have the uniform measure
as their stationary one (see `billiard`), from whatever state they start.
"""

import copy
import time
from typing import NamedTuple

import numpy as np
from scipy.sparse.linalg import norm

from granforce.explore import billiard
from granforce.explore.chart import Chart, chart
from granforce.explore.mixing import Mixing, mixing
from granforce.forces.contact_problem import inner_network
from granforce.records import Cancelled, InputError
from granforce.system import cancelling
from granforce.tolerances import ADMISSIBLE, BALANCED, FLAT

# Mean length of a path in root mean square distances of states from the centre; what an effective
# state costs has its minimum, a flat one, near this.
PATH = 2.0
# Paths between states that are kept: 1000 states are then worth 400 to 700 independent ones.
PATHS_PER_STATE = 2
# Moves of hit-and-run per state and dimension; its chains mix more slowly by about this factor.
MOVES_PER_DIMENSION = 20
# States dropped at the start of each chain; from the first part comes the length of the paths of
# the second, and from that the length for good.
WARM_UP = 20, 40
# Turns after which a path is not taken, per dimension; a usual path has less than one.
MOST_TURNS = 10
# Chains whose R̂ exceeds this have not mixed (Gelman et al., Bayesian Data Analysis, 3rd ed., 11.4);
# the largest R̂ of 1300 components of chains that have is 1.01 for 1000 states, 1.06 for 200.
MIXED = 1.1
# A run that wants an effective sample size ends at this many times as many states.
MOST_STATES = 10
# States of each chain between two calls of progress and cancel.
_ROUND = 20

METHODS = ("billiard", "hit_and_run")


class ChainState(NamedTuple):
    """Where a chain stands: its place and its own random stream."""

    place: np.ndarray  # (h,) u in the chart
    rng: np.random.Generator


class Moves(NamedTuple):
    """What one step did."""

    slacks: np.ndarray  # (count, rows) the states, for Chart.points
    turns: int  # reflections at walls
    refused: int  # paths that were not taken, for their number of turns


class UniformSample(NamedTuple):
    """Uniform states of S by chain, and whether they can be trusted."""

    states: np.ndarray  # (chains, k, N_c, 2) admissible networks, force
    residual: np.ndarray  # (chains, k) in ⟨f_n⟩, by Ensemble.residual
    violation: np.ndarray  # (chains, k) in ⟨f_n⟩, by Ensemble.violation
    mixing: Mixing  # R̂, bulk and tail effective sample size of each component (NaN if cancelled)
    reached: bool  # complete, all in S, R̂ ≤ MIXED, worth as many independent states as wanted
    counts: dict  # turns, refused paths, dropped states, held coordinates, skipped (h = 0)
    setup_seconds: float  # wall time of the chart
    sampling_seconds: float  # wall time of the steps, those dropped included
    diagnosis_seconds: float  # wall time of the diagnostics
    method: str
    chart: Chart  # the coordinates used
    reach: float  # root mean square distance |u| from the centre, as found in the warm-up
    ends: tuple  # ChainState of each chain, from which it can be continued

    @property
    def effective(self):
        """Smallest bulk or tail effective sample size of any component."""
        return min(self.mixing.least_bulk, self.mixing.least_tail)

    @property
    def flat(self):
        """All states (chains · k, N_c, 2), chain after chain."""
        return self.states.reshape(-1, *self.states.shape[2:])

    @property
    def chain(self):
        """(chains · k,) the chain of each state in `flat`."""
        return np.repeat(np.arange(self.states.shape[0]), self.states.shape[1])


def init(chart, seed):
    """A chain on a random ray from the centre, nine tenths of the way to the wall.

    Chains so start far from each other, which R̂ relies on. seed: as for numpy.random.default_rng.
    """
    rng = np.random.default_rng(seed)
    direction = rng.standard_normal(chart.dimension)
    approach = -(chart.G @ direction).min(initial=0.0)
    return ChainState(0.9 * direction / approach if approach > 0 else direction, rng)


def step(chart, state, *, count, reach, method="billiard"):
    """The next `count` states of a chain: (state, Moves). The given state is left as it was.

    reach: how far states are from the centre (root mean square of |u|), which sets the length of
    the billiard's paths; any fixed number leaves the measure uniform.
    """
    place, rng = state.place.copy(), copy.deepcopy(state.rng)
    slacks = np.ones((count, len(chart.G)))
    turns = refused = 0
    h = chart.dimension
    if h and method == "billiard":
        walls = chart.G, chart.columns, chart.K, chart.turn
        path = PATH * reach, MOST_TURNS * (h + 1), PATHS_PER_STATE
        turns, refused = billiard.billiard(*walls, place, rng, *path, slacks, cancelling.flag())
    elif h:
        moves = MOVES_PER_DIMENSION * h
        billiard.hit_and_run(chart.columns, place, rng, moves, slacks, cancelling.flag())
    cancelling.check("uniform sample")
    return ChainState(place, rng), Moves(slacks, turns, refused)


@cancelling.cancellable
def sample_uniform(
    ensemble,
    states=1000,
    chains=4,
    seed=0,
    *,
    workers=1,
    effective=None,
    method="billiard",
    previous=None,
    progress=None,
    cancel=None,
):
    """At least `states` states of S in all, uniform in its affine hull; a UniformSample.

    chains: independent chains of equal length (states are rounded up to that); workers: threads,
    which change nothing in the result. effective: effective sample size (bulk and tail, of every
    component) that is wanted: more states are drawn, up to MOST_STATES times the larger of both
    numbers, until it is reached; ``reached`` tells whether it was. method: "billiard", or
    "hit_and_run", a slow second witness. previous: a UniformSample of this ensemble to go on with,
    as if it had never ended; its chains and method are taken. progress(done, total) counts states;
    cancel() → True ends early with the states there are; before there is any chart of S it raises
    Cancelled.

    Where S is one point (h = 0) every state is that point and no path is taken. Raises InputError
    for sizes below 1 or forces without bounds, NotJammedError where S is empty.
    """
    if states < 1 or chains < 1 or workers < 1:
        raise InputError("states, chains and workers must be at least 1")
    if effective is not None and not effective > 0:
        raise InputError("the effective sample size that is wanted must be above 0")
    if method not in METHODS:
        raise InputError(f"unknown method {method!r}: take one of {', '.join(METHODS)}")
    sample = previous or _start(ensemble, chains, seed, method, workers)
    most = MOST_STATES * max(states, effective or 0)
    while True:
        sample, complete = _extend(ensemble, sample, states, workers, progress)
        h, done = sample.chart.dimension, len(sample.flat)
        enough = not h or not effective or sample.effective >= effective
        if enough or not complete or done >= most:
            mixed = not h or sample.mixing.worst_r_hat <= MIXED
            return sample._replace(reached=bool(complete and enough and mixed and _inside(sample)))
        growth = 1.1 * effective / max(sample.effective, 1.0)
        states = min(most, int(done * min(2.0, max(1.1, growth))) + 1)


def warm_up(chart, chains, seed, *, method="billiard", workers=1):
    """Chains ready to draw from: (ChainState of each, reach, Moves made and dropped)."""
    ends = tuple(init(chart, one) for one in np.random.SeedSequence(seed).spawn(chains))
    reach, dropped = float(np.sqrt(chart.dimension)), []
    for count in WARM_UP if chart.dimension else ():
        ends, moves = _together(chart, ends, count, reach, method, workers)
        dropped += moves
        # Columns of G are orthonormal: |u| = |s − 1|.
        square = np.mean([np.sum((one.slacks - 1) ** 2, axis=1) for one in moves])
        reach = float(np.sqrt(square))
    return ends, reach, dropped


def _start(ensemble, chains, seed, method, workers):
    """A sample without states yet, its chains warmed up."""
    begin = time.perf_counter()
    A, b, _ = ensemble.scaled_form
    made = chart(A, b, inner_network(ensemble))
    ready = time.perf_counter()
    ends, reach, dropped = warm_up(made, chains, seed, method=method, workers=workers)
    counts = {"turns": 0, "refused": 0, "dropped": sum(len(one.slacks) for one in dropped)}
    counts |= {"held": len(made.centre) - len(made.moving), "skipped": 0}
    nothing = np.zeros((chains, 0))
    return UniformSample(
        states=np.zeros((chains, 0, len(ensemble.index), 2)),
        residual=nothing,
        violation=nothing,
        mixing=None,
        reached=False,
        counts=_counted(counts, dropped),
        setup_seconds=ready - begin,
        sampling_seconds=time.perf_counter() - ready,
        diagnosis_seconds=0.0,
        method=method,
        chart=made,
        reach=reach,
        ends=ends,
    )


def _together(chart, ends, count, reach, method, workers):
    """All chains on by `count` states, over threads: their ends, and the Moves of each."""
    options = {"count": count, "reach": reach, "method": method}
    with cancelling.threads(workers) as pool:
        done = pool.map(lambda end: step(chart, end, **options), ends)
        ends, moves = zip(*done, strict=True)
    return ends, moves


def _counted(counts, moves):
    turns, refused = sum(m.turns for m in moves), sum(m.refused for m in moves)
    return {**counts, "turns": counts["turns"] + turns, "refused": counts["refused"] + refused}


def _extend(ensemble, sample, states, workers, progress):
    """The sample with at least `states` states, diagnosed, and whether it was not cancelled."""
    made, ends, counts = sample.chart, sample.ends, sample.counts
    chains, have = sample.residual.shape
    target = -(-states // chains)
    begin = time.perf_counter()
    parts = [(sample.states, sample.residual, sample.violation)]
    while have < target and not cancelling.cancelled():
        count = min(_ROUND, target - have)
        try:
            ends, moves = _together(made, ends, count, sample.reach, sample.method, workers)
        except Cancelled:
            break
        new = forces_of(ensemble, made, np.stack([one.slacks for one in moves]))
        parts.append((new, ensemble.residual(new), ensemble.violation(new)))
        counts = _counted(counts, moves)
        have += count
        if progress is not None:
            progress(have * chains, target * chains)
    forces, residual, violation = (
        np.concatenate(field, axis=1) for field in zip(*parts, strict=True)
    )
    drawn = time.perf_counter()
    varies = varying(ensemble, made)
    try:
        diagnosis = mixing(forces, varies)
    except Cancelled:
        diagnosis = mixing(forces[:, :0], varies)
    if not made.dimension:
        counts = {**counts, "skipped": forces.shape[0] * forces.shape[1]}
    sample = sample._replace(
        states=forces,
        residual=residual,
        violation=violation,
        mixing=diagnosis,
        counts=counts,
        sampling_seconds=sample.sampling_seconds + drawn - begin,
        diagnosis_seconds=sample.diagnosis_seconds + time.perf_counter() - drawn,
        ends=ends,
    )
    return sample, have >= target and not cancelling.cancelled()


def _inside(sample):
    balanced = sample.residual.max(initial=0.0) <= BALANCED
    return balanced and sample.violation.max(initial=0.0) <= ADMISSIBLE


def forces_of(ensemble, chart, slacks):
    """Forces (…, N_c, 2) of slacks (…, rows)."""
    y = chart.points(slacks)
    T = ensemble.scaled_form[2]
    x = (T @ y.reshape(-1, y.shape[-1]).T).T * ensemble.force_scale
    return ensemble.pin(ensemble.to_forces(x.reshape(*y.shape[:-1], -1)))


def varying(ensemble, chart):
    """Mask (N_c, 2) of components that are not the same in all of S."""
    T = ensemble.scaled_form[2].tocsc()
    slopes = T[:, chart.moving] @ (chart.centre[chart.moving, None] * chart.G[: len(chart.moving)])
    size = norm(T, axis=1)
    return ensemble.to_forces(np.linalg.norm(slopes, axis=1) > FLAT * size) > 0
