"""The sweep: conserved momentum, cones, and a box that stays consistent with the forces."""

import numpy as np
import pytest
from packings import packed, reference

from granforce.forces.build import ensemble
from granforce.forces.nearest_piqp import nearest_piqp
from granforce.motion.contact_dynamics import add_forces, set_stiffness, sweep
from granforce.motion.gauss_seidel import SideBySide, from_rest, gauss_seidel
from granforce.numerics.lanes import ONE
from granforce.packing.scenes import scene


@pytest.fixture
def swept(rng):
    """A step problem after three sweeps from random forces."""
    S = ensemble(reference("n100_mu0.1_s11"))
    problem, velocity, dilation, _ = from_rest(S)
    set_stiffness(problem)
    force = rng.uniform(-1, 2, (len(S.index), 2))
    velocity[:] = rng.normal(size=velocity.shape)
    start = velocity.copy(), dilation
    dilation = add_forces(problem, force, velocity, dilation)
    for _ in range(3):
        dilation, _, _ = sweep(problem, np.arange(len(force)), S.mu, force, velocity, dilation, ONE)
    return S, problem, force, velocity, dilation, start


def test_sweeps_conserve_linear_momentum(swept):
    _, problem, _, velocity, _, (before, _) = swept
    mass = 1 / problem.inverse_mass
    assert mass @ velocity[:, :2] == pytest.approx(mass @ before[:, :2], abs=1e-12)


def test_velocities_and_box_follow_from_the_forces(swept):
    _, problem, force, velocity, dilation, (before, at_rest) = swept
    again = before.copy()
    expected = add_forces(problem, force, again, at_rest)
    assert velocity == pytest.approx(again, abs=1e-12)
    assert dilation == pytest.approx(expected, abs=1e-12)
    length = problem.length
    assert dilation - at_rest == pytest.approx(problem.box_compliance * force[:, 0] @ length)


def test_forces_lie_in_their_cones_after_one_sweep(swept):
    S, _, force, *_ = swept
    assert np.all(force[:, 0] >= 0)
    assert np.all(np.abs(force[:, 1]) <= S.mu * force[:, 0])


@pytest.mark.parametrize("order", ["sequential", "random"])
def test_relaxation_reaches_the_balance(order, rng):
    S = ensemble(packed(40, 0.3, 2))
    start = S.original + rng.uniform(-1, 1, S.original.shape) * S.force_scale
    found = gauss_seidel(S, start, order=order)
    assert found.converged
    assert found.residual == S.residual(found.forces) < 1e-10
    assert S.violation(found.forces) < 1e-9


@pytest.mark.parametrize("most", [100_000, 5003])
def test_relaxations_side_by_side_end_as_they_do_alone(most, rng):
    """Begun whenever a lane is free, for any company: forces bit for bit, and all that is told."""
    S = ensemble(packed(40, 0.3))
    options = {"rest": None, "tolerance": 1e-6, "max_iterations": most}
    starts = S.original + rng.uniform(-1, 1, (9, *S.original.shape)) * S.force_scale
    alone = [gauss_seidel(S, start, **options) for start in starts]
    assert len({one.iterations for one in alone}) > 1  # they end at different times
    beside, waiting, there, found = SideBySide(S, 3, **options), list(range(9)), {}, {}
    for lane in range(3):
        there[lane] = waiting.pop(0)
        beside.begin(lane, starts[there[lane]])
    while there:
        for lane, relaxation in beside.ended():
            found[there.pop(lane)] = relaxation
            if waiting:
                there[lane] = waiting.pop(0)
                beside.begin(lane, starts[there[lane]])
    for k, one in enumerate(alone):
        assert np.array_equal(one.forces, found[k].forces)
        assert one[1:5] == found[k][1:5]


def test_the_exact_finish_hardly_moves_what_sweeps_alone_would_reach(rng):
    S = ensemble(packed(40, 0.3))
    start = S.original + rng.uniform(-1, 1, S.original.shape) * S.force_scale
    finished = gauss_seidel(S, start).forces
    alone = gauss_seidel(S, start, rest=None, tolerance=1e-8)
    assert alone.residual < 1e-8
    assert np.linalg.norm(finished - alone.forces) < 0.02 * np.linalg.norm(alone.forces)


def test_a_state_of_s_is_left_alone():
    S = ensemble(packed(40, 0.3))
    found = gauss_seidel(S, S.original)
    assert np.abs(found.forces - S.original).max() < 1e-9 * S.force_scale


def test_motion_is_no_equilibrium(rng):
    # With half the friction this packing cannot hold: its grains go on moving.
    packing = packed(40, 0.3)
    S = ensemble(packing, prune=False)
    weak = packing._replace(mu=0.3)
    slippery = ensemble(weak, mu=1e-3, prune=False)
    found = gauss_seidel(slippery, S.original, max_iterations=200_000)
    assert found.residual > 1e-3
    assert not nearest_piqp(slippery, S.original).converged


@pytest.mark.parametrize("name", ["groove", "pyramid", "column"])
def test_what_a_wall_holds_does_not_move(name):
    """Its balance is left open, so that it is none of the ensemble's grains."""
    S = ensemble(scene(name))
    found = gauss_seidel(S, np.zeros_like(S.original), rest=None, tolerance=1e-9)
    assert found.residual < 1e-9 and found.violation < 1e-9


def test_too_few_sweeps_are_not_called_converged(rng):
    S = ensemble(packed(40, 0.3))
    start = S.original + rng.uniform(-1, 1, S.original.shape) * S.force_scale
    found = gauss_seidel(S, start, max_iterations=3)
    assert not found.converged
    assert found.iterations == 3
