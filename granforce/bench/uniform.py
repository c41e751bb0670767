"""Uniform sampling of S: processor time per effective state, against hopsy where it is installed.

hopsy (pip install hopsy) is optional: it brings GLPK, and is used for nothing else.
"""

import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy import linalg

from granforce.bench.report import note
from granforce.explore.billiard import all_rows
from granforce.explore.mixing import Mixing, mixing
from granforce.explore.uniform import METHODS, forces_of, step, varying, warm_up
from granforce.explore.walls import walls
from granforce.forces.ensemble import ensemble
from granforce.packing.compaction import pack

# Dimension up to which hopsy's own rounding, which takes 40 s at h = 43 and 126 s at 79, is waited
# for. Beyond it hopsy gets our rounding only.
MOST_ROUNDED = 60
STATES = 1000
HOPSY_STATES = 600


def uniform(quick=True, *, n=None, frictions=None, seed=1, rounded=None):
    """Rows: seconds of processor time per effective state (bulk, minimum over components).

    Four chains in one thread, warm-up included; set-up (centre, factor, rows of K) apart.
    ratio: that cost over the billiard's. z_mean and z_square: root mean square, over components, of
    the differences of means and of second moments from the billiard's in standard errors: near 1
    where both sample the same measure. null_space_ratio: a dense null space of the balance (QR with
    pivoting), which sampling did without, over the whole set-up. two_cores: wall time
    of one thread over that of two.
    """
    n = n or (100 if quick else 400)
    frictions = frictions or ((0.1, 1.0) if quick else (0.5, 0.3, 0.1, 0.01))
    rounded = rounded if rounded is not None else (0 if quick else MOST_ROUNDED)
    rows = []
    for mu in frictions:
        S = ensemble(pack(n, mu, seed))
        walls(S)  # the first time it is compiled
        begin = time.process_time()
        made = walls(S)
        kept = all_rows(made)
        setup = time.process_time() - begin
        runs = [_ours(S, made, kept, method, seed) for method in METHODS]
        runs += _hopsy(S, made, kept, rounded)
        for run in runs:
            rows.append(_row({"n": n, "mu": mu, "h": made.dimension}, S, runs[0], run, setup))
        rows[-len(runs)]["two_cores"] = _two_cores(made, kept, seed)
        rows[-len(runs)]["null_space_ratio"] = _null_space(S, made) / setup
    return rows


class _Run(NamedTuple):
    method: str
    states: np.ndarray | None  # (chains, k, N_c, 2), None where it could not be run
    mixing: Mixing | None
    seconds: float  # processor time of the steps
    setup: float  # processor time of what had to be done before, the walls left out
    note: str = ""


def _row(start, S, first, run, setup):
    if run.states is None:
        return start | {"method": run.method, "note": run.note}
    cost, least = (one.seconds / one.mixing.least_bulk for one in (run, first))
    row = start | {"method": run.method, "seconds_per_state": cost, "ratio": cost / least}
    row |= {"effective": run.mixing.least_bulk, "r_hat": run.mixing.worst_r_hat}
    row |= {"seconds": run.seconds, "setup_seconds": setup + run.setup}
    if run is not first:
        row["z_mean"], row["z_square"] = _agreement(S, first, run)
    return row


def _ours(S, made, kept, method, seed):
    note(f"uniform: h = {made.dimension}, {method}")
    for count in (1, STATES // 4):  # the first time it is compiled
        begin = time.process_time()
        own = seed + METHODS.index(method)
        ends, reach, _ = warm_up(made, 4, own, method=method, stores=[kept])
        _, done = step(made, ends, count=count, reach=reach, rows=kept, method=method)
        seconds = time.process_time() - begin
    states = forces_of(S, made, np.array([one.slacks for one in done]))
    return _Run(method, states, mixing(states, varying(S, made)), seconds, 0.0)


def _null_space(S, made):
    """Seconds of processor time of the QR that gives the same K by a dense null space."""
    weighted = S.scaled_form[0].tocsc()[:, made.moving].toarray() * made.centre[made.moving]
    begin = time.process_time()
    linalg.qr(weighted.T, pivoting=True)
    return time.process_time() - begin


def _two_cores(made, kept, seed):
    wall = []
    ends, reach, _ = warm_up(made, 2, seed, stores=[kept])
    for workers in (1, 2):
        begin = time.perf_counter()
        with ThreadPoolExecutor(workers) as pool:
            on = partial(step, made, count=STATES, reach=reach, rows=kept)
            list(pool.map(on, [[end] for end in ends]))
        wall.append(time.perf_counter() - begin)
    return wall[0] / wall[1]


def _hopsy(S, made, kept, rounded):
    """Coordinate hit-and-run by hopsy, its best walk, on our rounding and, up to `rounded`, its.

    It wants coordinates: those of an orthonormal basis of what K projects on.
    """
    try:
        import hopsy
    except ImportError:
        return [_Run("hopsy", None, None, 0.0, 0.0, "not installed")]
    h, count = made.dimension, len(made.moving)
    sides = -np.linalg.eigh(kept.values[:count, :count])[1][:, count - h :]
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
        begin = time.process_time()
        _, places = hopsy.sample(chains, streams, HOPSY_STATES // 4, thinning=thinning)
        seconds = time.process_time() - begin
        slacks = np.ones((*places.shape[:2], made.count))
        slacks[..., :count] -= places @ sides.T
        states = forces_of(S, made, slacks)[:, places.shape[1] // 10 :]  # warm-up
        runs.append(_Run(name, states, mixing(states, varying(S, made)), seconds, setup))
    return runs


def _agreement(S, one, two):
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
