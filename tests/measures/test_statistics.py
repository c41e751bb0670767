"""Statistics against known distributions."""

import numpy as np
import pytest
from scipy import stats

from granforce.measures import statistics


def test_mean_intervals_cover_as_often_as_they_say(rng):
    hits = 0
    for _ in range(400):
        _, low, high = statistics.mean_interval(rng.normal(3, 2, 6))
        hits += low <= 3 <= high
    assert 0.92 <= hits / 400 <= 0.98  # 2.7 standard errors around 0.95
    assert statistics.mean_interval([2.0, np.nan])[0] == 2
    assert np.isnan(statistics.mean_interval([2.0])[1:]).all()
    assert np.isnan(statistics.mean_interval([])).all()


def test_bootstrap_resamples_each_group(rng):
    groups = [rng.normal(5, 1, 30), rng.normal(2, 1, 30)]

    def gap(a, b):
        return np.mean(a) - np.mean(b)

    value, low, high = statistics.bootstrap(gap, groups)
    assert value == gap(*groups)
    assert low < 3 < high
    expected = 1.96 * np.sqrt(groups[0].var() / 30 + groups[1].var() / 30)
    assert (high - low) / 2 == pytest.approx(expected, rel=0.15)
    assert statistics.bootstrap(gap, groups) == (value, low, high)
    alone = statistics.bootstrap(gap, [[1.0], [3.0]])
    assert alone[0] == -2 and np.isnan(alone[1:]).all()


@pytest.mark.parametrize("b", [0.6, 1.0, 2.0])
@pytest.mark.parametrize("quantile", [0.0, 0.5])
def test_tail_exponents_of_weibull_tails(rng, b, quantile):
    values = 7 * rng.weibull(b, 20_000)
    assert statistics.tail_exponent(values, quantile) == pytest.approx(b, rel=0.07)


def test_a_tail_needs_values():
    assert np.isnan(statistics.tail_exponent([]))
    assert np.isnan(statistics.tail_exponent(np.zeros(50)))
    assert np.isnan(statistics.tail_exponent(np.arange(12.0)))


def test_values_are_grouped_in_order_of_friction():
    rows = [{"mu": 1, "a": 5.0}, {"mu": 0, "a": 2.0}, {"mu": 1, "a": np.nan}, {"mu": 3}]
    found = statistics.grouped(rows, "a")
    assert list(found) == [0, 1]
    assert found[1].tolist() == [5]


def test_density_is_normed_by_all_values():
    assert statistics.density(np.array([0.1, 0.2, 9.0, 9.0]), [0, 0.5]).tolist() == [1.0]


def test_a_jackknife_of_the_mean_is_its_interval(rng):
    values = list(rng.normal(3, 2, 7))
    told = statistics.jackknife(np.mean, values, 0.9)
    np.testing.assert_allclose(told, statistics.mean_interval(values, 0.9))
    assert np.isnan(statistics.jackknife(np.mean, [1.0])[1:]).all()


def test_drawn_means_have_the_percentiles_of_students_interval(rng):
    """For few packings, too; a bootstrap of three would end at less than half of that."""
    groups = [rng.normal(5, 2, 3), rng.normal(0, 1, 50)]
    drawn = statistics.drawn_means(groups, draws=20_000)
    for means, group in zip(drawn.T, groups, strict=True):
        low, high = statistics.percentile_interval(means)
        value, *ends = statistics.mean_interval(group)
        np.testing.assert_allclose([low, high], ends, atol=0.05 * (ends[1] - ends[0]))
        assert means.mean() == pytest.approx(value, abs=0.1 * (ends[1] - ends[0]))
    # Components of one item are drawn jointly; a single packing does not vary.
    values = rng.normal(size=(10, 1)) * [1.0, -2.0]
    both = statistics.drawn_means([values, values[:1]], draws=50)
    np.testing.assert_allclose(both[:, 0, 1], -2 * both[:, 0, 0], atol=1e-12)
    assert (both[:, 1] == values[0]).all()


def test_a_stratified_mean_has_no_part_of_the_differences_between_groups(rng):
    values = rng.normal(0, 1, (3, 8))
    one = statistics.stratified_interval(values[:1])
    np.testing.assert_allclose(one, statistics.mean_interval(values[0]))
    apart = statistics.stratified_interval(values + np.array([[0.0], [50.0], [100.0]]))
    together = statistics.stratified_interval(values)
    np.testing.assert_allclose(np.subtract(apart, together), 50)
    assert together[0] == pytest.approx(values.mean())
    assert np.isnan(statistics.stratified_interval([[1.0], [2.0, 3.0]])[1:]).all()


def test_the_departure_from_a_falling_density_needs_no_bins(rng):
    falling = rng.exponential(1.0, 20_000)
    assert statistics.departure(falling) < 0.01
    assert statistics.departure(np.r_[np.zeros(5000), falling]) < 0.01  # an atom at 0 falls, too
    raised = rng.weibull(2.0, 20_000)
    # Ĉ leaves F on the tangent through 0: at x with F(x) = x P(x).
    assert statistics.departure(raised) == pytest.approx(0.112, abs=0.01)
    assert statistics.departure(7 * raised) == pytest.approx(statistics.departure(raised))
    assert statistics.departure(np.full(10, 3.0)) == 1
    assert statistics.departure(np.zeros(10)) == 0


def test_chance_exceeds_its_departure_as_often_as_it_says(rng):
    for draw, most in ((rng.random, 0.08), (rng.exponential, 0.02)):
        exceeds = [
            statistics.departure(draw(size=400)) > statistics.chance_departure(400)
            for _ in range(500)
        ]
        assert np.mean(exceeds) < most
    uniform = [
        statistics.departure(rng.random(400)) > statistics.chance_departure(400, 0.5)
        for _ in range(500)
    ]
    assert 0.4 < np.mean(uniform) < 0.6


def test_values_of_one_packing_count_for_less_where_packings_differ(rng):
    alike = [rng.random(300) for _ in range(20)]
    assert statistics.effective_number(alike) == pytest.approx(6000, rel=0.4)
    apart = [width * values for width, values in zip(np.linspace(0.5, 2, 20), alike, strict=True)]
    assert statistics.effective_number(apart) < 600
    assert np.isnan(statistics.effective_number(alike[:1]))


def test_ranks_are_spearmans(rng):
    x, y = rng.normal(size=(2, 12))
    y[3] = y[4]
    assert statistics.rank_correlation(x, y) == pytest.approx(stats.spearmanr(x, y).statistic)


def test_the_interval_of_a_difference_is_welchs(rng):
    one, other = rng.normal(2, 1, 12), rng.normal(1, 3, 30)
    difference, low, high = statistics.difference_interval(one, other, 0.9)
    ends = stats.ttest_ind(one, other, equal_var=False).confidence_interval(0.9)
    np.testing.assert_allclose((low, high), ends, rtol=1e-12)
    assert difference == pytest.approx(one.mean() - other.mean())
    assert statistics.difference_interval(np.ones(3), np.zeros(3)) == (1, 1, 1)


def test_a_power_law_and_an_exponential_are_told_apart():
    r = np.geomspace(2, 20, 12)
    power, exponential = statistics.decay_misfits(r, 3 * r**-1.5)
    assert power < 1e-12 and exponential > 0.1
    power, exponential = statistics.decay_misfits(r, np.exp(-r / 4))
    assert exponential < 1e-12 and power > 0.1
    assert np.isnan(statistics.decay_misfits(r[:2], r[:2])).all()
