"""The test of rest: what starts from no network comes to rest elsewhere."""

import numpy as np
import pytest
from packings import packed

import granforce as gf
from granforce.forces import backbone


@pytest.mark.parametrize("mu", [0.0, 0.3, 3.0])
@pytest.mark.parametrize("name", ["halved", "doubled", "random", "shuffled"])
def test_forces_that_are_no_network_are_not_at_rest(mu, name):
    packing, rng = packed(30, mu), np.random.default_rng(0)
    forces = {
        "halved": 0.5 * packing.forces,
        "doubled": 2 * packing.forces,
        "random": np.abs(rng.standard_normal(packing.forces.shape)),
        "shuffled": rng.permutation(packing.forces),
    }[name]
    outcome = gf.rest(packing._replace(forces=forces))
    assert not outcome.at_rest
    if np.isfinite(outcome.distance):
        assert f"elsewhere, at forces up to {outcome.distance:.2g} ⟨f_n⟩" in outcome.reason
        S = gf.ensemble(packing)
        assert S.admits(outcome.forces[S.index], residual=1e-8, violation=1e-8)


def test_forces_of_the_precision_of_a_file_are_at_rest():
    packing = packed(30, 0.3)
    size = 10.0 ** np.floor(np.log10(np.abs(packing.forces) + 1e-300))
    rounded = np.round(packing.forces / size, 2) * size
    outcome = gf.rest(packing._replace(forces=rounded))
    assert outcome.at_rest and not outcome.reason and 1e-6 < outcome.distance < 0.2


def test_violations_of_coulombs_law_alone_are_not_at_rest():
    """Forces that balance at the packing's friction, with less friction."""
    S = gf.ensemble(packed(30, 1.0, 3), 0.8)
    assert S.residual(S.original) < 1e-9 < 0.05 < S.violation(S.original)
    outcome = gf.rest(S)
    assert not outcome.at_rest and "violation of Coulomb's law" in outcome.reason


@pytest.mark.parametrize("n, seed, proofs", [(30, 1, 0), (20, 22, 1)])
def test_the_ensemble_need_not_prove_what_the_flow_does(monkeypatch, n, seed, proofs):
    """The other packing has two contacts, between grains of several, that carry nothing."""
    packing, tried, carrying = packed(n, 0.3, seed), [], backbone.carrying
    proved = gf.rest(gf.ensemble(packing))
    monkeypatch.setattr(backbone, "carrying", lambda S: tried.append(S) or carrying(S))
    found = gf.rest(packing)
    assert len(tried) == proofs and found.at_rest
    for one, other in zip(found, proved, strict=True):
        np.testing.assert_array_equal(one, other)
