"""Lanes: arithmetic of lanes, and of lanes with one number, is that of each lane alone."""

import numpy as np
import pytest
from numba import njit

from granforce.numerics.lanes import (
    LANES,
    MANY,
    ONE,
    ROW,
    fma,
    gather,
    larger,
    load,
    pick,
    root,
    scatter,
    store,
    total,
)


@njit(error_model="numpy")
def answered(x, factor, out, lanes):
    for k in range(len(x)):
        a = load(x, k, lanes)
        b = 1.0 / root(a) - factor * a
        store(out, k, lanes, (b + 0.25) * a / factor - (factor - a) * (a - 0.5) + b / a)


@njit(error_model="numpy")
def chosen(x, least, out, lanes):
    for k in range(len(x)):
        a = load(x, k, lanes)
        store(out, k, lanes, pick(0.5, a, -1.0, larger(fma(2.0, a, -0.75), least)))
    store(out, 0, lanes, least)


@pytest.mark.parametrize("lanes", [ONE, MANY])
def test_a_number_that_meets_lanes_stands_for_itself_in_each(lanes, rng):
    x = rng.uniform(0.1, 2.0, (50, len(lanes)))
    found = np.empty_like(x)
    answered(x, 0.3, found, lanes)
    b = 1.0 / np.sqrt(x) - 0.3 * x
    assert np.array_equal(found, (b + 0.25) * x / 0.3 - (0.3 - x) * (x - 0.5) + b / x)
    chosen(x, 0.3, found, lanes)
    wanted = np.where(x < 0.5, -1.0, np.maximum(2 * x - 0.75, 0.3))
    wanted[0] = 0.3
    assert np.array_equal(found, wanted)


@njit(error_model="numpy")
def doubled(rows, places, sums):
    for first in range(0, len(places), LANES):
        x, y, z = gather(rows, places, first, MANY)
        sums[first // LANES] = total(x)
        scatter(rows, places, first, MANY, (2.0 * x, 2.0 * y, 2.0 * z))


def test_rows_are_gathered_changed_and_put_back(rng):
    rows, sums = rng.normal(size=(40, ROW)), np.empty(2)
    before, places = rows.copy(), rng.permutation(40)[: 2 * LANES]
    doubled(rows, places, sums)
    assert sums == pytest.approx(before[places, 0].reshape(2, LANES).sum(axis=1))
    expected = before[:, :3] * np.where(np.isin(np.arange(40), places), 2, 1)[:, None]
    assert np.array_equal(rows[:, :3], expected)
