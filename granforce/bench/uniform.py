"""Uniform sampling of S: processor time per effective state, against hopsy if installed.

hopsy (pip install hopsy) is optional: it depends on GLPK, and is used only here.
"""

import time
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from granforce.bench.runner import Row, growth_of, note, packings, peak_megabytes, tile, tilings
from granforce.explore.billiard import make_rows, room_for_rows
from granforce.explore.mixing import Mixing, mixing
from granforce.explore.uniform import (
    METHODS,
    forces_of,
    sample_uniform,
    step,
    varying_components,
    warm_up,
)
from granforce.explore.walls import walls
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.numerics.lanes import LANES
from granforce.packing.compaction import pack
from granforce.system.clock import timed
from granforce.types import Floats

# Largest dimension for hopsy's own rounding, which takes 40 s at h = 43 and 126 s at 79. Beyond it
# hopsy gets only granforce's rounding.
MOST_ROUNDED = 60
NAMES = dict(zip(METHODS, ("billiard", "coordinate hit-and-run"), strict=True))  # in tables
STATES = 1000
HOPSY_STATES = 600
# States per chain to time a way of storing rows, after as many that fill the store.
_TIMED = 2
# Where rows of K are stored, as fractions of `billiard.MEMORY`.
ROOMS = {"16 rows at a time": 0.0, "rows within the memory": 1.0, "all rows kept": 1e3}


def uniform(
    n: int = 400,
    frictions: Sequence[float] = (0.5, 0.3, 0.1, 0.01),
    seed: int = 1,
    rounded: int = MOST_ROUNDED,
) -> list[Row]:
    """Rows: seconds of processor time per effective state (bulk, minimum over components).

    Four chains in one thread, including warm-up, without set-up (centre, factor, rows of K). ratio:
    that cost over the billiard's. z_mean and z_square: root mean square, over components, of the
    differences of means and of second moments from the billiard's in standard errors: near 1 if
    both sample the same measure.
    """
    rows = []
    for case, S in packings("uniform", n, frictions, seed):
        walls(S)  # compile
        setup, (polytope, stored_rows) = timed(_set_up, S, clock=time.process_time)
        runs = [_ours(S, polytope, stored_rows, method, seed) for method in METHODS]
        runs += _hopsy(S, polytope, stored_rows, rounded)
        case = case | {"h": polytope.dimension}
        rows += [_row(case, S, runs[0], run, setup) for run in runs]
    return rows


class _Run(NamedTuple):
    method: str  # its name in tables
    states: Floats | None  # (chains, k, N_c, 2), None if it could not run
    mixing: Mixing | None
    seconds: float  # processor time of the steps
    setup: float  # processor time of the preparation, without the walls
    note: str = ""


def _row(case: Row, S: Ensemble, first: _Run, run: _Run, setup: float) -> Row:
    if run.mixing is None or first.mixing is None:
        return case | {"method": run.method, "note": run.note}
    cost = run.seconds / run.mixing.least_bulk
    least = first.seconds / first.mixing.least_bulk
    row = case | {"method": run.method, "seconds_per_state": cost, "ratio": cost / least}
    row |= {"effective": run.mixing.least_bulk, "r_hat": run.mixing.worst_r_hat}
    row |= {"seconds": run.seconds, "setup_seconds": setup + run.setup}
    if run is not first:
        row["z_mean"], row["z_square"] = _agreement(S, first, run)
    return row


def _ours(S: Ensemble, polytope: Any, rows: Any, method: str, seed: int) -> _Run:
    note(f"uniform: h = {polytope.dimension}, {method}")
    for count in (1, STATES // 4):  # the first call compiles
        begin = time.process_time()
        seed_of_method = seed + METHODS.index(method)
        ends, reach, _ = warm_up(polytope, 4, seed_of_method, [rows], method=method)
        _, slacks, _ = step(polytope, ends, count=count, reach=reach, rows=rows, method=method)
        seconds = time.process_time() - begin
    states = forces_of(S, polytope, slacks)
    return _Run(
        NAMES[method], states, mixing(states, varying_components(S, polytope)), seconds, 0.0
    )


def uniform_growth(
    n: int = 400,
    mu: float = 0.1,
    tiles: Sequence[int] = (1, 2, 4),
    effective: int = 100,
    seed: int = 1,
) -> list[Row]:
    """Rows: cost of an effective state against the number of disks, with one packing repeated.

    reached: whether `effective` states (bulk and tail, of every component) were drawn, in `seconds`
    of processor time, including set-up, warm-up and diagnosis; peak_MB: largest memory of the
    process until then. seconds_per_state: processor time per further effective state, by where rows
    of K are stored, which does not change the states. setup_seconds: centre, factor and, if there
    is room, rows of K. seconds_of_eight: processor time of eight networks, warm-up included.
    """
    base = ensemble(pack(n, mu, seed))
    sample_uniform(ensemble(tile(base, 1), prune=False), 8)  # compiles
    rows = []
    for case, S in tilings("uniform", base, tiles):
        setup, (polytope, _) = timed(_set_up, S, clock=time.process_time)
        settings: dict[str, Any] = {"seed": seed, "effective": effective}
        seconds, sample = timed(sample_uniform, S, effective, clock=time.process_time, **settings)
        row: Row = {
            "h": polytope.dimension,
            "walls": polytope.count,
            "states": len(sample.flat),
            "effective": sample.effective,
            "reached": sample.reached,
            "seconds": seconds,
            "peak_MB": peak_megabytes(),
            "setup_seconds": setup,
            "seconds_of_eight": timed(sample_uniform, S, 8, seed=seed, clock=time.process_time)[0],
        }
        worth = sample.effective / len(sample.flat)
        for place, part in ROOMS.items():
            cost = case | {"rows": place, "seconds_per_state": _going_on(sample, part) / worth}
            rows.append(cost | row if part == 1.0 else cost)
    fits = {
        place: growth_of([r for r in rows if r["rows"] == place], "seconds_per_state")
        for place in ROOMS
    }
    return rows + [{"n": "fit", "rows": place, "exponent": fit} for place, fit in fits.items()]


def _set_up(S: Ensemble) -> tuple[Any, Any]:
    polytope = walls(S)
    return polytope, _all_rows(polytope, 1.0)


def _all_rows(polytope: Any, part: float) -> Any:
    """All rows of K if they fit into a fraction of the memory, otherwise none."""
    rows = room_for_rows(polytope.count, part)
    if rows.whole:
        for first in range(0, len(polytope.moving), LANES):
            make_rows(
                polytope.rows, rows.cache, range(first, min(first + LANES, len(polytope.moving)))
            )
    return rows


def _going_on(sample: Any, part: float) -> Any:
    """Seconds of processor time per state, with a fraction of the memory meant for rows of K."""
    polytope, ends, rows = sample.walls, sample.ends, _all_rows(sample.walls, part)
    for _ in range(2):
        begin = time.process_time()
        ends, *_ = step(polytope, ends, count=_TIMED, reach=sample.reach, rows=rows)
        seconds = time.process_time() - begin
    return seconds / (_TIMED * len(ends))


def _hopsy(S: Ensemble, polytope: Any, rows: Any, rounded: int) -> list[_Run]:
    """Coordinate hit-and-run by hopsy, its best walk, on two roundings.

    One is granforce's; the other, up to dimension `rounded`, is hopsy's own. hopsy needs
    coordinates: those of an orthonormal basis of the range of K.
    """
    try:
        import hopsy
    except ImportError:
        return [_Run("hopsy", None, None, seconds=0.0, setup=0.0, note="not installed")]
    h, count = polytope.dimension, len(polytope.moving)
    sides = -np.linalg.eigh(rows.values[:count, :count])[1][:, count - h :]
    begin = time.process_time()
    problems = {"hopsy, our rounding": (hopsy.Problem(sides, np.ones(count)), 0.0)}
    if h <= rounded:
        note(f"uniform: h = {h}, hopsy rounds")
        problem = hopsy.round(hopsy.Problem(sides, np.ones(count)))
        problems["hopsy, its rounding"] = (problem, time.process_time() - begin)
    runs = []
    for name, (problem, setup) in problems.items():
        note(f"uniform: h = {h}, {name}")
        start = hopsy.compute_chebyshev_center(problem) if setup else np.zeros(h)
        proposal = hopsy.UniformCoordinateHitAndRunProposal
        chains = [hopsy.MarkovChain(problem, proposal, starting_point=start) for _ in range(4)]
        streams = [hopsy.RandomNumberGenerator(1, k) for k in range(4)]
        thinning = h * max(8, h // 6)
        sample = partial(hopsy.sample, chains, streams, HOPSY_STATES // 4, thinning=thinning)
        seconds, (_, places) = timed(sample, clock=time.process_time)
        slacks = np.ones((*places.shape[:2], polytope.count))
        slacks[..., :count] -= places @ sides.T
        states = forces_of(S, polytope, slacks)[:, places.shape[1] // 10 :]  # warm-up
        runs.append(
            _Run(name, states, mixing(states, varying_components(S, polytope)), seconds, setup)
        )
    return runs


def _agreement(S: Ensemble, one: Any, two: Any) -> list[float]:
    """Root mean square z-scores of the means and second moments of all components that vary."""
    varies = ~np.isnan(one.mixing.bulk)
    centre = one.states.mean(axis=(0, 1))
    answers = []
    for power in (1, 2):
        total, error = 0.0, 0.0
        for run, sign in ((one, 1), (two, -1)):
            values = ((run.states - centre) / S.force_scale)[:, :, varies] ** power
            total = total + sign * values.mean(axis=(0, 1))
            error = error + values.var(axis=(0, 1)) / run.mixing.bulk[varies]
        answers.append(float(np.sqrt(np.mean(total**2 / error))))
    return answers
