"""Uniform sampling of S: states of equal density in the affine hull of S, with diagnostics.

Unlike walks that relax kicked forces, these have a known stationary measure, the uniform one (see
`billiard`), for any initial state.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Annotated, Any, NamedTuple, cast

import numpy as np
from scipy.sparse.linalg import norm

from granforce.explore import billiard
from granforce.explore.billiard import RowStore
from granforce.explore.mixing import Mixing, mixing
from granforce.explore.walls import Walls, walls
from granforce.fields import derived, record
from granforce.forces.ensemble import Ensemble
from granforce.numerics import lanes
from granforce.numerics.wall_matrix import PROBES
from granforce.quantities import quantity
from granforce.records import (
    Cancelled,
    InputError,
    brief,
    choice,
    positive,
    random_seed,
    takes,
    whole,
    worker_count,
)
from granforce.system import cancelling
from granforce.system.memory import check_memory
from granforce.tolerances import ADMISSIBLE, BALANCED
from granforce.types import Cancel, Floats, Integers, Mask, Progress

# Mean length of a path in root mean square distances of states from the centre; the cost of an
# effective state has a flat minimum near this.
PATH = 2.0
# Paths between stored states: the effective size of 1000 states is then 400 to 700.
PATHS_PER_STATE = 2
# Number of paths whose directions are drawn together; after each such batch rounding is corrected.
BATCH = lanes.LANES
# Moves of hit-and-run per state and dimension; its chains mix more slowly by about this factor.
MOVES_PER_DIMENSION = 20
# States dropped at the start of each chain; the first part determines the path length of the
# second, which determines the final one. The distance from the centre is stationary after three
# states, so that large S, where a state costs dimension², get fewer.
WARM_UP = 20, 40
WARM_UP_OF_LARGE, LARGE = (5, 10), 2000  # beyond this dimension
# Chains whose R̂ exceeds this have not mixed (Gelman et al., Bayesian Data Analysis, 3rd ed.,
# 11.4); for mixed chains the largest R̂ of 1300 components is 1.01 with 1000 states, 1.06 with 200.
MIXED = 1.1
# Fewer effective states give means with errors above a tenth of a standard deviation.
FEWEST_EFFECTIVE = 100
# With an effective sample size requested, a run ends at this many times as many states.
MOST_STATES = 10
# States of each chain between two calls of progress and cancel.
ROUND = 20

METHODS = ("billiard", "hit_and_run")


class ChainState(NamedTuple):
    """State of a chain: its position and its random stream."""

    slacks: Floats  # (walls,) s
    rng: np.random.Generator
    paths: int = 0  # number of paths so far


# Final chains, their slacks (chains, count, walls) after each path or state, and the numbers of
# reflections and of rejected paths (chains, 2).
Advance = tuple[list[ChainState], Floats, Integers]


@record
class UniformSample(NamedTuple):
    """Uniform states of S by chain, with diagnostics."""

    states: Annotated[Floats, "(chains, k, N_c, 2) admissible networks, force"]
    residual: Annotated[Floats, "(chains, k) in ⟨f_n⟩, by Ensemble.residual"]
    violation: Annotated[Floats, "(chains, k) in ⟨f_n⟩, by Ensemble.violation"]
    mixing: Annotated[Mixing, "R̂ and effective sample sizes of each component (NaN if cancelled)"]
    reached: Annotated[bool, quantity("reached", note="the chains mixed, and all are in S")]
    counts: Annotated[
        dict[str, Any], "turns, rejected paths, dropped, skipped states, held coordinates"
    ]
    setup_seconds: Annotated[float, quantity("setup_seconds")]
    sampling_seconds: Annotated[float, quantity("sampling_seconds", note="of dropped states, too")]
    diagnosis_seconds: Annotated[float, "wall time of the diagnostics, s; NaN if loaded"]
    method: Annotated[str, "billiard or hit_and_run"]
    walls: Annotated[Walls, "the coordinates used; None if loaded"]
    reach: Annotated[float, "root mean square distance |s − 1| from the centre, from the warm-up"]
    ends: Annotated[
        Sequence[ChainState], "of each chain, from which it can be continued; none if loaded"
    ]

    @property
    def effective(self) -> float:
        """Smallest bulk or tail effective sample size of any component."""
        return min(self.mixing.least_bulk, self.mixing.least_tail)

    @property
    def shortfall(self) -> str:
        """Why the sample is not to be relied on, and what to do; empty if it is."""
        if self.counts["skipped"]:
            return ""
        why = unreliable(self.mixing.worst_r_hat, self.effective)
        if not self.reached and not why:
            why = f"the effective sample size is {self.effective:.3g}, less than requested"
        return why and f"the sample is unreliable: {why}; draw more states"

    @property
    @derived(quantity("states", label="states"))
    def flat(self) -> Floats:
        """All states (chains · k, N_c, 2), chain after chain."""
        return self.states.reshape(-1, *self.states.shape[2:])

    @property
    @derived(quantity("chain"))
    def chain(self) -> Integers:
        """(chains · k,) the chain of each state in `flat`."""
        return np.repeat(np.arange(self.states.shape[0]), self.states.shape[1])


def unreliable(worst_r_hat: float, effective: float) -> str:
    """Why states of chains with this R̂ and effective sample size are unreliable; empty if not."""
    if np.isnan(worst_r_hat):
        return "too few states to test whether the chains have mixed"
    if worst_r_hat > MIXED:
        return f"the chains have not mixed (worst R̂ {worst_r_hat:.3g}, above {MIXED:g})"
    if effective < FEWEST_EFFECTIVE:
        return f"the effective sample size is only {effective:.3g} (below {FEWEST_EFFECTIVE})"
    return ""


def init(polytope: Walls, seed: int | np.random.SeedSequence) -> ChainState:
    """A chain on a random ray from the centre, nine tenths of the way to the wall.

    Chains thus start far from each other, as R̂ requires. seed: as for numpy.random.default_rng.
    """
    rng = np.random.default_rng(seed)
    direction = polytope.moved(rng.standard_normal((1, polytope.count)))[0]
    approach = -direction.min(initial=0.0)
    return ChainState(1 + (0.9 / approach if approach > 0 else 1.0) * direction, rng)


def step(
    polytope: Walls,
    ends: Sequence[ChainState],
    rows: RowStore | None = None,
    *,
    count: int,
    reach: float,
    method: str = "billiard",
) -> Advance:
    """The next `count` states of some chains, as slacks for Walls.points.

    The given ChainStates are not changed. rows: store for rows of K. reach: distance of states from
    the centre (root mean square of |s − 1|), which sets the length of the billiard's paths; any
    fixed number leaves the measure uniform.
    """
    if method == "hit_and_run":
        return run_chains(polytope, ends, count, 1, lambda ends, left: _chords(polytope, ends))
    rows = rows or billiard.room_for_rows(polytope.count)
    straight = np.ones((0, polytope.count))

    def advance(ends: list[ChainState], left: int) -> Advance:
        paths = min(left, BATCH - ends[0].paths % BATCH)
        drawn = [directions(polytope, end.rng, paths) for end in ends]
        paths_of = [(speeds, PATH * reach * (0.5 + parts), straight) for speeds, parts in drawn]
        return follow_paths(polytope, rows, ends, paths_of)

    return run_chains(polytope, ends, count, PATHS_PER_STATE, advance)


def run_chains(
    polytope: Walls,
    ends: Sequence[ChainState],
    count: int,
    paths: int,
    advance: Callable[[list[ChainState], int], Advance],
) -> Advance:
    """The next `count` states of some chains, `paths` paths apart, in the format of `step`.

    advance(chains, left): advances each chain by some paths, at most `left`.
    """
    chains, left = [end._replace(rng=copy.deepcopy(end.rng)) for end in ends], count * paths
    counts = np.zeros((len(chains), 2), dtype=int)
    path_ends: list[Floats] = []
    while left and polytope.dimension:
        chains, slacks, new = advance(chains, left)
        path_ends.append(slacks)
        counts += new
        left -= slacks.shape[1]
    if not path_ends:
        return chains, np.ones((len(chains), count, polytope.count)), counts
    states = np.concatenate(path_ends, axis=1)[:, paths - 1 :: paths]
    return chains, np.stack([polytope.on_hull(s) for s in states]), counts


def follow_paths(
    polytope: Walls, rows: RowStore, ends: Sequence[ChainState], paths: Sequence[Any]
) -> Advance:
    """Advance chains by a batch of paths; paths: speeds, times and middles (`billiard.fly`)."""
    slacks, path_ends, counts = billiard.follow(
        polytope.rows, polytope.dimension, rows, [end.slacks for end in ends], paths
    )
    done = ends[0].paths + path_ends.shape[1]
    if done % BATCH == 0:
        slacks = polytope.on_hull(slacks)
    ends = [ChainState(s, end.rng, done) for s, end in zip(slacks, ends, strict=True)]
    return ends, path_ends, counts


def directions(
    polytope: Walls, rng: np.random.Generator, count: int, unit: bool = True
) -> tuple[Floats, Floats]:
    """Speeds (count, walls) of covariance K, or its uniform directions, and numbers in [0, 1]."""
    g, parts = np.empty((count, polytope.count)), np.empty(count)
    for path in range(count):
        g[path], parts[path] = rng.standard_normal(polytope.count), rng.random()
    speeds = polytope.moved(g)
    if not unit:
        return speeds, parts
    return speeds / np.sqrt((speeds * speeds).sum(axis=1, keepdims=True)), parts


def _chords(polytope: Walls, ends: list[ChainState]) -> Advance:
    """Advance chains by one state of hit-and-run."""
    slacks, moves = np.stack([end.slacks for end in ends]), MOVES_PER_DIMENSION * polytope.dimension
    for s, end in zip(slacks, ends, strict=True):
        for first in range(0, moves, BATCH):
            cancelling.check("uniform sample")
            billiard.chords(*directions(polytope, end.rng, min(BATCH, moves - first)), s)
    pairs = zip(ends, polytope.on_hull(slacks), strict=True)
    ends = [end._replace(slacks=s) for end, s in pairs]
    return ends, slacks[:, None], np.zeros((len(ends), 2), dtype=int)


@takes(Ensemble, previous=UniformSample)
@cancelling.cancellable
def sample_uniform(
    ensemble: Ensemble,
    states: int = 1000,
    chains: int = 4,
    seed: int = 0,
    *,
    workers: int = 1,
    effective: float | None = None,
    method: str = "billiard",
    previous: UniformSample | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> UniformSample:
    """At least `states` states of S in all, uniform in its affine hull.

    If S is one point (h = 0), every state is that point.

    Parameters
    ----------
    ensemble : Ensemble
        S, bounded.
    states : int, default 1000
        Least number of states of all chains together.
    chains : int, default 4
        Independent chains of equal length (states are rounded up to that).
    seed : int, default 0
        Seed of all chains.
    workers : int, default 1
        Threads. The result does not depend on their number.
    effective : float, optional
        Requested effective sample size (bulk and tail, of every component): more states are drawn,
        up to 10 times the larger of both numbers, until it is reached. ``reached`` shows whether it
        was.
    method : {"billiard", "hit_and_run"}
        Hit-and-run is a slow independent check.
    previous : UniformSample, optional
        A sample of this ensemble to continue, drawn with the same chains, seed and method.
    progress : callable, optional
        progress(done, total) counts states.
    cancel : callable, optional
        Polled; returning True ends early with the states so far, or raises Cancelled before
        sampling has begun.

    Returns
    -------
    UniformSample
        states (chains, k, N_c, 2), force, with diagnostics.

    Raises
    ------
    InputError
        For sizes below 1, unbounded forces, and a previous sample with other arguments.
    NotJammedError
        If S is empty.
    Cancelled
        If cancelled before the first state.
    """
    states, chains = whole(states, "states", 1), whole(chains, "chains", 1)
    workers, seed = worker_count(workers), random_seed(seed)
    if effective is not None:
        effective = positive(effective, "the effective sample size")
    most = max(states, chains, effective or 0)
    check_memory(16 * most * len(ensemble.index), f"{most:.9g} states")
    method = choice(method, METHODS, "method")
    if previous is None:
        sample, stores = _start(ensemble, chains, seed, method, workers)
    else:
        ensemble.refuse_foreign(previous.states, previous.residual, "the sample to continue")
        _check_same(previous, chains, seed, method)
        sample, stores = previous, stores_for(previous.walls, len(previous.ends), workers)
    most = MOST_STATES * max(states, effective or 0)
    while True:
        sample, complete = _extend(ensemble, sample, stores, states, progress)
        h, done = sample.walls.dimension, len(sample.flat)
        enough = not h or not effective or sample.effective >= effective
        if enough or not complete or done >= most:
            mixed = not h or sample.mixing.worst_r_hat <= MIXED
            good = (
                complete and enough and mixed and are_admissible(sample.residual, sample.violation)
            )
            counts = sample.counts | {"skipped": 0 if h else done}
            return sample._replace(reached=bool(good), counts=counts)
        growth = 1.1 * (effective or 0.0) / max(sample.effective, 1.0)
        states = int(min(most, int(done * min(2.0, max(1.1, growth))) + 1))


def _check_same(previous: UniformSample, chains: int, seed: int, method: str) -> None:
    """InputError unless a sample was drawn with these arguments, and has ends to go on from."""
    if not previous.ends:
        raise InputError("a sample from a store cannot be continued: ask for more states")
    streams: Any = previous.ends[0].rng.bit_generator.seed_seq
    drawn = {
        "chains": (len(previous.ends), chains),
        "seed": (streams.entropy, seed),
        "method": (previous.method, method),
    }
    for name, (former, requested) in drawn.items():
        if former != requested:
            raise InputError(
                f"the sample to continue was drawn with {name} = {brief(former)}, "
                f"not {brief(requested)}; give the same arguments"
            )


def start_chains(polytope: Walls, chains: int, seed: int) -> list[ChainState]:
    """Initial states of the chains, each with its own random stream."""
    return [init(polytope, child) for child in np.random.SeedSequence(seed).spawn(chains)]


def warm_up_states(dimension: int) -> tuple[int, ...]:
    """States of each chain dropped in the parts of the warm-up."""
    return () if not dimension else WARM_UP_OF_LARGE if dimension > LARGE else WARM_UP


def warm_up(
    polytope: Walls, chains: int, seed: int, stores: Sequence[RowStore], *, method: str = "billiard"
) -> tuple[list[ChainState], float, Integers]:
    """Chains ready to draw from: (ChainState of each, reach, turns and rejected paths of each)."""
    ends, counts = start_chains(polytope, chains, seed), np.zeros((chains, 2), dtype=int)
    reach = float(np.sqrt(polytope.dimension))
    for count in warm_up_states(polytope.dimension):
        advance = partial(step, polytope, count=count, reach=reach, method=method)
        ends, slacks, done = advance_all(stores, ends, advance)
        counts += done
        reach = float(np.sqrt(np.mean(np.sum((slacks - 1) ** 2, axis=2))))
    return ends, reach, counts


def stores_for(polytope: Walls, chains: int, workers: int) -> list[RowStore]:
    """Rows of K for each thread: shared if they fit, otherwise in parts of the memory."""
    threads, whole = min(workers, chains), billiard.room_for_rows(polytope.count)
    if whole.whole:
        return [whole] * threads
    return [billiard.room_for_rows(polytope.count, 1 / threads) for _ in range(threads)]


def map_parts(
    stores: Sequence[RowStore], tasks: Sequence[Any], work: Callable[[list[Any], RowStore], Any]
) -> list[Any]:
    """work(some tasks, rows) of consecutive parts of the tasks, each in a thread with its store."""
    parts = np.array_split(np.arange(len(tasks)), len(stores))
    with cancelling.threads(len(stores)) as pool:
        return list(pool.map(work, [[tasks[k] for k in part] for part in parts], stores))


def advance_all(
    stores: Sequence[RowStore],
    ends: Sequence[ChainState],
    advance: Callable[[list[Any], RowStore], Advance],
) -> Advance:
    """advance(some chains, rows) for all chains, on threads."""
    parts, slacks, counts = zip(*map_parts(stores, ends, advance), strict=True)
    return [end for part in parts for end in part], np.concatenate(slacks), np.concatenate(counts)


def draw_states(
    ensemble: Ensemble,
    polytope: Walls,
    stores: Sequence[RowStore],
    ends: Sequence[ChainState],
    advance: Callable[..., Advance],
    have: int,
    target: int,
    progress: Progress | None,
) -> tuple[Sequence[ChainState], Floats, Integers]:
    """Final chains, forces (chains, k, N_c, 2) of new states, and their counts (chains, 2).

    Each chain has `have` states, and gets more up to the target, or until the work is cancelled.
    advance(some chains, rows, count=…): as `step`.
    """
    chunks = [np.zeros((len(ends), 0, len(ensemble.index), 2))]
    counts = np.zeros((len(ends), 2), dtype=int)
    with suppress(Cancelled):
        while have < target:
            cancelling.check("uniform sample")
            count = min(ROUND, target - have)
            ends, slacks, done = advance_all(stores, ends, partial(advance, count=count))
            chunks.append(forces_of(ensemble, polytope, slacks))
            counts, have = counts + done, have + count
            if progress is not None:
                progress(have * len(ends), target * len(ends))
    return ends, np.concatenate(chunks, axis=1), counts


def add_counts(counts: dict[str, Any], done: Integers) -> dict[str, Any]:
    """Counts with turns and rejected paths (chains, 2) added."""
    turns, refused = done.sum(axis=0).tolist()
    return counts | {"turns": counts["turns"] + turns, "refused": counts["refused"] + refused}


def _start(
    ensemble: Ensemble, chains: int, seed: int, method: str, workers: int
) -> tuple[UniformSample, list[RowStore]]:
    """A sample without states yet, its chains warmed up, and rows of K for each thread."""
    begin = time.perf_counter()
    polytope = walls(ensemble)
    ready = time.perf_counter()
    stores = stores_for(polytope, chains, workers)
    ends, reach, done = warm_up(polytope, chains, seed, stores, method=method)
    dropped = chains * sum(warm_up_states(polytope.dimension))
    counts = {"turns": 0, "refused": 0, "dropped": dropped}
    nothing = np.zeros((chains, 0))
    sample = UniformSample(
        states=np.zeros((chains, 0, len(ensemble.index), 2)),
        residual=nothing,
        violation=nothing,
        mixing=cast("Mixing", None),  # until there are states
        reached=False,
        counts=add_counts(counts | {"held": len(polytope.centre) - len(polytope.moving)}, done),
        setup_seconds=ready - begin,
        sampling_seconds=time.perf_counter() - ready,
        diagnosis_seconds=0.0,
        method=method,
        walls=polytope,
        reach=reach,
        ends=ends,
    )
    return sample, stores


def _extend(
    ensemble: Ensemble,
    sample: UniformSample,
    stores: Sequence[RowStore],
    states: int,
    progress: Progress | None,
) -> tuple[UniformSample, bool]:
    """The sample with at least `states` states, diagnosed, and whether it was not cancelled."""
    polytope, (chains, have) = sample.walls, sample.residual.shape
    target = -(-states // chains)
    begin = time.perf_counter()
    advance = partial(step, polytope, reach=sample.reach, method=sample.method)
    ends, new, done = draw_states(
        ensemble, polytope, stores, sample.ends, advance, have, target, progress
    )
    forces = np.concatenate([sample.states, new], axis=1)
    ready = time.perf_counter()
    varies = varying_components(ensemble, polytope)
    try:
        diagnosis = mixing(forces, varies)
    except Cancelled:
        diagnosis = mixing(forces[:, :0], varies)
    sample = sample._replace(
        states=forces,
        residual=ensemble.residual(forces),
        violation=ensemble.violation(forces),
        mixing=diagnosis,
        counts=add_counts(sample.counts, done),
        sampling_seconds=sample.sampling_seconds + ready - begin,
        diagnosis_seconds=sample.diagnosis_seconds + time.perf_counter() - ready,
        ends=ends,
    )
    return sample, forces.shape[1] >= target and not cancelling.cancelled()


def are_admissible(residual: Floats, violation: Floats) -> bool:
    """Whether all states are in S, by residual and violation."""
    return bool(np.all(residual <= BALANCED) and np.all(violation <= ADMISSIBLE))


def forces_of(ensemble: Ensemble, polytope: Walls, slacks: Floats) -> Floats:
    """Forces (…, N_c, 2) of slacks (…, walls)."""
    y = polytope.points(slacks)
    T = ensemble.scaled_form[2]
    x = (T @ y.reshape(-1, y.shape[-1]).T).T * ensemble.force_scale
    return ensemble.pin(ensemble.to_forces(x.reshape(*y.shape[:-1], -1)))


def varying_components(ensemble: Ensemble, polytope: Walls) -> Mask:
    """Mask (N_c, 2) of components that vary in S, from random changes.

    Changes count if they exceed a tenth of the resolution of S. The random numbers are always the
    same.
    """
    T = ensemble.scaled_form[2].tocsc()
    g = np.random.default_rng(0).standard_normal((PROBES, polytope.count))
    relative = polytope.moved(g)[:, : len(polytope.moving)]
    change = T[:, polytope.moving] @ (polytope.centre[polytope.moving] * relative).T
    least = 0.1 * ensemble.hull.resolution * norm(T, axis=1) * np.sqrt(PROBES)
    return ensemble.to_forces(np.linalg.norm(change, axis=1) > least) > 0
