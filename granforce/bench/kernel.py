"""The solver on S compared with the machine's limits and PIQP, and against the number of disks."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from granforce.bench.runner import Row, growth_of, kicked, packings, peak_megabytes, tilings
from granforce.bench.solvers import FRICTIONS
from granforce.explore.intervals import intervals, limit_loads
from granforce.forces.build import ensemble
from granforce.forces.contact_problem import make_problem
from granforce.forces.nearest import nearest, nearest_of_many
from granforce.forces.nearest_piqp import nearest_piqp
from granforce.numerics import cholesky, contact_program
from granforce.numerics.contact_program import Problem
from granforce.numerics.lanes import LANES, MANY, ONE
from granforce.packing.compaction import pack
from granforce.perturb.critical_force import critical_force, critical_forces
from granforce.system.clock import timed

# Operations to subtract one product of two 3×3 blocks from a third.
_PRODUCT = 54
# Dense matrix product on one core: the peak in double precision on this machine.
_DENSE = """
import time
import numpy as np
a = np.random.default_rng(0).random((1200, 1200))
best = 1e9
for _ in range(5):
    begin = time.perf_counter()
    a @ a
    best = min(best, time.perf_counter() - begin)
print(2 * 1200**3 / best / 1e9)
"""


def kernel(n: int = 100, mu: float = 0.1, tiles: Sequence[int] = (1, 2, 4, 8)) -> list[Row]:
    """Rows: Gflop/s of one factorisation, single and in lanes, and the ratio to a dense product."""
    dense = _dense_product()
    rows = []
    for case, S in tilings("kernel", ensemble(pack(n, mu, 1)), tiles):
        problem, _ = make_problem(S)
        for lanes in (ONE, MANY):
            each = _factorisation(problem, lanes) / len(lanes)
            below = np.diff(problem.network.layout.start) - 1
            products = int(np.sum(below * (below + 1) // 2))
            flops = _PRODUCT * products / each / 1e9
            row = case | {"lanes": len(lanes), "ms_per_matrix": 1e3 * each, "gflops": flops}
            rows.append(row | {"dense_gflops": dense, "part": flops / dense})
    return rows


def _dense_product() -> float:
    single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    called = [sys.executable, "-c", _DENSE]
    done = subprocess.run(called, env=os.environ | single, capture_output=True, check=True)
    return float(done.stdout)


def _factorisation(problem: Problem, lanes: Any) -> float:
    """Seconds of the fastest of many factorisations."""
    work = contact_program.make_workspace(problem, len(lanes))
    best = np.inf
    for _ in range(30):
        # Any positive definite matrix: the operations do not depend on its numbers.
        work.factors.lower[:] = 0.0
        work.factors.lower[cholesky.diagonals(problem.network).ravel()] = 1.0
        arguments = problem.network, work.least, work.factors, work.stop, lanes
        best = min(best, timed(cholesky.factor, *arguments)[0])
    return best


def starts(n: int = 400, frictions: Sequence[float] = FRICTIONS, repeats: int = 5) -> list[Row]:
    """Rows: milliseconds per nearest network by PIQP, one at a time, and by 16 chains in lanes.

    All use the same starts, interleaved, so that a slow phase of the machine affects all of them.
    """
    rows = []
    for case, S in packings("starts", n, frictions):
        ways: dict[str, Callable[..., Any]] = {
            "PIQP": lambda given, S=S: [nearest_piqp(S, start) for start in given],
            "one at a time": lambda given, S=S: [nearest(S, start) for start in given],
            f"{LANES} lanes": lambda given, S=S: nearest_of_many(S, given),
        }
        spent: dict[str, list[float]] = {name: [] for name in ways}
        worst = 0.0
        for turn in range(repeats + 1):
            given = kicked(S, 2 * LANES, turn)
            networks = {}
            for name, way in ways.items():
                seconds, reached = timed(way, given)
                networks[name] = np.stack([one.forces for one in reached])
                spent[name].append(seconds / len(given))
            worst = max(worst, *(np.abs(one - networks["PIQP"]).max() for one in networks.values()))
        each = {name: float(np.median(times[1:])) for name, times in spent.items()}  # [0] compiles
        for name, seconds in each.items():
            row = case | {"solver": name, "ms_per_state": 1e3 * seconds}
            ratio = {"ratio_to_piqp": each["PIQP"] / seconds}
            rows.append(row | ratio | {"differ": worst / S.force_scale})
    return rows


def pushes(n: int = 400, frictions: Sequence[float] = (0.1, 1), contacts: int = 30) -> list[Row]:
    """Rows: processor seconds of critical forces, one contact at a time and in lanes.

    The same loads on the same contacts, with known limit loads; F_crit must agree.
    """
    rows = []
    for case, S in packings("pushes", n, frictions):
        some = S.index[:: max(1, len(S.index) // contacts)][:contacts]
        loads = limit_loads(S, some)
        ways: dict[str, Callable[..., Any]] = {
            "one at a time": lambda which, given, S=S: [
                critical_force(S, contact, limit_load=load)
                for contact, load in zip(which, given, strict=True)
            ],
            f"{LANES} lanes": lambda which, given, S=S: critical_forces(
                S, which, limit_loads=given
            ),
        }
        seconds, results = {}, {}
        for name, way in ways.items():
            way(some[:3], loads[:3])  # compiles
            seconds[name], results[name] = timed(way, some, loads, clock=time.process_time)
        alone, in_lanes = ([one.low for one in each] for each in results.values())
        apart = np.abs(np.subtract(alone, in_lanes)).max() / S.force_scale
        for name, spent in seconds.items():
            systems = sum(one.counts["linear_systems"] for one in results[name])
            row = case | {"way": name, "seconds_per_contact": spent / len(some)}
            row |= {"ms_per_system": 1e3 * spent / systems}
            row |= {"ratio": seconds["one at a time"] / spent, "differ": float(apart)}
            rows.append(row)
    return rows


def growth(n: int = 100, mu: float = 0.1, tiles: Sequence[int] = (1, 2, 4, 8, 16)) -> list[Row]:
    """Rows: seconds of set-up, one relaxation and one exact bound against N, and exponents."""
    base = ensemble(pack(n, mu, 1))
    intervals(base, base.index[:1])  # compiles
    rows = []
    for case, S in tilings("growth", base, tiles):
        row = case | {"setup": timed(make_problem, S)[0]}
        start = kicked(S, 1, 0)[0]
        nearest(S, start, max_iterations=1)
        row["relaxation"] = nearest(S, start).seconds
        seconds, exact = timed(intervals, S, S.index[:LANES])
        row |= {"bound": seconds / exact.counts["programs"], "max_gap": exact.max_gap}
        rows.append(row | {"peak_MB": peak_megabytes()})
    fits = {name: growth_of(rows, name) for name in ("setup", "relaxation", "bound")}
    return [*rows, {"n": "exponent", **fits}]
