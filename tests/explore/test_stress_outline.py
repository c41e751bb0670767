"""The stresses that contacts can carry: references, states inside, limit cases."""

import numpy as np
import pytest
from packings import REFERENCE, lattice, packed, reference

import granforce as gf

NAME = "n100_mu0.1_s11"


@pytest.fixture(scope="module")
def S():
    return gf.ensemble(reference(NAME))


@pytest.fixture(scope="module")
def found(S):
    return gf.stress_outline(S, 16)


def beyond(found, points):
    """How far points lie outside the supports, at most."""
    directions = np.stack([np.cos(found.angles), np.sin(found.angles)])
    return (points @ directions - found.support).max()


def test_supports_agree_with_an_independent_program(S):
    answers = np.load(REFERENCE / f"{NAME}.known.npz")
    found = gf.stress_outline(S, answers["angles"])
    assert found.support == pytest.approx(answers["stress_support"], abs=1e-7)
    assert found.gap.max() <= 1e-7


def test_the_polygons_close_on_the_largest_shear(found):
    assert found.converged
    assert found.friction <= found.friction_bound <= found.friction * 1.001
    assert np.hypot(*found.inner.T).max() == pytest.approx(found.friction)
    assert found.friction >= found.support.max() - 1e-9
    assert beyond(found, found.inner) <= 1e-7


def test_own_network_and_uniform_states_lie_inside(S, found):
    states = gf.sample_uniform(S, 40, seed=2).flat
    points = gf.stress_plane(S, states)
    assert points.shape == (40, 2)
    assert beyond(found, points) < 0 and beyond(found, found.original[None]) < 0


def test_each_point_is_the_stress_of_its_network(S, found):
    (xx, yy, xy) = np.load(REFERENCE / f"{NAME}.known.npz")["stress"]
    pressure = 0.5 * (xx + yy)
    assert found.original == pytest.approx([(xx - yy) / 2 / pressure, xy / pressure], abs=1e-9)


def test_a_stress_on_the_outline_can_be_prescribed_and_none_beyond(S, found):
    a, b = found.inner[np.argmax(np.hypot(*found.inner.T))]
    packing = S.packing
    for factor, carried in ((0.999, True), (1.001, False)):
        stress = packing.pressure * np.array([1 + factor * a, 1 - factor * a, factor * b])
        if carried:
            T = gf.ensemble(packing, prescribed="stress", stress=stress)
            assert gf.nearest(T, T.original).converged
        else:
            with pytest.raises(gf.NotJammedError):
                gf.ensemble(packing, prescribed="stress", stress=stress)


def test_without_friction_there_is_one_stress():
    found = gf.stress_outline(gf.ensemble(packed(40, 0.0)), 8)
    directions = np.stack([np.cos(found.angles), np.sin(found.angles)])
    assert found.support == pytest.approx(found.original @ directions, abs=1e-6)
    assert found.friction == pytest.approx(np.hypot(*found.original), abs=1e-6)


def test_a_square_lattice_carries_any_difference_of_normal_stresses():
    """Rows and columns carry on their own; at μ = 0 they can carry no σ_xy."""
    found = gf.stress_outline(gf.ensemble(lattice(4, 4, 0.0)), 4)
    assert found.support == pytest.approx([1.0, 0.0, 1.0, 0.0], abs=1e-6)
    assert found.friction == pytest.approx(1.0, abs=1e-6)


def test_what_is_known_makes_the_outline_smaller(S, found):
    own = S.packing.forces[S.index[::20]]
    K = gf.ensemble(S.packing, known=gf.Known(S.index[::20], own, own))
    less = gf.stress_outline(K, 16)
    assert np.all(less.support <= found.support + 1e-7)
    assert less.friction < found.friction
    points = gf.stress_plane(K, gf.sample_uniform(K, 8, 2).flat)
    assert beyond(less, points) <= 1e-9


def test_conditions_without_outline_are_told(S):
    with pytest.raises(gf.InputError, match="whole stress is prescribed"):
        gf.stress_outline(gf.ensemble(S.packing, prescribed="stress"))
    with pytest.raises(gf.InputError, match="at a prescribed pressure"):
        gf.stress_outline(gf.ensemble(S.packing, frozen=np.arange(0, 164, 4)))
    with pytest.raises(gf.InputError, match="number of angles"):
        gf.stress_outline(S, 0)


def test_a_cancelled_outline_gives_no_stress(S, monkeypatch):
    drawn = []

    def outline(*arguments, **options):
        drawn.append(gf.outline(*arguments, **options))
        return drawn[0]._replace(inner=np.empty((0, 2)), converged=False)

    monkeypatch.setattr("granforce.explore.stress_outline.outline", outline)
    with pytest.raises(gf.Cancelled):
        gf.admissible_stress(S, cancel=lambda: bool(drawn))
