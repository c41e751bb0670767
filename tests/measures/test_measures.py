"""Measures against their definitions, pair by pair."""

import itertools

import numpy as np
import pytest

from granforce import measures
from granforce.records import InputError

pytestmark = pytest.mark.fast


@pytest.fixture
def states(rng):
    return rng.normal(1.0, 0.3, (7, 5, 2))


def test_eta1_by_its_definition(states):
    mean = states.mean(axis=0)
    spread = [np.sqrt(np.mean([np.sum((s[c] - mean[c]) ** 2) for s in states])) for c in range(5)]
    expected = np.mean(spread) / np.mean([np.hypot(*g) for g in mean])
    assert measures.eta1(states) == pytest.approx(expected)


def test_eta2_over_all_pairs(states):
    pairs = itertools.combinations(states, 2)
    mean_square = np.mean([np.sum((a - b) ** 2) for a, b in pairs])
    expected = np.sqrt(mean_square / np.sum(states.mean(axis=0) ** 2))
    assert measures.eta2(states) == pytest.approx(expected)


def test_eta3_of_intervals():
    low = np.array([[1.0, -1.0], [0.0, 0.0]])
    high = np.array([[3.0, 1.0], [2.0, 0.0]])
    # lengths 2, 2, 2, 0; middles 2, 0, 1, 0
    assert measures.eta3(low, high) == pytest.approx(6 / 3)
    for call in (
        lambda: measures.eta3(low, high[:1]),
        lambda: measures.correlation(low[:1, 0], high[:, 0] - low[:, 0]),
    ):
        with pytest.raises(InputError, match="take both from one packing"):
            call()


def test_one_state_is_fully_determined(states):
    one = np.repeat(states[:1], 4, axis=0)
    assert measures.eta1(one) == measures.eta2(one) == 0
    assert measures.eta2(states[:1]) == 0
    assert measures.eta3(*measures.sampled_intervals(one)) == 0


def test_measures_do_not_depend_on_the_unit_of_force(states):
    for eta in (measures.eta1, measures.eta2):
        assert eta(1e9 * states) == pytest.approx(eta(states))


def test_growing_measures_are_those_of_the_first_states(states):
    growing = measures.growing(states)
    for count in (1, 2, 7, len(states)):
        first = states[:count]
        wanted = measures.eta1(first), measures.eta2(first)
        wanted += (measures.eta3(*measures.sampled_intervals(first)),)
        assert [growing[name][count - 1] for name in ("eta1", "eta2", "eta3")] == pytest.approx(
            wanted, rel=1e-9, abs=1e-15
        )


def test_growing_measures_do_not_depend_on_the_array_of_a_state(states):
    growth, buffer = measures.Growth(), np.empty_like(states[0])
    for state in states:
        buffer[:] = state
        found = growth.add(buffer)
    assert found == tuple(values[-1] for values in measures.growing(states).values())


def test_growing_measures_of_one_state_are_zero(states):
    growing = measures.growing(np.repeat(states[:1], 4, axis=0))
    assert not np.any([growing["eta1"], growing["eta2"], growing["eta3"]])


def test_correlation_and_its_range(states):
    low, high = measures.sampled_intervals(states)
    extent = measures.normal_extent(low, high)
    forces = states[0, :, 0]
    expected = np.corrcoef(forces, extent)[0, 1]
    assert measures.correlation(forces, extent) == pytest.approx(expected)
    least, most = measures.correlation_range(states, extent)
    assert least <= expected <= most
    assert np.isnan(measures.correlation(forces, np.zeros(5)))


def test_distances_from_the_centre(states):
    centre = measures.mean_network(states)
    expected = [np.linalg.norm((s - centre).ravel()) for s in states]
    assert measures.distances(states, centre) == pytest.approx(expected)


def test_clusters_are_connected_through_grains():
    # Contacts 0–1 and 1–2 share grain 1; 3–4 stands apart; 2–3 is determined.
    i, j = np.array([0, 1, 3, 2]), np.array([1, 2, 4, 3])
    extent = np.array([[1.0, 0.0], [0.0, 0.5], [0.2, 0.0], [1e-9, 1e-9]])
    label, sizes = measures.undetermined_clusters(i, j, extent, 1e-6)
    assert label.tolist() == [0, 0, 1, -1]
    assert sizes.tolist() == [2, 1]
    label, sizes = measures.undetermined_clusters(i, j, 0 * extent, 1e-6)
    assert label.tolist() == [-1] * 4
    assert len(sizes) == 0


def test_position_in_the_interval():
    low, high = np.array([[1.0, 0], [0, 0], [2, 0]]), np.array([[3.0, 0], [1, 0], [2, 0]])
    position = measures.position_in_interval(np.array([1.5, 1.0, 2.0]), low, high)
    assert position[:2].tolist() == [0.25, 1.0]
    assert np.isnan(position[2])


def test_bounds_in_the_wrong_order_are_refused():
    low, high = np.array([[1.0, -1.0], [0.0, 0.0]]), np.array([[3.0, 1.0], [2.0, 0.0]])
    for call in (
        lambda: measures.eta3(high, low),
        lambda: measures.normal_extent(high, low),
        lambda: measures.position_in_interval(low[:, 0], high, low),
    ):
        with pytest.raises(InputError, match="give low before high"):
            call()
    rounded = high + 1e-8  # of a determined force both bounds are one, to rounding
    assert measures.eta3(rounded, high) == pytest.approx(0, abs=1e-6)
    assert np.isnan(measures.eta3(low * [[np.nan, 1]], high))  # not all were computed


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda m, s: m.eta3(1.0, 2.0), "two arrays"),
        (lambda m, s: m.eta3(s[:0, 0], s[:0, 0]), "two arrays"),
        (lambda m, s: m.normal_extent(s, s), "two arrays"),
        (lambda m, s: m.eta3(s[0], s[0] * np.inf), "finite"),
        (lambda m, s: m.distances(s[0], s), "states must have shape"),
        (lambda m, s: m.distances(s, s[0, 0]), "centre must have shape"),
        (lambda m, s: m.position_in_interval(s[0, :2, 0], s[0], s[0]), "normal forces"),
        (lambda m, s: m.principal_axes(s, -1), "number of axes must be at least 1"),
        (lambda m, s: m.principal_axes(s, 10**9), "number of axes must be at most 10"),
        (lambda m, s: m.principal_axes(s, 1.5), "whole number"),
        (lambda m, s: m.undetermined_clusters([0, 1], [1, 2], s[0], 1e-6), "one list"),
        (lambda m, s: m.undetermined_clusters([0, 1], [1, 2], s[0, :2, 0], 1e-6), "one list"),
    ],
)
def test_arrays_of_other_shapes_are_refused_in_one_line(states, call, words):
    with pytest.raises(InputError, match=words):
        call(measures, states)


def test_intervals_seen_in_lists_are_those_in_arrays(states):
    for one, other in zip(
        measures.sampled_intervals(states.tolist()), measures.sampled_intervals(states), strict=True
    ):
        np.testing.assert_array_equal(one, other)
