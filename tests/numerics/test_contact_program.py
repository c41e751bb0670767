"""Steps of the interior-point method near a vertex of S."""

from collections import deque

import numpy as np
import pytest
from packings import packed

from granforce.explore.intervals import bound_of
from granforce.forces.build import ensemble
from granforce.forces.contact_problem import independent_problem_of
from granforce.numerics import contact_program, interior_point, linear_programs
from granforce.numerics.interior_point import OPTIMUM, REFINED
from granforce.numerics.lanes import MANY, ONE, room, side_by_side
from granforce.tolerances import BALANCED


def unbalances(S, mode, lanes=ONE):
    """What one bound is out of balance by, step after step, until its gap is 1e-9."""
    problem = independent_problem_of(S)
    middle = linear_programs.centre(problem)
    at = contact_program.make_iterate(problem, len(lanes))
    work = contact_program.make_workspace(problem, len(lanes))
    for lane in range(len(lanes)):
        programs = [bound_of(S, (7 + lane) % len(S.index), 0, 1)]
        linear_programs.fill(middle, at, lane, programs, deque([0]))
    found = []
    for _ in range(40):
        interior_point.look(problem, True, at, work, lanes)
        found.append((work.product[0, 0], work.unbalance[0, 0]))
        if found[-1][0] < 1e-9:
            return found
        interior_point.advance(problem, True, mode, at, work, lanes)
    raise AssertionError("no optimum after 40 steps")


@pytest.mark.parametrize("mu", [0.01, 0.3])
def test_refined_steps_leave_less_unbalance_on_the_same_way(mu):
    S = ensemble(packed(100, mu))
    plain, refined = unbalances(S, OPTIMUM), unbalances(S, REFINED)
    assert abs(len(plain) - len(refined)) <= 1
    assert max(off for gap, off in refined if gap > 1e-7) < 0.1 * BALANCED
    assert sum(off for _, off in refined) < 0.1 * sum(off for _, off in plain)
    assert unbalances(S, REFINED, MANY) == refined


def test_lanes_begin_where_a_line_of_the_cache_does():
    # Those of two lines at once take up to twice the time, with the same results.
    problem = independent_problem_of(ensemble(packed(100, 0.3)))
    at = contact_program.make_iterate(problem, len(MANY))
    work = contact_program.make_workspace(problem, len(MANY))
    arrays = [*at[:-1], *work.factors, *work[3:]]
    assert len(arrays) > 20
    assert {array.ctypes.data % 64 for array in arrays if array.size} == {0}
    assert np.array_equal(room(3, 2, value=0.5), np.full((3, 2), 0.5))
    assert np.array_equal(side_by_side([1.0, 2.0], 3), [[1.0] * 3, [2.0] * 3])
