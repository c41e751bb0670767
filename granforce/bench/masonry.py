"""Benchmark of dry-stone walls: bounds and load factors against HiGHS, and uniform states."""

from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from granforce.bench.exact import plain_loop
from granforce.explore.intervals import intervals
from granforce.explore.uniform import sample_uniform
from granforce.forces.build import ensemble, with_idle
from granforce.forces.ensemble import Ensemble
from granforce.packing.scenes import scene
from granforce.perturb.grain_loads import load_factor
from granforce.system.clock import timed

CONTACTS, STATES = 16, 100
# Courses and blocks in each: 55 and 1014 bodies with half blocks and the ground.
SMALL, LARGE = {"courses": 10, "blocks": 5}, {"courses": 26, "blocks": 38}


def masonry(quick: bool = True) -> list[dict[str, Any]]:
    """Rows: seconds of each method, their ratio to the baseline, and the difference of the results.

    Bounds of 16 contacts against one HiGHS model that starts each program from the last basis
    (differences in ⟨f_n⟩), the horizontal load factor against `linprog` (difference relative to
    it), and 100 uniform states. quick: 55 bodies instead of 1014.
    """
    wall = ensemble(scene("wall", **(SMALL if quick else LARGE)))
    small = ensemble(scene("wall", **SMALL))
    _bounds(small)
    _factors(small)  # these two compile
    sizes = {"bodies": len(wall.packing.r), "contacts": len(wall.index)}
    seconds, sample = timed(sample_uniform, wall, STATES)
    states = {"what": f"{STATES} uniform states", "method": "granforce", "seconds": seconds}
    states["r_hat"] = sample.mixing.worst_r_hat
    return [sizes | row for row in (*_bounds(wall), *_factors(wall), states)]


def _bounds(wall: Ensemble) -> list[dict[str, Any]]:
    spaced = np.linspace(0, len(wall.index) - 1, CONTACTS).astype(int)
    contacts = wall.index[spaced]
    ours, exact = timed(intervals, wall, contacts, workers=1)
    plain, (low, high) = timed(plain_loop, wall, contacts)
    apart = max(np.abs(low - exact.low).max(), np.abs(high - exact.high).max())
    times = {"granforce, certified": ours, "HiGHS": plain}
    return _compared(f"bounds of {CONTACTS} contacts", times, apart / wall.force_scale)


def _factors(wall: Ensemble) -> list[dict[str, Any]]:
    ours, found = timed(load_factor, wall)
    plain, factor = timed(_by_linprog, with_idle(wall), found.load)
    times = {"granforce, certified": ours, "scipy linprog": plain}
    return _compared("load factor", times, abs(factor - found.factor) / factor)


def _by_linprog(wall: Ensemble, load: Any) -> float:
    A, _ = wall.cone_form
    unit = wall.force_scale
    action = load[wall.grains].ravel()[:, None] / unit
    columns = sparse.hstack([A, sparse.csr_matrix(action)]).tocsr()
    cost = np.append(np.zeros(A.shape[1]), -1.0)
    return -linprog(cost, A_eq=columns, b_eq=wall.b / unit, method="highs").fun


def _compared(what: str, times: dict[str, float], apart: float) -> list[dict[str, Any]]:
    """Rows of methods with their seconds, the baseline last."""
    baseline = list(times.values())[-1]
    return [
        {"what": what, "method": method, "seconds": seconds, "ratio": baseline / seconds}
        | {"difference": float(apart)}
        for method, seconds in times.items()
    ]
