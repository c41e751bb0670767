"""How motion decays with distance: shells, distances, and the exponent of known profiles."""

import numpy as np
import pytest
from packings import lattice, packed

from granforce.perturb import decay


def test_distances_are_those_of_the_nearest_images():
    packing = packed(30, 0.3)
    distance = decay.distances(packing, 2)
    c = packing.contacts
    assert distance[c.i[2]] == pytest.approx(packing.r[c.i[2]], rel=1e-6)
    assert distance[c.j[2]] == pytest.approx(packing.r[c.j[2]], rel=1e-6)
    assert distance.max() <= np.hypot(*packing.box) / 2


def test_shells_count_grains_by_the_nearest_image():
    packing = lattice(8, 8, 0.3)
    edges = np.array([0.0, 1.0, 2.0, 3.0])
    field = np.ones((64, 2)) / np.sqrt(2)
    assert np.allclose(decay.profile(packing, field, 0, edges), 1)
    # The two grains of the pair alone lie within a radius of the contact.
    field[:] = np.nan
    field[[packing.contacts.i[0], packing.contacts.j[0]]] = [0, 3.0]
    near, far, farther = decay.profile(packing, field, 0, edges)
    assert near == 3
    assert np.isnan([far, farther]).all()


def test_the_decay_exponent_is_that_of_a_power_law():
    radius = np.linspace(0.5, 12, 24)
    profiles = np.array([1.0, 2.5])[:, None] * radius**-0.7
    assert decay.decay_exponent(radius, profiles, 2, 10) == pytest.approx(0.7)
    assert np.isnan(decay.decay_exponent(radius, profiles, 2, 2.1))


def test_the_fit_of_a_power_law_is_sure():
    packing = packed(30, 0.3)
    radius = np.linspace(0.05, 1, 60) * packing.box.min() / 2
    found = decay.decay(packing, radius, np.array([1.0, 2.5, 4.0])[:, None] * radius**-0.7)
    assert found.exponent == pytest.approx(0.7)
    assert (found.low, found.high) == (pytest.approx(0.7), pytest.approx(0.7))
    fitted = found.exponents[np.isfinite(found.exponents)]
    assert len(fitted) > 0 and np.allclose(fitted, 0.7)
    assert found.ranges.shape == (len(found.exponents), 2)
