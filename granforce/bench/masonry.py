"""Benchmark of dry-stone walls: bounds and load factors against HiGHS, and uniform states."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from granforce.bench.exact import plain_loop
from granforce.bench.runner import Row, compared
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


def masonry(size: Mapping[str, int] = LARGE) -> list[Row]:
    """Rows: seconds of each method, their ratio to the baseline, and the difference of the results.

    Bounds of 16 contacts against one HiGHS model that starts each program from the last basis
    (differences in ⟨f_n⟩), the horizontal load factor against `linprog` (difference relative to
    it), and 100 uniform states. size: options of the scene of a wall.
    """
    wall = ensemble(scene("wall", **size))
    small = ensemble(scene("wall", **SMALL))
    _bounds(small)
    _factors(small)  # these two compile
    sizes = {"bodies": len(wall.packing.r), "contacts": len(wall.index)}
    seconds, sample = timed(sample_uniform, wall, STATES)
    states = {"what": f"{STATES} uniform states", "method": "granforce", "seconds": seconds}
    states["r_hat"] = sample.mixing.worst_r_hat
    return [sizes | row for row in (*_bounds(wall), *_factors(wall), states)]


def _bounds(wall: Ensemble) -> list[Row]:
    spaced = np.linspace(0, len(wall.index) - 1, CONTACTS).astype(int)
    contacts = wall.index[spaced]
    methods = {
        "granforce, certified": lambda: intervals(wall, contacts, workers=1),
        "HiGHS": lambda: plain_loop(wall, contacts),
    }

    def measure(name: str, results: Row) -> Row:
        exact, (low, high) = results.values()
        apart = max(np.abs(low - exact.low).max(), np.abs(high - exact.high).max())
        return {"difference": float(apart / wall.force_scale)}

    return compared({"what": f"bounds of {CONTACTS} contacts"}, methods, measure, "HiGHS")


def _factors(wall: Ensemble) -> list[Row]:
    idle, load = with_idle(wall), load_factor(wall).load
    methods = {
        "granforce, certified": lambda: load_factor(wall).factor,
        "scipy linprog": lambda: _by_linprog(idle, load),
    }

    def measure(name: str, results: Row) -> Row:
        ours, factor = results.values()
        return {"difference": float(abs(factor - ours) / factor)}

    return compared({"what": "load factor"}, methods, measure, "scipy linprog")


def _by_linprog(wall: Ensemble, load: Any) -> float:
    A, _ = wall.cone_form
    unit = wall.force_scale
    action = load[wall.grains].ravel()[:, None] / unit
    columns = sparse.hstack([A, sparse.csr_matrix(action)]).tocsr()
    cost = np.append(np.zeros(A.shape[1]), -1.0)
    return -linprog(cost, A_eq=columns, b_eq=wall.b / unit, method="highs").fun
