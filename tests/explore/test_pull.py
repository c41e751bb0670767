"""Pulling one contact: references, optimality, exact ends, refusals."""

import numpy as np
import pytest
from packings import REFERENCE, packed, reference, two_disks

import granforce as gf
from granforce.explore.intervals import intervals
from granforce.tolerances import ADMISSIBLE, BALANCED

pytestmark = pytest.mark.fast

NAME = "n100_mu0.1_s11"


@pytest.fixture(scope="module")
def S():
    return gf.ensemble(reference(NAME))


def test_pulled_networks_agree_with_an_independent_program(S):
    known = np.load(REFERENCE / f"{NAME}.known.npz")
    found = gf.pull(S, known["pulled"], known["pull_values"])
    expected = known["pull_states"][:, S.index]
    assert np.abs(found.states - expected).max() < 1e-5 * S.force_scale


@pytest.mark.parametrize("mu", [0.0, 0.01, 0.3, 10.0])
def test_every_value_between_the_ends_is_reached_and_both_ends(mu):
    S = gf.ensemble(packed(40, mu)) if mu else gf.ensemble(packed(40, 0.0), mu=0.4)
    for contact in S.index[::11]:
        reach = gf.reach(S, contact)
        values = np.linspace(reach.low, reach.high, 11)
        found = gf.pull(S, contact, values)
        assert found.residual.max() <= BALANCED and found.violation.max() <= ADMISSIBLE
        (position,) = S.positions([contact])
        width = reach.high - reach.low
        assert np.array_equal(found.values, found.states[:, position, 0])
        assert found.values == pytest.approx(values, abs=1e-4 * width + 1e-6 * S.force_scale)
        assert found.values[1:-1] == pytest.approx(values[1:-1], abs=1e-6 * S.force_scale)


def test_no_state_lies_ahead_of_the_nearest(S):
    """The nearest point of a convex set: none lies ahead of it, towards the state.

    Others with the same f_n come from mixing two networks, one with more and one with less.
    """
    contact = 50
    (position,) = S.positions([contact])
    reach = gf.reach(S, contact)
    value = 0.3 * reach.low + 0.7 * reach.high
    found = gf.pull(S, contact, value)
    nearest = found.states[0]
    for seed in range(5):
        low, high = gf.sample_uniform(S, 2, 2, seed=seed).flat[:2], reach.states
        for one in low:
            other = high[1] if one[position, 0] < value else high[0]
            part = (value - one[position, 0]) / (other[position, 0] - one[position, 0])
            mixed = one + part * (other - one)
            ahead = np.sum((S.original - nearest) * (mixed - nearest))
            assert ahead <= 1e-6 * S.force_scale**2


def test_the_state_it_starts_from_counts(S):
    one = gf.sample_uniform(S, 1, 1, seed=3).flat[0]
    contact = 20
    (position,) = S.positions([contact])
    stay = gf.pull(S, contact, one[position, 0], one)
    assert np.abs(stay.states[0] - one).max() < 1e-6 * S.force_scale
    away = gf.pull(S, contact, one[position, 0])
    assert np.abs(away.states[0] - one).max() > 0.1 * S.force_scale


def test_values_do_not_know_their_company(S):
    reach = gf.reach(S, 50)
    values = np.linspace(reach.low, reach.high, 12)[1:-1]
    together = gf.pull(S, 50, values).states
    for k in (0, 4, 9):
        assert np.array_equal(gf.pull(S, 50, values[k]).states[0], together[k])


def test_the_ends_are_the_exact_bounds(S):
    contacts = S.index[[3, 60, 100]]
    bounds = intervals(S, contacts)
    for contact, low, high in zip(contacts, bounds.low, bounds.high, strict=True):
        reach = gf.reach(S, contact)
        assert (reach.low, reach.high) == pytest.approx((low[0], high[0]), abs=3e-8)
        assert reach.gap.max() <= 1e-8
        assert np.all(S.residual(reach.states) <= BALANCED)


def test_what_holds_a_contact_at_its_ends_is_open_or_slides(S):
    reach = gf.reach(S, 162)
    for opened, sliding, state in zip(reach.opened, reach.sliding, reach.states, strict=True):
        assert opened.any() or sliding.any()
        assert np.all(state[opened, 0] <= 1e-6 * S.force_scale)
        slips = sliding != 0
        assert np.sign(state[slips, 1]) == pytest.approx(sliding[slips])
        assert np.abs(state[slips, 1]) == pytest.approx(S.mu * state[slips, 0], abs=1e-6)


@pytest.mark.parametrize("beyond", [1e-6, 1e-3, 1e3])
def test_values_outside_are_refused_with_the_interval(S, beyond):
    reach = gf.reach(S, 162)
    for value in (reach.low - beyond, reach.high + beyond):
        with pytest.raises(gf.InputError, match=r"exact interval, 3\.32498\d* to 6\.09518"):
            gf.pull(S, 162, [0.5 * (reach.low + reach.high), value])


def test_a_contact_that_carries_nothing_cannot_be_pulled(S):
    idle = np.setdiff1d(np.arange(len(S.packing.contacts.i)), S.index)[0]
    with pytest.raises(gf.InputError, match="not one of the 159 that carry"):
        gf.pull(S, idle, 1.0)


def test_where_s_is_one_point_nothing_moves():
    S = gf.ensemble(two_disks())
    one = gf.nearest(S, np.ones((2, 2))).forces
    assert np.allclose(gf.pull(S, 0, one[0, 0]).states[0], one, atol=1e-8)
    with pytest.raises(gf.InputError, match="exact interval"):
        gf.pull(S, 0, 1.1 * one[0, 0])


def test_a_force_pulled_to_zero_has_no_friction_left(S):
    (position,) = S.positions([3])
    for contact in S.index:
        reach = gf.reach(S, contact)
        if reach.low < 1e-9:
            break
    (position,) = S.positions([contact])
    found = gf.pull(S, contact, 0.01 * reach.high)
    assert abs(found.states[0, position, 1]) <= S.mu * 0.01 * reach.high * (1 + 1e-12)


def test_what_is_known_of_other_contacts_is_kept(S):
    held, pulled = S.index[[3, 8]], S.index[20]
    value = S.original[[3, 8], 0]
    sides = np.array([[value[0], -np.inf], [0.9 * value[1], -np.inf]])
    known = gf.Known(held, sides, np.where(np.isfinite(sides), value[:, None], np.inf))
    T = gf.ensemble(S.packing, known=known)
    reach = gf.reach(T, pulled)
    middle = 0.3 * reach.low + 0.7 * reach.high
    found = gf.pull(T, pulled, middle)
    assert found.residual[0] <= BALANCED and found.violation[0] <= ADMISSIBLE
    assert abs(found.states[0, 3, 0] - value[0]) < 1e-9 * S.force_scale
    assert (0.9 - 1e-9) * value[1] <= found.states[0, 8, 0] <= (1 + 1e-9) * value[1]
    # A contact whose force is known has one value.
    assert np.allclose(gf.pull(T, held[0], value[0]).states[0, 3, 0], value[0])
