"""A network at hand is a certificate: nothing that it lies in is called empty or contradictory."""

from pathlib import Path

import numpy as np
import pytest
from campaign import linprog_bounds

import granforce as gf
from granforce.tolerances import ADMISSIBLE, BALANCED

ATTACKS = Path(__file__).parents[1] / "attacks"


def attack(name):
    return gf.load_packing(ATTACKS / f"{name}.npz")


def test_a_condition_that_is_all_rounding_empties_nothing():
    """All contacts at 45°: σ_xx − σ_yy of any network is rounding, and was scaled up to order 1."""
    S = gf.ensemble(attack("square_n5_mu0"), prescribed="stress")
    sample = gf.sample_uniform(S, 8)
    assert sample.reached and np.allclose(sample.flat, S.original, atol=1e-9 * S.force_scale)
    assert gf.intervals(S).converged
    A, b, _ = S.scaled_form
    assert np.abs(A @ S.coordinates(S.original) - b).max() <= BALANCED


@pytest.mark.parametrize("seed", range(4))
def test_what_is_known_of_an_own_state_never_contradicts_itself(seed):
    packing, rng = attack("n13_mu1e-6"), np.random.default_rng(seed)
    S = gf.ensemble(packing)
    for state in S.expand(gf.sample_uniform(S, 8, seed=seed).flat):
        held = rng.choice(S.index, 4, replace=False)
        width = np.where(rng.random((4, 2)) < 0.3, 0.0, 0.1) * np.abs(state[held])
        K = gf.ensemble(packing, known=gf.Known(held, state[held] - width, state[held] + width))
        assert K.admits(K.member) and K.admits(state[K.index])
        done = gf.walk(K, 2, 0)
        assert K.residual(done.states).max() <= BALANCED


def test_a_network_without_unbalance_to_hide_behind_is_still_refused():
    """Rows are scaled by 10⁶ here; what is out of balance by more than is admitted is told."""
    packing = attack("n13_mu1e-6")
    S = gf.ensemble(packing)
    strongest = S.index[np.argmax(S.original[:, 0])]
    beyond = 2 * gf.intervals(S, [strongest]).high[0]
    with pytest.raises(gf.NotJammedError, match=r"these conflict|no network satisfies"):
        gf.ensemble(packing, known=gf.Known([strongest], [[beyond[0], -np.inf]], [[np.inf] * 2]))


def test_bounds_at_the_largest_friction_are_those_of_other_programs():
    """μ = 10⁴: each bound is attained by a state that the judges admit, and linprog's is the same.

    With multipliers λ the other side is b·λ − W max (−s/w)₊ (`certified_values`): the gap.
    """
    S = gf.ensemble(attack("n30_mu1e4"))
    (place,) = S.positions([17])
    found = gf.intervals(S, [17])
    assert found.converged and np.all(found.gap <= 1e-8)
    ours = np.stack([found.low[0], found.high[0]], axis=1) / S.force_scale
    assert np.abs(ours - linprog_bounds(S, int(place))).max() < 1e-8
    reach = gf.reach(S, 17)
    assert S.residual(reach.states).max() <= BALANCED
    assert S.violation(reach.states).max() <= ADMISSIBLE
    assert reach.high == pytest.approx(reach.states[1, place, 0], rel=1e-9)


def test_uniform_states_under_known_forces_are_balanced():
    """μ = 10⁻⁶: what is known of f_n bounds differences of f_t by rows 5·10⁻⁸ times the largest.

    They kept an unbalance of 10⁻⁷ ⟨f_n⟩.
    """
    packing, rng = attack("n20_mu1e-6"), np.random.default_rng(2)
    S = gf.ensemble(packing)
    state = S.expand(gf.sample_uniform(S, 4, seed=2).flat[-1])
    held = rng.choice(S.index, 4, replace=False)
    width = np.where(rng.random((4, 2)) < 0.3, 0.0, 0.1) * np.abs(state[held])
    K = gf.ensemble(packing, known=gf.Known(held, state[held] - width, state[held] + width))
    sample = gf.sample_uniform(K, 8)
    assert sample.residual.max() <= BALANCED and sample.violation.max() <= ADMISSIBLE


@pytest.mark.parametrize("seed", [None, 1, 2])
def test_rows_that_all_but_follow_from_others_leave_no_unbalance(seed):
    """μ = 2·10⁻⁶: rows of the whole stress, or beside known forces, have pivots of rounding.

    Directions broke the balance by 10⁻⁴, which put states past walls, and clipped they kept an
    unbalance of up to 10⁻³ ⟨f_n⟩.
    """
    packing = attack("n30_mu2e-6")
    S = gf.ensemble(packing)
    if seed is None:
        K = gf.ensemble(packing, prescribed="stress")
    else:
        kick = np.random.default_rng(0).normal(size=S.original.shape)
        state = gf.nearest(S, S.original + S.force_scale * kick).forces
        rng = np.random.default_rng(seed)
        held = rng.choice(len(S.index), 4, replace=False)
        width = np.where(rng.random((4, 2)) < 0.5, 0, 0.1) * np.abs(state[held])
        known = gf.Known(S.index[held], state[held] - width, state[held] + width)
        K = gf.ensemble(packing, known=known)
    sample = gf.sample_uniform(K, 8, seed=seed or 0)
    assert K.dimension > 20
    assert sample.residual.max() <= BALANCED and sample.violation.max() <= ADMISSIBLE
