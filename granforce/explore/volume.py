"""The volume of S, by a ladder of normal distributions truncated by the walls.

With q = |s − 1|² of the slacks (see `walls`) and Z(β) = ∫_S exp(−½ β q), the volume is Z(0). At
large β walls hardly matter: Z = (2π/β)^(h/2) P, where P is the fraction of independent normal
states in S. From there, steps lead down to β = 0, each so short that the logarithm of the averaged
quantity has a standard deviation of STEP:

    Z(β′)/Z(β) = ⟨exp(½ (β − β′) q)⟩_β = 1/⟨exp(−½ (β − β′) q)⟩_β′

The geometric mean of both removes the bias of either to first order. Draws follow harmonic paths
between the walls (`billiard.fly`) from random speeds w. Near the top of the ladder |w|², which has
a known distribution (χ² with h degrees of freedom), determines most of q: its contribution is
removed (control variates), with slopes from the other ladder. Two ladders use separate chains, one
down from the narrowest distribution and one up from uniform states: if chains were too short to
forget their start, the two would differ.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from granforce import notebook
from granforce.explore import billiard, uniform
from granforce.explore.walls import Walls, walls
from granforce.fields import derived, record
from granforce.forces.ensemble import Ensemble
from granforce.quantities import quantity
from granforce.records import positive, random_seed, takes, worker_count
from granforce.system import cancelling
from granforce.types import Cancel, Floats, Integers, Progress

# Standard deviation of ½ (β − β′) q that determines the steps of the ladder.
STEP = 0.7
# Fraction of independent normal states in S at the top of the ladder; number drawn to choose it,
# and to estimate it.
_INSIDE, _TRIED, _COUNTED = 0.8, 256, 4096
# Smallest standard error that can be requested: the top of the ladder alone contributes 0.008,
# √((1 − _INSIDE)/(_INSIDE _COUNTED)), which more paths do not reduce.
LEAST_ACCURACY = 0.01
# Paths on each rung to find the next one, of which the first are left out of the mean of q.
_PILOT, _FORGOTTEN = 48, 16
# Initial paths on each rung, and number of batches whose scatter gives the error.
_FIRST, _BATCHES = 256, 16
# Number of paths whose speeds are drawn together; after each such batch rounding is corrected.
_BATCH = 32
# Number of rungs over √h, and paths of a rung over those that its step STEP needs if independent,
# as found; they serve only to estimate the work before it is known.
_RUNGS, _INDEPENDENT = 2.5, 0.7
# Rounds of more paths, each at most _GROWTH times as many, until the error is as requested.
_MOST_ROUNDS, _GROWTH = 30, 4.0
# Cost of a path without reflections, in passes over the walls.
_PATH_COST = 20.0
_COUNTS = "turns", "refused"
# Two ladders further apart than this many of their standard errors do not agree.
AGREE = 4.0


@record
class Volume(NamedTuple):
    """The volume of S in its affine hull, forces f_n and f_t of every contact in ⟨f_n⟩."""

    log_volume: Annotated[float, quantity("log_volume", label="log_volume")]
    error: Annotated[float, quantity("log_volume_error", label="error")]
    dimension: Annotated[int, quantity("dimension", label="dimension")]
    per_grain: Annotated[float, quantity("log_volume_per_grain", label="per_grain")]
    ladders: Annotated[Floats, quantity("log_volume_ladders")]
    reached: Annotated[bool, quantity("reached", note="and both ladders agree")]
    counts: Annotated[dict[str, Any], "rungs, paths, turns, rejected paths"]
    seconds: Annotated[float, quantity("seconds")]

    @property
    def shortfall(self) -> str:
        """Why ln V is less accurate than requested, and what to do; empty if it is not."""
        return "" if self.reached else inaccurate(self.error, *self.ladders)

    @property
    @derived(quantity("extent", label="extent"))
    def width(self) -> float:
        """V^(1/h)/√(2πe): width per dimension of the normal distribution of the same entropy."""
        if not self.dimension:
            return 0.0
        return float(np.exp(self.log_volume / self.dimension) / np.sqrt(2 * np.pi * math.e))

    def _repr_html_(self) -> str:
        """HTML for notebooks."""
        lines = {
            "dimension h": self.dimension,
            "ln V": self.log_volume,
            "standard error": self.error,
            "width / ⟨fₙ⟩": self.width,
            "ln V per grain": self.per_grain,
        }
        return notebook.table("Volume of S", lines)


def inaccurate(error: float, one: float, other: float) -> str:
    """A message on ln V with too large an error, or from two ladders that do not agree."""
    return (
        f"ln V is less accurate than requested: its standard error is {error:.3g}, and its two "
        f"estimates are {one:.6g} and {other:.6g}; compare with another seed"
    )


@takes(Ensemble)
@cancelling.cancellable
def volume(
    ensemble: Ensemble,
    *,
    accuracy: float = 0.05,
    seed: int = 0,
    workers: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Volume:
    """ln V of S with a standard error of `accuracy`.

    V is the h-dimensional volume of S in its affine hull, with (f_n, f_t) of every contact in units
    of ⟨f_n⟩; a single point has ln V = 0.

    Parameters
    ----------
    ensemble : Ensemble
        S, bounded.
    accuracy : float, default 0.05
        Standard error of ln V, at least 0.01.
    seed : int, default 0
        Seed of the sampling.
    workers : int, default 1
        Threads. The result does not depend on their number.
    progress : callable, optional
        progress(done, total) counts paths, weighted by their costs; total is an estimate.
    cancel : callable, optional
        Polled; returning True raises Cancelled.

    Returns
    -------
    Volume
        log_volume and its standard error. ``reached``: the error is as requested, and both ladders
        agree.

    Raises
    ------
    InputError
        For an accuracy below 0.01 and unbounded forces.
    NotJammedError
        If S is empty.
    """
    begin = time.perf_counter()
    accuracy, seed = positive(accuracy, "accuracy", least=LEAST_ACCURACY), random_seed(seed)
    workers = worker_count(workers)
    polytope = walls(ensemble)
    grains = max(1, len(ensemble.grains))
    if not polytope.dimension:
        counts = dict.fromkeys(("rungs", "paths", *_COUNTS), 0)
        return Volume(
            log_volume=0.0,
            error=0.0,
            dimension=0,
            per_grain=0.0,
            ladders=np.zeros(2),
            reached=True,
            counts=counts,
            seconds=time.perf_counter() - begin,
        )
    top, log_top, top_variance = _top(polytope, np.random.default_rng([seed, 0]))
    stores = uniform.stores_for(polytope, workers, workers)
    allowed = max(accuracy**2 - top_variance, 0.1 * accuracy**2)
    work = _Work(progress, _foreseen(polytope.dimension, allowed))
    pilots = _climb(polytope, stores[0], top, seed, work)
    cost = _costs(pilots)
    aim = _needed(pilots, _summed(pilots)[1], cost, allowed)
    work.expect(2 * float((np.maximum(aim, _FIRST) * cost).sum()))
    # New paths: those that built the ladder are not used in the result.
    rungs = [
        [rung._replace(q=rung.q[:0], x=rung.x[:0], turns=0, refused=0) for rung in way]
        for way in pilots
    ]
    first = np.full((2, len(cost)), _FIRST)
    rungs = _extended(polytope, stores, rungs, first, cost, work)
    for _ in range(_MOST_ROUNDS):
        ladders, variance = _summed(rungs)
        error = np.sqrt(variance.sum() + top_variance)
        if error <= accuracy:
            break
        cost = _costs(rungs)
        have, aim = _paths_on(rungs), _needed(rungs, variance, cost, allowed)
        work.expect(float((np.maximum(aim - have, 0.05 * have) * cost).sum()))
        more = np.ceil(np.clip(aim - have, 0.05 * have, (_GROWTH - 1) * have)).astype(int)
        rungs = _extended(polytope, stores, rungs, more, cost, work)
    work.expect(0)
    ladders += polytope.units + log_top
    log_volume, two_errors = float(ladders.mean()), 2 * np.sqrt(variance.sum())
    agree = abs(ladders[1] - ladders[0]) <= AGREE * two_errors
    counts = {"rungs": len(rungs[0]), "paths": int(sum(len(r.q) for way in rungs for r in way))}
    counts |= {name: sum(getattr(r, name) for way in rungs for r in way) for name in _COUNTS}
    return Volume(
        log_volume=log_volume,
        error=float(error),
        dimension=polytope.dimension,
        per_grain=log_volume / grains,
        ladders=ladders,
        reached=bool(error <= accuracy and agree),
        counts=counts,
        seconds=time.perf_counter() - begin,
    )


def _top(polytope: Walls, rng: np.random.Generator) -> tuple[float, float, float]:
    """The largest β, ln Z there, and its variance."""

    def reach(count: int) -> Floats:
        # Normal states of β = 1: how far each is outside S, as the β at which it would be on a
        # wall.
        w = polytope.moved(rng.standard_normal((count, polytope.count)))
        return np.maximum(-w.min(axis=1), 0.0) ** 2

    beta = float(np.quantile(reach(_TRIED), _INSIDE))
    inside = 0
    for _ in range(_COUNTED // _TRIED):
        cancelling.check("volume")
        inside += int(np.sum(reach(_TRIED) < beta))
    part = inside / _COUNTED
    log = 0.5 * polytope.dimension * np.log(2 * np.pi / beta) + np.log(part)
    return beta, log, (1 - part) / (part * _COUNTED)


def _foreseen(dimension: int, variance: float) -> float:
    """About how many paths this variance of ln V takes, all rungs together."""
    rungs = _RUNGS * math.sqrt(dimension)
    needed = _INDEPENDENT * (rungs * STEP) ** 2 / variance
    return 2 * rungs * _PILOT + max(2 * rungs * _FIRST, needed)


class _Work:
    """The work on paths for a progress callback; threads share it."""

    def __init__(self, progress: Progress | None, paths: float) -> None:
        """paths: about how many there will be; used until `expect` announces their work."""
        self._progress, self._paths = progress, paths
        self._total = 0.0
        self._done: list[float] = []  # appending needs no lock

    def add_pilots(self, rung: _Rung) -> None:
        """Count the pilots of a rung as done."""
        self._done.append(_PILOT * (rung.turns / len(rung.q) + _PATH_COST))
        self._total = sum(self._done) * self._paths / (_PILOT * len(self._done))
        self._report()

    def expect(self, more: float) -> None:
        """Announce the work that is still to come."""
        self._total = sum(self._done) + more
        self._report()

    def add(self, work: float) -> None:
        """Count work as done."""
        self._done.append(work)
        self._report()

    def _report(self) -> None:
        if self._progress is not None:
            done = sum(self._done)
            self._progress(done, max(done, self._total))


class _Rung(NamedTuple):
    """One chain at one β."""

    beta: float
    reach: float  # √⟨q⟩ nearby: sets the length of paths
    end: uniform.ChainState
    q: Floats  # (paths,) |s − 1|²
    x: Floats  # (paths,) initial β|w|² of the speeds minus its mean, over its standard deviation
    turns: int
    refused: int


def _climb(
    polytope: Walls, rows: billiard.RowStore, top: float, seed: int, work: _Work
) -> list[list[_Rung]]:
    """Rungs of both ladders, each from the narrowest to β = 0, with the first paths of each."""
    down: list[_Rung] = []
    beta, slacks, reach = top, np.ones(polytope.count), float(np.sqrt(polytope.dimension / top))
    while not down or down[-1].beta > 0:
        down.append(_settle(polytope, rows, beta, reach, slacks, [seed, 1, len(down)]))
        work.add_pilots(down[-1])
        q = down[-1].q
        slacks, reach = down[-1].end.slacks, float(np.sqrt(q.mean()))
        spread = max(float(q.std()), 1e-300)
        # Wider distributions have wider q: the last step is short, and none is too long.
        beta = 0.0 if beta * spread < STEP else max(0.5 * beta, beta - 2 * STEP / spread)
    up = []
    for number in range(len(down) - 1, -1, -1):
        beta, reach = down[number].beta, down[number].reach
        up.append(_settle(polytope, rows, beta, reach, slacks, [seed, 2, number]))
        work.add_pilots(up[-1])
        slacks = up[-1].end.slacks
    return [down, up[::-1]]


def _settle(
    polytope: Walls,
    rows: billiard.RowStore,
    beta: float,
    reach: float,
    slacks: Floats,
    seed: list[int],
) -> _Rung:
    """A rung whose chain has forgotten its start, with the paths after that."""
    fresh = _Rung(
        beta=beta,
        reach=reach,
        end=uniform.ChainState(slacks, np.random.default_rng(seed)),
        q=np.zeros(0),
        x=np.zeros(0),
        turns=0,
        refused=0,
    )
    first = _follow_rung(polytope, rows, fresh, _PILOT)
    turns = first.turns * (_PILOT - _FORGOTTEN) // _PILOT
    return first._replace(q=first.q[_FORGOTTEN:], x=first.x[_FORGOTTEN:], turns=turns)


def _follow_rung(polytope: Walls, rows: billiard.RowStore, rung: _Rung, count: int) -> _Rung:
    """The rung with this many more paths, in whole batches."""
    h, beta, end, slack_sums, drawn = polytope.dimension, rung.beta, rung.end, [rung.q], [rung.x]
    counts = np.zeros(2, dtype=np.int64)
    middle = np.ones((1 if beta > 0 else 0, polytope.count))
    for _ in range(0, count, _BATCH):
        speeds, parts = uniform.directions(polytope, end.rng, _BATCH, unit=not beta)
        drawn.append(((speeds**2).sum(axis=1) - (h if beta else 1)) / np.sqrt(2 * h))
        lengths = uniform.PATH * rung.reach * (0.5 + parts)
        if beta > 0:
            # As long as those of uniform states, or a quarter of an oscillation.
            speeds /= np.sqrt(beta)
            lengths = np.minimum(lengths * np.sqrt(beta / h), 0.5 * np.pi)
        (end,), outs, done = uniform.follow_paths(
            polytope, rows, [end], [(speeds, lengths, middle)]
        )
        slack_sums.append(((outs[0] - 1.0) ** 2).sum(axis=1))
        counts += done[0]
    return rung._replace(
        end=end,
        q=np.concatenate(slack_sums),
        x=np.concatenate(drawn),
        turns=rung.turns + int(counts[0]),
        refused=rung.refused + int(counts[1]),
    )


def _summed(rungs: list[list[_Rung]]) -> tuple[Floats, Floats]:
    """ln Z(0)/Z(top) by each ladder (2,), and the variance that each rung adds to their mean."""
    betas = np.array([rung.beta for rung in rungs[0]])
    step = 0.5 * -np.diff(betas)
    sums, variance = np.zeros(2), np.zeros((2, len(betas)))
    for number, both in enumerate(zip(*rungs, strict=True)):
        samples = []
        for way, rung in enumerate(both):
            influence = np.zeros(len(rung.q))
            for k, sign in ((number, 1.0), (number - 1, -1.0)):
                if 0 <= k < len(step):
                    log, weight = _log_mean(sign * step[k] * rung.q)
                    sums[way] += 0.5 * sign * log
                    influence += 0.5 * sign * weight
            samples.append((influence, _controls(rung.x)))
        slopes = [np.linalg.lstsq(x, one - one.mean(), rcond=None)[0] for one, x in samples]
        for way, (influence, x) in enumerate(samples):
            known = x @ slopes[1 - way]
            sums[way] -= known.mean()
            parts = np.array([part.mean() for part in np.array_split(influence - known, _BATCHES)])
            variance[way, number] = 0.25 * parts.var(ddof=1) / _BATCHES
    return sums, variance


def _controls(x: Floats) -> Floats:
    """Numbers (paths, 4) of mean 0 correlated with q, from x of its path and the previous one."""
    before = np.append(0.0, x[:-1])
    return np.stack([x, before, x * before, np.where(x, x * x - 1.0, 0.0)], axis=1)


def _log_mean(values: Floats) -> tuple[float, Floats]:
    """ln ⟨exp⟩ of values, and exp(value)/⟨exp⟩ of each."""
    most = values.max()
    weight = np.exp(values - most)
    mean = weight.mean()
    return most + np.log(mean), weight / mean


def _paths_on(rungs: list[list[_Rung]]) -> Integers:
    """Number of paths (2, rungs)."""
    return np.array([[len(rung.q) for rung in way] for way in rungs])


def _costs(rungs: list[list[_Rung]]) -> Floats:
    """Mean cost (rungs,) of a path."""
    turns = np.array([[rung.turns for rung in way] for way in rungs])
    return np.asarray((turns / _paths_on(rungs) + _PATH_COST).mean(axis=0))


def _needed(rungs: list[list[_Rung]], variance: Floats, cost: Floats, wanted: float) -> Floats:
    """Number of paths (rungs,) for the wanted variance at the least cost."""
    have = _paths_on(rungs)
    # Neighbours are similar, and their mean is less noisy.
    each = np.convolve(
        np.pad((variance * have).mean(axis=0), 2, mode="edge"), np.ones(5) / 5, "valid"
    )
    return np.asarray(np.sqrt(each / cost) * 2 * np.sum(np.sqrt(each * cost)) / (0.95 * wanted))


def _extended(
    polytope: Walls,
    stores: Sequence[Any],
    rungs: list[list[_Rung]],
    more: Integers,
    cost: Floats,
    work: _Work,
) -> list[list[_Rung]]:
    """The rungs with this many more paths each, at this cost per path, on threads."""
    count = len(rungs[0])
    # Neighbours in different threads, as the widest take longest.
    order = [
        (way, k)
        for first in range(len(stores))
        for k in range(first, count, len(stores))
        for way in (0, 1)
    ]
    tasks = [(rungs[way][k], int(more[way, k]), float(cost[k])) for way, k in order]

    def follow_rungs(some: list[tuple[_Rung, int, float]], rows: billiard.RowStore) -> list[_Rung]:
        flying = []
        for rung, number, each in some:
            flying.append(_follow_rung(polytope, rows, rung, number))
            work.add(number * each)
        return flying

    parts = uniform.map_parts(stores, tasks, follow_rungs)
    longer = [list(way) for way in rungs]
    for (way, k), rung in zip(order, itertools.chain(*parts), strict=True):
        longer[way][k] = rung
    return longer
