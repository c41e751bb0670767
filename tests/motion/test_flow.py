"""The exact step of contact dynamics, as a flow."""

import numpy as np
import pytest

from granforce.forces.build import ensemble
from granforce.motion.flow import STEADY, Push
from granforce.motion.flow_lanes import follow, relax
from granforce.motion.inertia import make_step
from granforce.packing.compaction import pack

pytestmark = pytest.mark.fast

N = 60


@pytest.mark.parametrize("times", [1.0, 1e3, 1e6])
def test_the_size_of_the_load_does_not_decide_whether_a_step_is_solved(times):
    """Gaps of 10⁻⁶ close under any load: what is left unbalanced is measured against the load."""
    S = ensemble(pack(N, 0.0, 1))
    step, forces = make_step(S), times * S.original / S.force_scale
    gap = 1e-6 * np.random.default_rng(0).standard_normal(len(forces))
    step = step._replace(b=times * step.b, b_border=times * step.b_border, closing=gap)
    outcome = relax(step, Push(forces, 0, 0.0, 60, STEADY))
    assert outcome.converged and outcome.iterations < 60


def test_flows_side_by_side_end_as_they_do_alone(rng):
    S = ensemble(pack(N, 0.3, 1))
    step, forces = make_step(S), S.original / S.force_scale
    noise = 1e-2 * rng.standard_normal((3, *forces.shape))
    pushes = [Push(forces + one, 0, 0.0, 500, STEADY) for one in noise]
    ends = {}

    def search(push):
        return (yield push)

    follow(step, [search(push) for push in pushes], ends.__setitem__)
    for k, push in enumerate(pushes):
        alone = relax(step, push)
        assert alone.at_rest and alone.steps == ends[k].steps
        assert np.array_equal(alone.forces, ends[k].forces)
