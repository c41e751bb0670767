"""Rails: networks between the exact bounds of one contact's force."""

import numpy as np
import pytest
from packings import packed

from granforce.explore.intervals import intervals
from granforce.explore.pull import pull
from granforce.forces.build import ensemble
from granforce.live import pulls
from granforce.live.pulls import Puller
from granforce.numerics.lanes import LANES
from granforce.perturb.critical_force import critical_force
from granforce.records import InputError
from granforce.tolerances import ADMISSIBLE, BALANCED


@pytest.fixture(scope="module")
def S():
    return ensemble(packed(40, 0.3))


@pytest.fixture(scope="module")
def puller(S):
    return Puller(S.packing, S.mu)


def test_a_rail_goes_from_bound_to_bound_through_admissible_networks(S, puller):
    contact = int(S.index[7])
    rail, bounds = puller.rail(contact, S.original), intervals(S, [contact])
    assert rail.low == pytest.approx(bounds.low[0, 0], abs=1e-7 * S.force_scale)
    assert rail.high == pytest.approx(bounds.high[0, 0], abs=1e-7 * S.force_scale)
    assert np.all(np.diff(rail.values) > 0)
    np.testing.assert_array_equal(rail.states[:, 7, 0], rail.values)
    halfway = (rail.states[1:] + rail.states[:-1]) / 2  # what a page shows in between
    for states in (rail.states, halfway):
        assert S.residual(states).max() <= BALANCED and S.violation(states).max() <= ADMISSIBLE


def test_rails_of_many_contacts_have_fewer_stops_and_the_same_bounds(S, puller):
    contact = int(S.index[7])
    whole = puller.rail(contact, S.original)
    rail = puller.rail(contact, S.original, many=True)
    assert (rail.low, rail.high) == (whole.low, whole.high)
    assert len(rail.values) <= pulls.FEW_STOPS + 1 < len(whole.values)
    width = rail.high - rail.low
    np.testing.assert_allclose(rail.values[[0, -1]], [rail.low, rail.high], atol=1.1e-4 * width)
    halfway = (rail.states[1:] + rail.states[:-1]) / 2
    for states in (rail.states, halfway):
        assert S.residual(states).max() <= BALANCED and S.violation(states).max() <= ADMISSIBLE


def test_a_part_of_a_rail_comes_first_and_threads_change_nothing(S, puller):
    contact = int(S.index[7])
    part, rail = puller.rails(contact, S.original, many=True)
    assert not part.whole and rail.whole and (part.low, part.high) == (rail.low, rail.high)
    kept = np.isin(rail.values, part.values)
    assert kept.tolist() == [False, *[True] * len(part.values), False]
    np.testing.assert_array_equal(part.states, rail.states[kept])
    between = np.linspace(part.values[0], part.values[-1], LANES + 2)  # more than go side by side
    beside, threads = (pull(S, contact, between, workers=workers) for workers in (1, 2))
    np.testing.assert_array_equal(threads.states, beside.states)
    alone = [pull(S, contact, value).states[0] for value in between]
    np.testing.assert_array_equal(alone, beside.states)


def test_the_network_itself_is_on_its_rail(S, puller):
    rail = puller.rail(int(S.index[7]), S.original)
    here = np.abs(rail.values - S.original[7, 0]).argmin()
    assert np.abs(rail.states[here] - S.original).max() < 1e-7 * S.force_scale


def test_what_holds_a_force_at_its_bound_is_named(S, puller):
    rail = puller.rail(int(S.index[7]), S.original)
    for end in (0, 1):
        state = rail.states[-end]
        assert np.all(state[rail.opened[end], 0] < 1e-3 * S.force_scale)
        assert rail.opened[end].any() or rail.sliding[end].any()


def test_pulls_one_after_the_other_start_where_the_last_one_ended(S, puller):
    first, residual = puller.at(int(S.index[7]), S.original[7, 0] * 1.05, S.original)
    assert residual <= BALANCED and first[7, 0] == pytest.approx(1.05 * S.original[7, 0])
    rail = puller.rail(int(S.index[3]), first)
    here = np.abs(rail.values - first[3, 0]).argmin()
    assert np.abs(rail.states[here] - first).max() < 1e-7 * S.force_scale


def test_a_contact_gives_way_below_its_limit_load_from_any_network(S, puller):
    contact, critical = int(S.index[7]), critical_force(S, int(S.index[7]))
    other = puller.rail(contact, S.original).states[-1]
    for state in (S.original, other):
        found = puller.given_way(contact, state, critical.limit_load)
        assert found.critical.low <= critical.limit_load * (1 + 1e-9)
        np.testing.assert_allclose(found.under.states[0], state, atol=1e-6 * S.force_scale)
        assert found.under.loads[-1] == found.critical.low
        assert found.under.residual.max() <= BALANCED
        assert found.motion.converged and np.nanmax(np.abs(found.motion.displacement)) > 0
        if state is S.original:
            assert found.critical.low == critical.low


def test_a_force_that_cannot_be_is_refused_with_its_interval(S, puller):
    with pytest.raises(InputError, match="outside its exact interval"):
        puller.at(int(S.index[7]), 1e3 * S.force_scale, S.original)
