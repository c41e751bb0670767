"""Sweeps in groups of contacts: the updates of single contacts, of which none meet in a group."""

import numpy as np
import pytest
from numba import njit
from packings import reference

from granforce.forces.build import ensemble
from granforce.motion.contact_dynamics import add_forces, set_stiffness, sweep
from granforce.motion.contact_groups import grouped, stiffen, sweep_groups, ungroup
from granforce.motion.gauss_seidel import from_rest
from granforce.numerics.lanes import LANES, ONE


@njit(error_model="numpy")
def in_groups(problem, mu, force, velocity, dilation, factor, sweeps):
    groups = grouped(problem, force, velocity)
    stiffen(groups, factor)
    for _ in range(sweeps):
        dilation = sweep_groups(groups, mu, dilation)
    ungroup(groups, force, velocity)
    return dilation, groups


def in_order(problem, mu, force, velocity, dilation, factor, sweeps):
    problem.stiff_n[:] *= factor
    problem.stiff_t[:] *= factor
    for _ in range(sweeps):
        order = np.arange(len(force))
        dilation, _, _ = sweep(problem, order, mu, force, velocity, dilation, ONE)
    return dilation


@pytest.fixture
def moving(rng):
    """A step problem, forces on a few contacts, velocities, and a strain rate of the box."""
    S = ensemble(reference("n100_mu0.1_s11"))
    problem, velocity, _, _ = from_rest(S)
    set_stiffness(problem)
    force = np.maximum(rng.uniform(-1, 2, (len(S.index), 2)), 0.0)
    velocity[:] = rng.normal(size=velocity.shape)
    return problem, S.mu, force, velocity


def test_no_grain_is_twice_in_a_group_and_each_meets_its_contacts_in_order(moving):
    problem, mu, force, velocity = moving
    _, groups = in_groups(problem, mu, force, velocity, 0.1, 1.0, 0)
    number = groups.place // LANES
    assert len(np.unique(groups.place)) == len(force)
    for grain in range(len(velocity)):
        own = number[(problem.i == grain) | (problem.j == grain)]
        assert np.all(np.diff(own) > 0)


@pytest.mark.parametrize("factor", [1.0, 0.7])
def test_in_a_box_of_fixed_size_groups_are_updated_as_single_contacts(moving, factor):
    problem, mu, force, velocity = moving
    problem = problem._replace(box_compliance=0.0)
    before = problem._replace(stiff_n=problem.stiff_n.copy(), stiff_t=problem.stiff_t.copy())
    one, other = (force.copy(), velocity.copy()), (force.copy(), velocity.copy())
    in_order(before, mu, *one, 0.1, factor, 5)
    in_groups(problem, mu, *other, 0.1, factor, 5)
    assert other[0] == pytest.approx(one[0], abs=1e-12)
    assert other[1] == pytest.approx(one[1], abs=1e-12)
    assert np.all(np.abs(other[0][:, 1]) <= mu * other[0][:, 0])
    assert not np.allclose(other[0], force, atol=0.1)


@pytest.mark.parametrize("rate", [0.02, (0.01, 0.03, -0.02)])
def test_velocities_and_the_box_follow_from_the_forces_of_groups(moving, rate):
    problem, mu, force, velocity = moving
    start, again = velocity.copy(), velocity.copy()
    before = add_forces(problem, force, start, rate)
    after, _ = in_groups(problem, mu, force, start, before, 1.0, 4)
    expected = add_forces(problem, force, again, rate)
    assert start == pytest.approx(again, abs=1e-12)
    assert after == pytest.approx(expected, abs=1e-12)
