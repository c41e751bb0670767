"""What is left out changes nothing: each skip switched off gives the same answer.

Rattlers and unloaded contacts: test_polytope. Programs: test_bounds. Cells: test_study. Walks where
S is one point: test_random_walk.
"""

import numpy as np
import pytest
from packings import lattice

from granforce.explore.intervals import intervals
from granforce.forces.build import ensemble
from granforce.packing import pair_list
from granforce.packing.compaction import pack

pytestmark = pytest.mark.fast


def test_neighbour_lists_made_in_every_step_give_the_same_packing(monkeypatch):
    kept = pack(60, 0.3, 1)
    monkeypatch.setattr(pair_list, "MOVED", 0.0)
    anew = pack(60, 0.3, 1)
    assert anew.info["list_rebuilds"] > 3 * kept.info["list_rebuilds"]
    assert np.array_equal(anew.x, kept.x)
    assert np.array_equal(anew.forces, kept.forces)


def test_tangential_unknowns_left_out_are_zero_without_friction():
    # A square lattice has many frictionless networks: rows carry independent loads.
    packing = lattice(4, 4, 0.0)
    without, vanishing = ensemble(packing), ensemble(packing, mu=1e-7)
    assert without.skipped["tangential_unknowns"] == len(without.index)
    one, other = (
        intervals(without, without.index[[0, 5]]),
        intervals(vanishing, vanishing.index[[0, 5]]),
    )
    assert np.ptp([one.low[0, 0], one.high[0, 0]]) > 0.1
    assert np.abs(one.low - other.low).max() < 1e-5 * without.force_scale
    assert np.abs(one.high - other.high).max() < 1e-5 * without.force_scale
