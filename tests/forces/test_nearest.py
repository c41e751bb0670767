"""The fast nearest network: same optimum as the quadratic program, exact cones, honest ends."""

import gc
import weakref
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from packings import lattice, packed, reference, two_disks
from scipy import sparse

from granforce.bench.runner import tile
from granforce.explore.random_walk import walk
from granforce.forces.build import ensemble
from granforce.forces.contact_problem import problem_of, restored_balance
from granforce.forces.nearest import nearest, nearest_of_many
from granforce.forces.nearest_piqp import nearest_piqp
from granforce.numerics import cone_projection, contact_matrix, contact_program
from granforce.numerics.lanes import ONE
from granforce.records import Relaxation
from granforce.tolerances import ADMISSIBLE, BALANCED


def kicked(S, seed, size=1.0):
    rng = np.random.default_rng(seed)
    kick = size * S.force_scale * rng.uniform(-1, 1, S.original.shape)
    if S.mu == 0:
        kick[:, 1] = 0
    return S.original + kick


def assert_nearest(S, start):
    ours, theirs = nearest(S, start), nearest_piqp(S, start)
    assert ours.converged and theirs.converged
    assert S.admits(ours.forces, BALANCED, ADMISSIBLE)
    assert ours.residual == S.residual(ours.forces)
    assert ours.violation == S.violation(ours.forces)
    apart = np.linalg.norm(ours.forces - theirs.forces)
    # Two optima of one strictly convex program: ours is not farther by more than rounding, and
    # whatever lies in S is as far from the nearest as Pythagoras allows, at an obtuse angle.
    ours, theirs = (np.linalg.norm(r.forces - start) for r in (ours, theirs))
    assert apart <= np.sqrt(max(theirs**2 - ours**2, 0.0)) + 1e-6 * S.force_scale
    assert ours <= theirs * (1 + 1e-8) + 1e-8 * S.force_scale


@pytest.mark.parametrize("mu", [0.0, 0.01, 0.1, 0.3, 1.0, 10.0])
@pytest.mark.parametrize("size", [1e-3, 1.0, 30.0])
def test_agrees_with_the_quadratic_program(mu, size):
    S = ensemble(packed(40, mu))
    for seed in range(3):
        assert_nearest(S, kicked(S, seed, size))


def test_comes_back_from_far_outside():
    S = ensemble(packed(40, 0.3))
    start = kicked(S, 1, 1e4)
    found = nearest(S, start)
    assert found.converged and S.admits(found.forces)
    # No state of S on the way to the nearest by the quadratic program is nearer.
    ahead = ((start - found.forces) * (nearest_piqp(S, start).forces - found.forces)).sum()
    assert ahead <= 1e-9 * (start**2).sum()


def partly_frozen():
    packing = packed(40, 0.3)
    S = ensemble(packing, frozen=np.arange(0, len(packing.contacts.i), 9))
    assert not S.has_pressure_row
    return S


ENSEMBLES = {
    "n100_mu0.1_s11": lambda: ensemble(reference("n100_mu0.1_s11")),
    "n100_mu1_s12": lambda: ensemble(reference("n100_mu1_s12")),
    "n400_mu0.1_s13": lambda: ensemble(reference("n400_mu0.1_s13")),
    "little more friction": lambda: ensemble(packed(40, 0.0), mu=0.05),
    "more friction": lambda: ensemble(packed(40, 0.0), mu=0.5),
    "square crystal": lambda: ensemble(lattice(6, 6, 0.4)),
    "triangular crystal": lambda: ensemble(lattice(6, 6, 0.4, triangular=True)),
    "two disks that touch twice": lambda: ensemble(two_disks()),
    "frozen contacts": partly_frozen,
    "contacts that carry nothing": lambda: ensemble(packed(40, 0.3), prune=False),
}


@pytest.mark.parametrize("name", ENSEMBLES)
def test_agrees_on_other_ensembles(name):
    S = ENSEMBLES[name]()
    assert_nearest(S, kicked(S, 3))
    assert_nearest(S, np.zeros(S.original.shape))


def test_an_admissible_start_stays():
    S = ensemble(packed(40, 0.3))
    found = nearest(S, S.original)
    assert np.abs(found.forces - S.original).max() < 1e-9 * S.force_scale


def test_same_start_same_forces_whatever_was_solved_before_and_in_any_thread():
    S = ensemble(packed(40, 0.3))
    starts = [kicked(S, seed) for seed in range(4)]
    once = [nearest(S, start).forces for start in starts]
    with ThreadPoolExecutor(4) as pool:
        again = list(pool.map(lambda k: nearest(S, starts[k % 4]).forces, range(15, -1, -1)))
    for k, forces in zip(range(15, -1, -1), again, strict=True):
        assert np.array_equal(forces, once[k % 4])
    fresh = ensemble(packed(40, 0.3))
    assert np.array_equal(nearest(fresh, starts[2]).forces, once[2])


def test_lanes_do_not_know_their_company():
    S = ensemble(packed(40, 0.3))
    starts = [kicked(S, seed) for seed in range(11)]
    alone = [nearest(S, start) for start in starts]
    for order in (range(11), (3, 7), range(8, 2, -1)):
        together = nearest_of_many(S, [starts[k] for k in order])
        for k, found in zip(order, together, strict=True):
            assert np.array_equal(found.forces, alone[k].forces)
            assert found.iterations == alone[k].iterations
            assert found.residual == alone[k].residual


def test_the_plan_goes_with_its_ensemble():
    S = ensemble(packed(40, 0.3))
    nearest(S, S.original)
    gone, plan = weakref.ref(S), weakref.ref(problem_of(S).b)
    assert plan() is problem_of(S).b
    del S
    gc.collect()
    assert gone() is None and plan() is None


def test_too_few_steps_are_told():
    S = ensemble(packed(40, 0.1))
    found = nearest(S, kicked(S, 0), max_iterations=2)
    assert isinstance(found, Relaxation)
    assert not found.converged
    assert found.iterations == 2
    assert found.residual == S.residual(found.forces) > BALANCED
    assert found.violation == 0


def test_starts_that_are_no_numbers_are_told():
    S = ensemble(packed(40, 0.3))
    found = nearest(S, np.full(S.original.shape, np.nan))
    assert not found.converged and np.isnan(found.residual)


def test_an_empty_s_is_told():
    packing = packed(40, 0.3)
    # Without friction the same contacts cannot balance.
    S = ensemble(packing, mu=1e-6, prune=False)
    found = nearest(S, S.original)
    assert not found.converged
    assert found.residual > 1e-6
    assert np.all(np.isfinite(found.forces))


def test_a_walk_by_it_stays_in_s_and_visits_what_the_quadratic_program_does():
    S = ensemble(packed(40, 0.3))
    ours = walk(S, 5, 3, relax=nearest)
    theirs = walk(S, 5, 3, relax=nearest_piqp)
    assert ours.residual.max() < BALANCED
    assert np.abs(ours.states - theirs.states).max() < 1e-5 * S.force_scale


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_tiled_packing_balances_and_its_nearest_network_is_tiled(mu):
    one = ensemble(packed(40, mu))
    packing = tile(one, 3)
    many = ensemble(packing, prune=False)
    assert len(many.index) == 9 * len(one.index)
    assert many.force_scale == pytest.approx(one.force_scale)
    assert many.residual(many.original) < BALANCED
    start = kicked(one, 1)
    small = nearest(one, start).forces
    large = nearest(many, np.tile(start, (9, 1))).forces
    assert np.abs(large - np.tile(small, (9, 1))).max() < 1e-6 * one.force_scale


force = st.floats(-1e3, 1e3)
friction = st.one_of(st.just(0.0), st.floats(1e-6, 1e3))


def project(normal, tangential, mu):
    """The point of the cone |f_t| ≤ μ f_n nearest to (normal, tangential)."""
    nothing = np.zeros((1, 3, 2))
    network = contact_matrix.make_network(
        np.zeros((2, 2)), np.array([0]), np.array([1]), nothing, nothing, np.zeros((1, 0, 2))
    )
    rows, one = np.zeros(6), np.array([mu])
    problem = contact_program.make_problem(network, rows, rows[:0], rows, np.arange(6), one, 0.0)
    at = contact_program.make_iterate(problem, 1)
    work = contact_program.make_workspace(problem, 1)
    at.c[0], at.c[1] = -0.5 * (normal + mu * tangential), -0.5 * (normal - mu * tangential)
    cone_projection.project(problem, at, work, ONE)
    f_n, f_t = 0.5 * (at.y[0, 0] + at.y[1, 0]), mu * 0.5 * (at.y[0, 0] - at.y[1, 0])
    return f_n, f_t


@given(force, force, friction, force, force)
def test_projection_is_the_nearest_point_of_the_cone(normal, tangential, mu, f_n, f_t):
    p, t = project(normal, tangential, mu)
    size = 1 + abs(normal) + abs(tangential)
    assert p >= 0 and abs(t) <= mu * p * (1 + 1e-12)
    # A point of the cone is the nearest one where no other of the cone lies ahead of it.
    f_n = abs(f_n)
    f_t = np.clip(f_t, -mu * f_n, mu * f_n)
    ahead = (normal - p) * (f_n - p) + (tangential - t) * (f_t - t)
    assert ahead <= 1e-9 * size * (size + abs(f_n) + abs(f_t))


@given(force, force, friction)
def test_projection_twice_is_projection_once(normal, tangential, mu):
    once = project(normal, tangential, mu)
    # Cone coordinates are as large as f_n + μ f_t, and f_t is μ or 1/μ times their difference.
    size = 1 + abs(normal) + mu * abs(tangential)
    rounding = 1e-14 * size * max(mu, 1.0 / max(mu, 1e-6))
    assert project(*once, mu) == pytest.approx(once, rel=1e-12, abs=rounding)
    inside = normal >= 0 and abs(tangential) <= mu * normal
    assert not inside or once == pytest.approx((normal, tangential), rel=1e-12, abs=rounding)


def test_the_balance_is_restored_by_the_least_relative_change(rng):
    A = rng.standard_normal((6, 12))
    A[5] = A[0] + A[1]  # as rows of the stress may follow from others
    y = rng.uniform(0.5, 2.0, 12)
    b = A @ (y * (1 + 1e-3 * rng.standard_normal(12)))
    restored = restored_balance(sparse.csr_matrix(A), b, y)
    least = y + y * np.linalg.lstsq(A * y, b - A @ y, rcond=1e-12)[0]
    assert np.abs(A @ restored - b).max() < 1e-14 * np.abs(A).sum()
    assert np.allclose(restored, least, rtol=1e-5)  # of changes of 10⁻³, to second order
