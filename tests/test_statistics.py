"""Statistics against known distributions."""

import numpy as np
import pytest

from granforce import statistics


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
