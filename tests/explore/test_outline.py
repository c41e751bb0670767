"""The outline of S in a plane: against exact bounds, another solver, and known shapes."""

import numpy as np
import pytest
from packings import packed, reference
from scipy.optimize import linprog

from granforce import measures
from granforce.explore.intervals import intervals
from granforce.explore.outline import outline
from granforce.explore.random_walk import walk
from granforce.forces.build import ensemble
from granforce.records import Cancelled, InputError
from granforce.study import cells as study
from granforce.study import kinds
from granforce.study.store import open_store

NAME = "n100_mu0.1_s11"


@pytest.fixture(scope="module")
def S():
    return ensemble(reference(NAME))


@pytest.fixture(scope="module")
def states(S):
    return walk(S, 20, 0).states


@pytest.fixture(scope="module")
def axes(states):
    return measures.principal_axes(states)[0]


@pytest.fixture(scope="module")
def found(S, axes):
    return outline(S, axes)


def unit(S, *components):
    """Axes along single components (contact, 0 or 1)."""
    axes = np.zeros((2, len(S.index), 2))
    for k, component in enumerate(components):
        axes[(k, *component)] = 1.0
    return axes


def beyond(polygon, points):
    """How far points (n, 2) lie outside a convex polygon, at most."""
    edge = np.roll(polygon, -1, axis=0) - polygon
    normal = np.column_stack([edge[:, 1], -edge[:, 0]]) / np.linalg.norm(edge, axis=1)[:, None]
    return (points @ normal.T - (polygon * normal).sum(axis=1)).max()


def projected(S, axes, states):
    return np.tensordot(states, axes, ((1, 2), (1, 2))) / S.force_scale


def test_it_spans_the_exact_intervals_of_two_components():
    """Also an independent program's own: the reference packing comes with its bounds."""
    S = ensemble(reference(NAME))
    a, b = 3, 40
    found = outline(S, unit(S, (a, 0), (b, 1)), tolerance=1e-5)
    exact = intervals(S, S.index[[a, b]])
    low = np.array([exact.low[0, 0], exact.low[1, 1]]) / S.force_scale
    high = np.array([exact.high[0, 0], exact.high[1, 1]]) / S.force_scale
    for polygon in (found.inner, found.outer):
        np.testing.assert_allclose(polygon.min(axis=0), low, atol=1e-6)
        np.testing.assert_allclose(polygon.max(axis=0), high, atol=1e-6)


def test_support_lies_between_the_polygons_by_another_solver(S, axes, found):
    A, b, T = S.scaled_form
    for theta in np.random.default_rng(0).uniform(0, 2 * np.pi, 6):
        d = np.array([np.cos(theta), np.sin(theta)])
        cost = -(T.T @ S.to_vector(np.tensordot(d, axes, 1)))
        support = -linprog(cost, A_eq=A, b_eq=b, method="highs").fun
        assert (found.inner @ d).max() <= support + 1e-7
        assert (found.outer @ d).max() >= support - 1e-7
        assert (found.outer @ d).max() - (found.inner @ d).max() <= found.gap * (1 + 1e-12)


def test_it_holds_all_states_of_a_walk(S, axes, states, found):
    points = projected(S, axes, states)
    assert beyond(found.outer, points) <= 1e-8
    assert beyond(found.inner, points) <= found.gap * (1 + 1e-12)
    # The walk sees a part of S only: an outline of the states themselves would fail this.
    assert np.all(np.ptp(points, axis=0) < 0.8 * np.ptp(found.inner, axis=0))


def test_polygons_are_convex_run_left_about_and_close_on_each_other(found):
    for polygon in (found.inner, found.outer):
        edge = np.roll(polygon, -1, axis=0) - polygon
        after = np.roll(edge, -1, axis=0)
        assert (edge[:, 0] * after[:, 1] - edge[:, 1] * after[:, 0]).min() > 0
    assert beyond(found.outer, found.inner) <= 1e-8
    assert beyond(found.inner, found.outer) <= found.gap * (1 + 1e-12)
    assert found.converged and found.gap <= 1e-3 * np.ptp(found.inner, axis=0).max()


def test_finer_tolerance_costs_more_and_lies_between(S, axes, found):
    fine = outline(S, axes, tolerance=1e-5)
    assert fine.counts["directions"] > found.counts["directions"]
    assert fine.gap <= 1e-5 * np.ptp(fine.inner, axis=0).max() < found.gap
    assert beyond(found.outer, fine.inner) <= 1e-7
    assert beyond(fine.outer, found.inner) <= 1e-7


def test_turned_and_stretched_axes_turn_and_stretch_it(S, axes, found):
    turned = outline(S, 3.0 * np.stack([axes[1], -axes[0]]))
    back = np.column_stack([-turned.inner[:, 1], turned.inner[:, 0]]) / 3.0
    assert beyond(found.outer, back) <= 1e-7
    assert beyond(back, found.inner) <= turned.gap / 3 + 1e-7


def test_it_does_not_depend_on_the_number_of_threads(S, axes, found):
    again = outline(S, axes, workers=2)
    np.testing.assert_array_equal(again.inner, found.inner)
    np.testing.assert_array_equal(again.outer, found.outer)


def test_a_flat_projection_is_a_segment(S, axes, found):
    flat = outline(S, np.stack([axes[0], np.zeros_like(axes[0])]))
    assert flat.converged and np.ptp(flat.inner[:, 1]) == 0
    assert np.ptp(flat.outer[:, 1]) <= 1e-6
    assert np.ptp(flat.inner[:, 0]) == pytest.approx(np.ptp(found.inner[:, 0]), rel=1e-3)


def test_an_isostatic_packing_is_a_point():
    S = ensemble(packed(30, 0.0))
    found = outline(S, unit(S, (0, 0), (1, 0)))
    assert found.converged and found.gap <= 1e-6
    expected = S.original[:2, 0] / S.force_scale
    np.testing.assert_allclose(found.inner, np.tile(expected, (len(found.inner), 1)), atol=1e-7)


def test_cancelled_early_it_says_so(S, axes):
    told = []
    options = {"progress": lambda *a: told.append(a), "cancel": lambda: len(told) >= 2}
    cut = outline(S, axes, tolerance=1e-6, **options)
    assert not cut.converged and len(told) == 2
    assert cut.counts["directions"] == told[-1][0]
    with pytest.raises(Cancelled):
        outline(S, axes, cancel=lambda: True)


def test_progress_counts_directions(S, axes, found):
    told = []
    outline(S, axes, progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (found.counts["directions"],) * 2
    assert [done for done, _ in told] == sorted(done for done, _ in told)


@pytest.mark.parametrize("wrong", ["shape", "zero", "nan"])
def test_wrong_axes_are_refused(S, axes, wrong):
    given = {"shape": axes[:, :-1], "zero": 0 * axes, "nan": np.nan * axes}[wrong]
    with pytest.raises(InputError, match="axes"):
        outline(S, given)


def test_principal_axes_are_those_of_the_covariance(states):
    axes, share = measures.principal_axes(states)
    flat = (states - states.mean(axis=0)).reshape(len(states), -1)
    value, vector = np.linalg.eigh(flat.T @ flat)
    for k in (0, 1):
        assert abs(vector[:, -1 - k] @ axes[k].ravel()) == pytest.approx(1, abs=1e-9)
        assert axes[k].ravel()[np.abs(axes[k]).argmax()] > 0
    np.testing.assert_allclose(share, value[[-1, -2]] / value.sum(), rtol=1e-9)


def test_principal_axes_of_states_on_a_line_or_in_a_point(states):
    line = np.stack([states[0], states[1], (states[0] + states[1]) / 2])
    axes, share = measures.principal_axes(line)
    assert share == pytest.approx([1, 0]) and not axes[1].any()
    axes, share = measures.principal_axes(states[:1])
    assert not axes.any() and not share.any()


def test_the_study_keeps_the_outline_of_states_and_of_components(tmp_path):
    store = open_store(tmp_path / "store")
    made = kinds.PACKING.parameters(30, 0.3, 1)
    taken = kinds.WALK.parameters(made, 10, 0)
    states, _ = study.get(store, kinds.WALK, taken)
    axes, _ = measures.principal_axes(states["states"].values)
    named = kinds.OUTLINE.parameters(made, states=taken)
    dataset, cached = study.get(store, kinds.OUTLINE, named, axes=axes)
    assert not cached and study.get(store, kinds.OUTLINE, named)[1]
    centre = states["states"].values.mean(axis=0) / states["force_scale"].item()
    inside = np.tensordot(axes, centre, ((1, 2), (0, 1)))
    assert beyond(dataset["outer"].values, inside[None]) < 0
    assert dataset["programs"] >= 16 and dataset["outline_gap"] < 0.1
    contact = int(states["backbone"][2])
    named = kinds.OUTLINE.parameters(made, components=[(contact, 0), (contact, 1)])
    cone, _ = study.get(store, kinds.OUTLINE, named)
    normal, tangential = cone["inner"].values.T
    assert np.all(np.abs(tangential) <= 0.3 * normal + 1e-9)


def test_wrong_planes_of_an_outline_are_refused(tmp_path):
    made = kinds.PACKING.parameters(30, 0.3, 1)
    with pytest.raises(InputError, match="two components, or by states"):
        kinds.OUTLINE.parameters(made)
    named = kinds.OUTLINE.parameters(made, components=[(10**6, 0), (0, 1)])
    with pytest.raises(InputError, match="contact 1000000 is not one of"):
        study.get(open_store(tmp_path / "store"), kinds.OUTLINE, named)
