"""Uniform sampling of S: processor time per effective state, against hopsy where it is installed.

hopsy (pip install hopsy) is optional: it brings GLPK, and is used for nothing else.
"""

import time
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from granforce.bench.report import note
from granforce.explore.chart import chart
from granforce.explore.mixing import Mixing, mixing
from granforce.explore.uniform import METHODS, forces_of, step, varying, warm_up
from granforce.forces.contact_problem import inner_network
from granforce.forces.ensemble import ensemble
from granforce.packing.compaction import pack

# Dimension up to which hopsy's own rounding, which takes 40 s at h = 43 and 126 s at 79, is waited
# for. Beyond it hopsy gets our rounding only.
MOST_ROUNDED = 60
STATES = 1000
HOPSY_STATES = 600


def uniform(quick=True, *, n=None, frictions=None, seed=1, rounded=None):
    """Rows: seconds of processor time per effective state (bulk, minimum over components).

    Four chains one after another, warm-up included; set-up (affine hull, centre, rounding) apart.
    ratio: that cost over the billiard's. z_mean and z_square: root mean square, over components, of
    the differences of means and of second moments from the billiard's in standard errors: near 1
    where both sample the same measure. two_cores: wall time of one thread over that of two.
    """
    n = n or (100 if quick else 400)
    frictions = frictions or ((0.1, 1.0) if quick else (0.5, 0.3, 0.1, 0.01))
    rounded = rounded if rounded is not None else (0 if quick else MOST_ROUNDED)
    rows = []
    for mu in frictions:
        S = ensemble(pack(n, mu, seed))
        begin = time.process_time()
        made = chart(*S.scaled_form[:2], inner_network(S))
        setup = time.process_time() - begin
        runs = [_ours(S, made, method, seed) for method in METHODS]
        runs += _hopsy(S, made, rounded)
        for run in runs:
            rows.append(_row({"n": n, "mu": mu, "h": made.dimension}, S, runs[0], run, setup))
        rows[-len(runs)]["two_cores"] = _two_cores(made, seed)
    return rows


class _Run(NamedTuple):
    method: str
    states: np.ndarray | None  # (chains, k, N_c, 2), None where it could not be run
    mixing: Mixing | None
    seconds: float  # processor time of the steps
    setup: float  # processor time of what had to be done before, the chart left out
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


def _ours(S, made, method, seed):
    note(f"uniform: h = {made.dimension}, {method}")
    for count in (1, STATES // 4):  # the first time it is compiled
        begin = time.process_time()
        ends, reach, _ = warm_up(made, 4, seed + METHODS.index(method), method=method)
        options = {"count": count, "reach": reach, "method": method}
        done = [step(made, end, **options)[1].slacks for end in ends]
        seconds = time.process_time() - begin
    states = forces_of(S, made, np.array(done))
    return _Run(method, states, mixing(states, varying(S, made)), seconds, 0.0)


def _two_cores(made, seed):
    wall = []
    ends, reach, _ = warm_up(made, 2, seed)
    for workers in (1, 2):
        begin = time.perf_counter()
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(lambda end: step(made, end, count=STATES, reach=reach), ends))
        wall.append(time.perf_counter() - begin)
    return wall[0] / wall[1]


def _hopsy(S, made, rounded):
    """Coordinate hit-and-run by hopsy, its best walk, on our rounding and, up to `rounded`, its."""
    try:
        import hopsy
    except ImportError:
        return [_Run("hopsy", None, None, 0.0, 0.0, "not installed")]
    h, walls = made.dimension, -made.G[: len(made.moving)]
    begin = time.process_time()
    problems = {"hopsy, our rounding": (hopsy.Problem(walls, np.ones(len(walls))), 0.0)}
    if h <= rounded:
        note(f"uniform: h = {h}, hopsy rounds")
        problem = hopsy.round(hopsy.Problem(walls, np.ones(len(walls))))
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
        slacks = np.ones((*places.shape[:2], len(made.G)))
        slacks[..., : len(walls)] -= places @ walls.T
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
