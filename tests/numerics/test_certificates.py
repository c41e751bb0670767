"""Verdicts about S are proved from A and b, whatever the solvers say of their results."""

import highspy
import numpy as np
import pytest
from packings import lattice, packed

import granforce as gf
from granforce.numerics import certificates
from granforce.numerics import highs as programs
from granforce.numerics.inner_point import inner_point
from granforce.records import InputError, NotJammedError, UndecidedError

STATUS = highspy.HighsModelStatus


@pytest.fixture(scope="module")
def S():
    return gf.ensemble(packed(40, 0.3))


def torn(packing):
    """The packing with a load on one of its grains that nothing in a periodic box can answer."""
    load = np.zeros_like(packing.load)
    load[packing.contacts.i[0], 0] = packing.pressure
    return gf.ensemble(packing._replace(load=load), prune=False)


def test_an_empty_ensemble_has_a_ray_and_another_has_none(S):
    A, b, _ = torn(S.packing).scaled_form
    ray = certificates.empty_ray(A, b)
    assert (A.T @ ray).max() <= 1e-12 * np.abs(ray).max()
    assert b @ ray > 1e-3 * np.abs(ray).max()
    assert certificates.empty_ray(*S.scaled_form[:2]) is None


def test_no_other_vector_passes_for_a_ray(S):
    A, b, _ = gf.ensemble(S.packing, prune=False).scaled_form
    rng = np.random.default_rng(0)
    for _ in range(100):
        assert not certificates.proves_empty(A, b, rng.standard_normal(len(b)))
    ray = certificates.empty_ray(*torn(S.packing).scaled_form[:2])
    assert not certificates.proves_empty(A, b, ray)
    A, b, _ = torn(S.packing).scaled_form
    for wrong in (-ray, np.full_like(ray, np.nan), ray + 1e-6 * rng.standard_normal(len(ray))):
        assert not certificates.proves_empty(A, b, wrong)


def test_forces_are_bounded_by_the_pressure_and_by_nothing_else(S):
    A, _, _ = S.scaled_form
    assert certificates.recession(A) is None
    assert (A.T @ certificates.bounding_rows(A)).min() > 0
    free = A[:-1]  # without the pressure any network may grow
    direction = certificates.recession(free)
    assert direction.min() >= 0 and direction.sum() == pytest.approx(1)
    assert np.abs(free @ direction).max() <= 1e-13
    assert certificates.bounding_rows(free) is None


@pytest.mark.parametrize("mu, seed", [(0.1, 1), (0.1, 2), (0.3, 3), (1.0, 1)])
def test_small_ensembles_are_sampled_on_every_machine(mu, seed):
    sample = gf.sample_uniform(gf.ensemble(packed(40, mu, seed)), 8)
    assert sample.residual.max() <= 1e-10


def saying(monkeypatch, verdicts, spoil=lambda y: y):
    """Have the first solves end with the given verdicts instead of their own."""
    solve, left = programs.solve, iter(verdicts)

    def told(model):
        status, y = solve(model)
        verdict = next(left, None)
        return (status, y) if verdict is None else (verdict, spoil(y))

    monkeypatch.setattr(programs, "solve", told)


@pytest.mark.parametrize("verdict", [STATUS.kUnknown, STATUS.kInfeasible, STATUS.kUnbounded])
def test_where_one_solver_gives_up_another_goes_on(S, monkeypatch, verdict):
    saying(monkeypatch, [verdict, verdict])
    A, b, _ = S.scaled_form
    inside, held, _ = inner_point(A, b)
    assert np.abs(A @ inside - b).max() <= 1e-8 and inside.min() > 0 and not held.any()


@pytest.mark.parametrize("verdict", [STATUS.kUnknown, STATUS.kInfeasible, STATUS.kUnbounded])
def test_where_all_give_up_nothing_is_claimed(S, monkeypatch, verdict):
    saying(monkeypatch, [verdict] * 10**4, np.zeros_like)
    with pytest.raises(UndecidedError, match="undecided") as caught:
        inner_point(*S.scaled_form[:2])
    assert not isinstance(caught.value, NotJammedError)
    # A proof stands whatever the solver that proposed it says of itself.
    with pytest.raises(NotJammedError, match="largest unbalanced load"):
        gf.ensemble(S.packing, mu=1e-3)


def test_what_is_empty_is_called_so_and_what_is_unbounded_too(S):
    with pytest.raises(NotJammedError, match="no admissible force network"):
        gf.sample_uniform(torn(S.packing), 8)
    with pytest.raises(NotJammedError, match="largest unbalanced load"):
        gf.ensemble(lattice(4, 4, 0.3)._replace(load=torn(lattice(4, 4, 0.3)).packing.load))
    loose = gf.ensemble(S.packing._replace(pressure=np.nan), prune=False)
    with pytest.raises(InputError, match="not bounded"):
        gf.sample_uniform(loose)
    assert np.isposinf(gf.intervals(loose).high[:, 0]).all()


@pytest.mark.parametrize("mu, seed", [(0.0, 2), (0.1, 1), (0.3, 0), (0.3, 5), (10.0, 3)])
def test_what_carries_does_not_depend_on_the_network_that_is_known(mu, seed):
    packing = packed(40, mu, seed)
    own = gf.ensemble(packing)
    assert np.array_equal(own.index, np.flatnonzero(packing.forces[:, 0] > 0))
    unknown = gf.ensemble(packing._replace(forces=np.zeros_like(packing.forces)))
    assert np.array_equal(own.index, unknown.index)
    whole = gf.intervals(gf.ensemble(packing, prune=False))
    assert np.array_equal(own.index, np.flatnonzero(whole.backbone))
