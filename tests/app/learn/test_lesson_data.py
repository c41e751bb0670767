"""Data of the chapters, from the stores that ship."""

import numpy as np
import pytest

from app.learn.model.lesson_data import Packings
from app.results import study_data
from app.results.library import Library


@pytest.fixture(scope="module")
def packings(tmp_path_factory):
    return Packings(Library(cache=tmp_path_factory.mktemp("cache")))


def test_friction_stops_wherever_the_study_measured_and_shows_the_nearest_packing(packings):
    curve = packings.curve()
    packed = dict(zip(curve["mu"], curve["packed"], strict=True))
    assert len(packed) > 2 * len(packings.frictions)
    assert all(packed[mu] == mu for mu in packings.frictions)
    assert (packed[0.14], packed[0.02], packed[5.0]) == (0.1, 0.01, 10.0)
    assert max(zip(curve["spread"], curve["mu"], strict=True))[1] == 0.2


def test_more_friction_leaves_fewer_contacts_and_fewer_free_numbers(packings):
    curve = packings.curve()
    for name in ("touching", "free"):
        assert (np.diff(curve[name]) < 0).all(), name


def test_the_same_disks_give_way_at_other_pushes_from_other_forces(packings):
    packed, other = packings.push(0), packings.push(1)
    assert packed["contact"] == other["contact"] and packed["limit"] == other["limit"]
    stored = packings._pushed()
    assert packed["values"][-1] in stored["critical_low"].values / stored["force_scale"].item()
    assert packed["values"][-1] < other["values"][-1] < packed["limit"]
    first = packed["normal"].reshape(len(packed["values"]), -1)[0]
    np.testing.assert_allclose(first, packings.shown(0.1).replay.normal[0], atol=1e-5)
    assert np.abs(other["normal"][: len(first)] - first).max() > 0.5
    assert packed["opened"].any() and packed["displacement"].any()


def test_without_a_study_friction_stops_at_the_packings(packings, monkeypatch):
    monkeypatch.setattr(study_data, "against_friction", lambda measure: [])
    curve = packings.curve()
    assert curve["mu"] == curve["packed"] == packings.frictions
    assert curve["spread"] == [packings.packing(mu)["spread"] for mu in packings.frictions]


def test_the_walk_fills_a_small_part_of_the_shadow_of_s(packings):
    shadow, packing = packings.shadow(), packings.packing(0.1)
    outline = shadow["outline"].reshape(-1, 2)
    for k, contact in enumerate((packing["grabbed"], shadow["other"])):
        ends = packing["least"][contact], packing["largest"][contact]
        np.testing.assert_allclose((outline[:, k].min(), outline[:, k].max()), ends, atol=0.01)
    assert 0.05 < shadow["share"] < 0.2
