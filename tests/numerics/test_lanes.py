"""Lanes: arithmetic of lanes, and of lanes with one number, is that of each lane alone."""

import numpy as np
import pytest
from numba import njit

from granforce.numerics.lanes import MANY, ONE, fma, larger, load, pick, root, store


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
