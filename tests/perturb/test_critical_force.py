"""Critical forces and first motions of local perturbations, judged by what they must obey."""

import numpy as np
import pytest
from packings import (
    lattice,
    packed,
    quarter_turned,
    reference,
    relabelled,
    reversed_contacts,
)

from granforce.explore.intervals import limit_load_bounds, limit_loads
from granforce.forces.build import ensemble
from granforce.motion import contact_dynamics as dynamics
from granforce.motion import flow
from granforce.motion.gauss_seidel import from_rest
from granforce.motion.inertia import make_step
from granforce.numerics.lanes import ONE
from granforce.perturb import critical_force as perturb
from granforce.perturb import decay
from granforce.perturb.critical_force import RISE, critical_force, critical_forces, response
from granforce.records import Cancelled, InputError, UndecidedError
from granforce.study import cells as study
from granforce.study import kinds
from granforce.study.store import open_store

# Far above the rounding error of a solution, far below any wrong one.
ROUNDING = 1e-7


@pytest.mark.parametrize("mu", [0, 0.05, 0.1, 0.3, 1, 10])
def test_no_equilibrium_beyond_the_limit_load_and_one_below_the_critical_force(mu):
    S = ensemble(packed(30, mu))
    limit = limit_loads(S)
    for k in range(0, len(S.index), 9):
        found = critical_force(S, S.index[k], limit_load=limit[k])
        assert 0 <= found.low < found.high <= limit[k] * (1 + 1e-12)
        assert found.high - found.low <= 0.01 * S.force_scale * (1 + 1e-9)
        loaded = found.forces.copy()
        loaded[k, 0] += found.low
        assert S.residual(loaded) <= 1e-10
        assert S.violation(found.forces) <= 1e-9


def test_without_friction_the_limit_load_is_reached():
    # The law is associated at μ = 0: what can be at rest comes to rest.
    S = ensemble(packed(30, 0))
    limit = limit_loads(S)
    for k in range(0, len(S.index), 3):
        found = critical_force(S, S.index[k], limit_load=limit[k])
        assert limit[k] - found.low <= 0.01 * S.force_scale


def test_a_limit_load_that_is_too_large_brings_no_rest_beyond_the_true_one():
    S = ensemble(packed(30, 0.3))
    limit = limit_loads(S)
    for k in range(0, len(S.index), 12):
        far = critical_force(S, S.index[k], limit_load=3 * limit[k])
        assert far.low <= limit[k] * (1 + 1e-9)


def test_loads_rise_by_the_part_of_the_way_that_is_asked_for():
    S = ensemble(packed(30, 0.1))
    limit = limit_loads(S)
    for k in range(0, len(S.index), 25):
        coarse, fine = (
            critical_force(S, S.index[k], limit_load=limit[k], rise=rise) for rise in (0.4, 0.1)
        )
        assert fine.counts["loads_at_rest"] > coarse.counts["loads_at_rest"]
        assert 0 <= fine.low < fine.high <= limit[k] * (1 + 1e-12)


def test_sliding_lets_grains_set_off_below_the_limit_load():
    S = ensemble(reference("n100_mu1_s12"))
    contacts = S.index[[53, 113]]
    pairs = zip(contacts, limit_loads(S, contacts), strict=True)
    assert all(critical_force(S, c, limit_load=load).low < 0.6 * load for c, load in pairs)


@pytest.mark.parametrize(
    ("mu", "seed", "contacts"),
    [(0.01, 7001, [3]), (0.3, 7002, [52]), (1.0, 7005, [11, 37, 43]), (10.0, 7001, [13, 16, 36])],
)
def test_load_steps_and_precision_four_times_finer_change_f_crit_by_less_than_its_error(
    mu, seed, contacts
):
    S = ensemble(packed(100, mu, seed))
    usual, fine = (
        np.array([one.low for one in critical_forces(S, contacts, rise=rise, precision=precision)])
        for rise, precision in ((RISE, 0.01), (RISE / 4, 0.01 / 4))
    )
    assert np.abs(usual - fine).max() <= 0.01 * S.force_scale


def test_f_crit_has_its_stated_error_near_the_limit_load():
    # Sweeps of contact dynamics and springs, independent of this protocol, find 0.060 ⟨f_n⟩.
    found = critical_force(packed(100, 1.0, 7003), 98)
    scale = ensemble(packed(100, 1.0, 7003)).force_scale
    assert 0.060 <= found.low / scale <= found.limit_load / scale < 0.0632


def test_what_is_given_up_too_early_is_followed_before_it_counts_as_motion():
    S = ensemble(packed(60, 0.1))
    for contact in S.index[:60:12]:
        found = critical_force(S, contact, max_steps=2)
        assert found.moving is None or found.moving.breach <= perturb.STEADY
        # Two steps decide next to nothing: without following F_crit would be far too low.
        usual = critical_force(S, contact)
        assert found.low == pytest.approx(usual.low, rel=0.1, abs=0.02 * S.force_scale)
        assert response(S, contact, critical=found).converged


def test_contacts_carried_side_by_side_are_as_alone_to_the_last_bit():
    S, told, rested = ensemble(packed(40, 0.3)), [], set()
    contacts = S.index[::5]
    limit = limit_loads(S, contacts)
    alone = [critical_force(S, c, limit_load=load) for c, load in zip(contacts, limit, strict=True)]
    assert len({critical.counts["linear_systems"] for critical in alone}) > 5
    for workers in (1, 2):
        together = critical_forces(
            S, contacts, workers=workers, finished=lambda k, one: told.append((k, one.low)),
            watch=lambda *load: rested.add(load),
        )  # fmt: skip
        for one, other in zip(together, alone, strict=True):
            assert one.contact == other.contact and one.counts == other.counts
            assert (one.low, one.high, one.converged) == (other.low, other.high, other.converged)
            assert np.array_equal(one.forces, other.forces)
            assert (one.moving is None) == (other.moving is None)
            if one.moving is not None:
                assert np.array_equal(one.moving.velocity, other.moving.velocity)
    assert {load for load in told if load[1]} <= rested
    assert all(load <= limit[k] for k, load in rested)
    assert sorted(told[: len(contacts)]) == [(k, one.low) for k, one in enumerate(alone)]


def test_what_fails_in_one_thread_ends_the_others():
    S, told = ensemble(packed(40, 0.3)), []

    def fail(k, critical):
        told.append(k)
        raise OSError("no space left")

    with pytest.raises(OSError, match="no space"):
        critical_forces(S, S.index, workers=2, finished=fail)
    assert len(told) <= 2


def swept(S, forces, position, load, sweeps):
    """Gauss–Seidel sweeps under a pair: forces and unbalance, in ⟨f_n⟩."""
    problem, velocity, dilation, _ = from_rest(S)
    force, pair = forces.copy(), np.zeros_like(forces)
    pair[position, 0] = load
    dynamics.set_stiffness(problem)
    dilation = dynamics.add_forces(problem, force + pair, velocity, dilation)
    order = np.arange(len(force))
    for _ in range(sweeps):
        dilation, _, _ = dynamics.sweep(problem, order, S.mu, force, velocity, dilation, ONE)
    return force, S.residual((force + pair) * S.force_scale)


def test_sweeps_of_contact_dynamics_decide_alike():
    S = ensemble(packed(20, 0.3, 2))
    limit = limit_loads(S)
    for k in range(0, len(S.index), 8):
        found = critical_force(S, S.index[k], limit_load=limit[k])
        start = S.original / S.force_scale
        _, below = swept(S, start, k, 0.5 * found.low / S.force_scale, 20_000)
        assert below < 1e-6
        above = 1.02 * found.high / S.force_scale
        _, above = swept(S, found.forces / S.force_scale, k, above, 20_000)
        assert above > 1e-4


def test_motion_obeys_momentum_balance_and_coulombs_law():
    S, k = ensemble(reference("n100_mu0.1_s11")), 128
    critical = critical_force(S, S.index[k])
    step, moving = make_step(S), critical.moving
    assert critical.converged
    f, U = moving.forces, moving.velocity
    mass = np.concatenate([step.mass, step.mass_border])[step.place]
    loaded = f.copy()
    loaded[k, 0] += critical.high / S.force_scale
    unbalance = S.A @ S.to_vector(loaded) - S.b / S.force_scale
    assert np.abs(unbalance - mass * U).max() <= ROUNDING * np.abs(unbalance).max()
    w_n, w_t = (S.A.T @ U).reshape(-1, 2).T
    fastest = max(np.abs(w_n).max(), np.abs(w_t).max())
    w_n, w_t = w_n / fastest, w_t / fastest
    small = 10 * flow.STEADY
    assert w_n.min() >= -small
    assert np.abs(w_n[f[:, 0] > 0]).max() <= small
    assert S.violation(f * S.force_scale) <= 1e-12
    inside = np.abs(f[:, 1]) < S.mu * f[:, 0]
    assert np.abs(w_t[inside]).max() <= small
    slides = np.abs(w_t) > 10 * small
    assert slides.any()
    assert np.all(f[slides, 1] * w_t[slides] <= 0)


@pytest.mark.parametrize("mu", [0.1, 0.5])
def test_first_motion_does_not_penetrate(mu):
    S = ensemble(packed(40, mu))
    for contact in S.index[::12]:
        moved = response(S, contact)
        assert moved.converged
        assert moved.opening.min() >= -(moved.breach + 1e-14) * moved.fastest
        pressed = ~moved.opened
        assert np.abs(moved.opening[pressed]).max() <= 2 * moved.breach * moved.fastest
        assert np.all(moved.opened.astype(int) + moved.slid + moved.kept == 1)
        u = moved.displacement[S.grains]
        assert np.mean(np.sum(u**2, axis=1)) == pytest.approx(1)
        assert np.isnan(np.delete(moved.displacement, S.grains, axis=0)).all()
        # Forces are internal: the centre of mass stays.
        mass = S.packing.r[S.grains] ** 2
        assert np.abs(mass @ u / mass.sum()).max() <= 1e-6
        # The gaps open as displaced centres say, to first order.
        c = S.contacts
        apart = moved.displacement[c.j] - moved.displacement[c.i]
        opening = np.sum(apart * c.normal, axis=1) + moved.dilation * c.length
        assert np.allclose(opening, moved.opening, atol=1e-9 * moved.fastest)


def test_orientation_of_contacts_labels_and_quarter_turns_change_nothing():
    packing = packed(30, 0.3)
    S, rng = ensemble(packing), np.random.default_rng(0)
    grains, order = rng.permutation(len(packing.r)), rng.permutation(len(packing.forces))
    contact = int(S.index[11])
    known = response(S, contact)
    load = critical_force(S, contact)
    for other, moved_to, same, turn in (
        (reversed_contacts(packing), contact, np.arange(len(packing.r)), np.eye(2)),
        (relabelled(packing, grains, order), int(np.flatnonzero(order == contact)[0]), grains,
         np.eye(2)),
        (quarter_turned(packing), contact, np.arange(len(packing.r)),
         np.array([[0, 1.0], [-1, 0]])),
    ):  # fmt: skip
        again = critical_force(other, moved_to)
        assert again.low == pytest.approx(load.low, abs=1e-6 * S.force_scale)
        assert again.high == pytest.approx(load.high, abs=1e-6 * S.force_scale)
        moved = response(other, moved_to, critical=again)
        field = moved.displacement[same]
        assert np.allclose(field, known.displacement @ turn, atol=1e-4, equal_nan=True)


def test_crystal_answers_with_the_symmetry_of_the_pair():
    # Inversion about the point of contact maps a triangular crystal and the pair onto themselves.
    packing = lattice(6, 6, 0.3, triangular=True)
    moved = response(packing, 0)
    c = packing.contacts
    centre = packing.x[c.i[0]] + c.arm_i[0] * c.normal[0]
    across = np.mod(2 * centre - packing.x, packing.box)
    apart = np.abs(across[:, None] - packing.x[None])
    apart = np.minimum(apart, packing.box - apart)
    partner = np.argmin(np.linalg.norm(apart, axis=2), axis=1)
    assert np.allclose(np.linalg.norm(apart[np.arange(36), partner], axis=1), 0, atol=1e-9)
    assert np.allclose(moved.displacement[partner], -moved.displacement, atol=1e-5)
    # The pair parts along its axis, further than any other contact opens.
    assert np.argmax(moved.opening) == 0
    assert moved.displacement[c.j[0]] @ c.normal[0] > 0
    assert abs(moved.displacement[c.j[0]] @ [-c.normal[0, 1], c.normal[0, 0]]) < 1e-5
    # As in an elastic body the answer is strongest beside the pair.
    near, far = decay.profile(packing, moved.displacement, 0, np.array([0, 1.0, 2.0, 3.0]))[[0, 2]]
    assert near > 2 * far


def test_what_cannot_be_perturbed_is_told():
    packing = packed(40, 0.5)
    S = ensemble(packing)
    with pytest.raises(InputError, match="not one of the"):
        critical_force(packing, len(packing.contacts.i))
    for precision in (0, 1e-300, 1e300):
        with pytest.raises(InputError, match="precision"):
            critical_force(S, S.index[0], precision=precision)
    with pytest.raises(InputError, match="stay at rest"):
        response(S, S.index[0], 1e-3 * S.force_scale)
    critical = critical_force(S, S.index[0])
    with pytest.raises(InputError, match="precision has no effect"):
        response(S, S.index[0], critical.high, critical=critical, precision=0.1)
    with pytest.raises(Cancelled):
        critical_force(S, S.index[0], cancel=lambda: True)


def test_no_critical_force_below_a_limit_load_that_is_not_certified():
    S = ensemble(packed(40, 0.5))
    loads = limit_load_bounds(S, S.index[:3]).load
    loads[1] = np.nan
    with pytest.raises(UndecidedError, match=f"contact {S.index[1]} "):
        critical_forces(S, S.index[:3], limit_loads=loads)


def parameters(**options):
    return kinds.PERTURBATION.parameters(kinds.PACKING.parameters(20, 0.3, 1), **options)


def test_perturbations_do_not_depend_on_workers_and_go_on_where_they_were(tmp_path):
    one, two = open_store(tmp_path / "one"), open_store(tmp_path / "two")
    whole, cached = study.get(one, kinds.PERTURBATION, parameters(random=4), workers=1)
    assert not cached
    seen = []

    def stop(done, total):
        seen.append((done, total))
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        study.get(two, kinds.PERTURBATION, parameters(random=4), workers=2, progress=stop)
    # What another thread had ended by then is kept and told as well.
    kept = sum(entry.kind == "perturbed_contact" for entry in two.entries())
    assert seen == [(k, 4) for k in range(1, kept + 1)]
    assert 2 <= kept <= 4
    again, _ = study.get(two, kinds.PERTURBATION, parameters(random=4), workers=2)
    for name in whole:
        if "seconds" not in name:
            assert np.array_equal(whole[name], again[name], equal_nan=True), name
    found, cached = study.get(two, kinds.PERTURBATION, parameters(random=4))
    assert cached
    assert found.equals(again)
    assert whole["decay_low"] <= whole["decay_high"] or np.isnan(whole["decay_low"])


def test_perturbation_parameters_are_checked():
    with pytest.raises(InputError, match="not both"):
        parameters(random=5, contacts=[1])
    with pytest.raises(InputError, match="at least 1"):
        parameters(random=0)
