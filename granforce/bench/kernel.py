"""The solver on S compared with PIQP, in lanes, and against the number of disks."""

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
from granforce.numerics.lanes import LANES
from granforce.packing.compaction import pack
from granforce.perturb.critical_force import critical_force, critical_forces
from granforce.system.clock import timed


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
