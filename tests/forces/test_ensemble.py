"""S and its judges: closed forms, invariances, reference packings."""

import numpy as np
import pytest
from packings import (
    REFERENCE,
    lattice,
    packed,
    quarter_turned,
    reference,
    relabelled,
    reversed_contacts,
    two_disks,
)
from scipy.optimize import linprog

from granforce.explore.intervals import intervals
from granforce.forces import backbone
from granforce.forces.build import ensemble
from granforce.forces.nearest import some_network
from granforce.forces.nearest_piqp import nearest_piqp
from granforce.records import NotJammedError, make_contacts, make_packing
from granforce.tolerances import SEEN_CARRYING

pytestmark = pytest.mark.fast

REFERENCES = ["n100_mu0.1_s11", "n100_mu1_s12", "n400_mu0.1_s13"]


def test_two_disks_between_their_images_have_one_network():
    S = ensemble(two_disks(pressure=3.0, height=4.0))
    forces = nearest_piqp(S, np.ones((2, 2))).forces
    # Σ f_n ℓ = 2 P V with two equal forces at ℓ = 1: f_n = P V = P · 2 · 4.
    assert np.allclose(forces, [[24.0, 0.0], [24.0, 0.0]], rtol=1e-12, atol=1e-9)
    assert S.dimension == 0
    assert S.residual(forces) < 1e-12


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_square_lattice_carries_equal_forces(mu):
    S = ensemble(lattice(4, 4, mu))
    # 2 P V = Σ f_n ℓ over 2N equal contacts with ℓ = 1 and V = N: f_n = 1.
    equal = np.zeros((32, 2))
    equal[:, 0] = 1.0
    assert S.force_scale == pytest.approx(1.0)
    assert S.residual(equal) < 1e-14
    assert S.violation(equal) == 0
    # Frictionless: each of the 8 rows of contacts carries any force of its own, one pressure.
    if mu == 0:
        assert S.dimension == 7


def test_square_lattice_row_may_carry_everything():
    S = ensemble(lattice(4, 4, 0.0))
    found = linprog(-np.eye(32)[0], A_eq=S.A.toarray(), b_eq=S.b, bounds=(0, None))
    # All 2 P V = 32 on the four contacts of one row.
    assert -found.fun == pytest.approx(8.0)


def test_triangular_lattice_carries_equal_forces():
    packing = lattice(4, 4, 0.2, triangular=True)
    S = ensemble(packing)
    equal = np.zeros((48, 2))
    equal[:, 0] = 2 * packing.volume / 48
    assert S.residual(equal) < 1e-14
    assert S.coordination == 6


@pytest.mark.parametrize("name", REFERENCES)
def test_reference_networks_are_admitted(name):
    packing = reference(name)
    S = ensemble(packing, prune=False)
    assert S.residual(packing.forces) < 1e-10
    assert S.violation(packing.forces) < 1e-10


@pytest.mark.parametrize("name", REFERENCES)
def test_backbone_is_where_the_exact_upper_bound_is_positive(name):
    packing = reference(name)
    high = np.load(REFERENCE / f"{name}.npz")["hi"][:, 0]
    without_forces = packing._replace(forces=np.zeros_like(packing.forces))
    for given in (packing, without_forces):
        S = ensemble(given)
        assert np.array_equal(S.index, np.flatnonzero(high > 1e-7))
        assert S.skipped["unloaded_contacts"] == len(high) - len(S.index)


def test_pruning_changes_no_state():
    packing = reference("n100_mu0.1_s11")
    pruned, whole = ensemble(packing), ensemble(packing, prune=False)
    target = np.ones_like(packing.forces)
    few = pruned.expand(nearest_piqp(pruned, target[pruned.index]).forces)
    # The unloaded contacts take no part: pull them to 0, where they are.
    target[np.setdiff1d(np.arange(len(target)), pruned.index)] = 0
    assert np.allclose(nearest_piqp(whole, target).forces, few, atol=1e-7)
    assert pruned.skipped["rattlers"] > 0


@pytest.mark.parametrize("given", [True, False])
def test_networks_at_hand_and_local_proofs_spare_programs_and_change_no_backbone(given):
    packing = reference("n100_mu1_s12")
    if not given:
        packing = packing._replace(forces=np.zeros_like(packing.forces))
    full = ensemble(packing, prune=False)
    known = full.original if given else some_network(full, np.zeros_like(full.original))
    idle = known[:, 0] <= SEEN_CARRYING * full.force_scale
    proved = backbone.proven_idle(full, idle, known)
    dead = backbone.cannot_balance(full, idle)
    left = backbone.not_pulled(full, known, idle & ~dead)
    assert np.array_equal(dead | backbone.proven_idle(full, left, known), proved)
    assert dead.any() and (given or left.sum() < (idle & ~dead).sum())
    assert np.array_equal(backbone.not_pulled(full, known, proved), proved)
    mask, network = backbone.carrying(full)
    assert np.array_equal(mask, ~proved) and np.array_equal(network, known)


def translated(packing):
    return packing._replace(x=np.mod(packing.x + np.array([0.3, 7.7]), packing.box))


@pytest.mark.parametrize("turn", [reversed_contacts, quarter_turned, translated, "relabelled"])
def test_states_do_not_depend_on_the_description(turn, rng):
    packing = reference("n100_mu0.1_s11")
    if turn == "relabelled":
        other = relabelled(packing, rng.permutation(len(packing.r)))
    else:
        other = turn(packing)
    start = rng.uniform(-1, 2, packing.forces.shape)
    S, T = ensemble(packing), ensemble(other)
    assert np.array_equal(S.index, T.index)
    one, two = (nearest_piqp(E, start[S.index]).forces for E in (S, T))
    assert np.abs(one - two).max() < 1e-9 * S.force_scale


def test_states_of_a_batch_are_judged_one_by_one(rng):
    S = ensemble(packed(40, 0.3))
    forces = rng.normal(size=(3, 2, len(S.index), 2))
    for judge in (S.residual, S.violation):
        assert judge(forces).shape == (3, 2)
        assert judge(forces)[1, 0] == pytest.approx(judge(forces[1, 0]))


def test_violation_measures_both_sides_of_the_cone():
    S = ensemble(packed(40, 0.3))
    forces = S.original.copy()
    forces[0] = [-0.5 * S.force_scale, 0]
    assert S.violation(forces) == pytest.approx(0.5)
    forces[0] = [S.force_scale, 0.4 * S.force_scale]
    assert S.violation(forces) == pytest.approx(0.1)


def test_missing_contact_is_told_with_the_grains_that_lack_balance():
    packing = packed(40, 0.0)
    keep = np.arange(len(packing.contacts.i)) != 3
    contacts = packing.contacts.picked(keep)
    broken = packing._replace(contacts=contacts, forces=packing.forces[keep])
    with pytest.raises(NotJammedError, match=r"largest unbalanced load: \d+ \("):
        ensemble(broken)


def test_opened_cone_holds_the_frictionless_network():
    packing = packed(40, 0.0)
    S = ensemble(packing, mu=0.4)
    assert S.mu == 0.4
    assert S.dimension > 0
    assert S.admits(S.original)


def test_a_faint_contact_that_a_load_rests_on_stays():
    """8e-8 ⟨f_n⟩ is less than what counts as carrying, but nothing balances without it."""
    faint = 4e-8
    x, r = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], np.full(3, 0.5)
    contacts = make_contacts([0, 1], [1, 2], [[1.0, 0.0], [0.0, 1.0]], [1.0, 1.0], r)
    load = np.array([[1.0, 0, 0], [-1.0, faint, 0], [0, -faint, 0]])
    forces = [[1.0, 0.0], [faint, 0.0]]
    S = ensemble(make_packing(x, r, [np.inf, np.inf], contacts, forces, 0.5, np.nan, load))
    assert len(S.index) == 2 and S.member is not None
    bounds = intervals(S)
    assert bounds.converged
    np.testing.assert_allclose(bounds.high[:, 0], [1.0, faint], atol=1e-9)


def test_frozen_contacts_drop_the_pressure_and_keep_the_balance():
    packing = packed(40, 0.3)
    frozen = np.zeros(len(packing.contacts.i), bool)
    frozen[::4] = True
    S = ensemble(packing, frozen=frozen)
    assert not S.has_pressure_row
    assert S.admits(S.original)
    assert not set(S.index) & set(np.flatnonzero(frozen))
    assert np.array_equal(S.expand(S.original)[frozen], packing.forces[frozen])
