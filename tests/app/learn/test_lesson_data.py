"""Data of the chapters, from the stores that ship."""

import numpy as np
import pytest

from app.learn.model.lesson_data import Packings
from app.results.library import Library


@pytest.fixture(scope="module")
def packings(tmp_path_factory):
    return Packings(Library(cache=tmp_path_factory.mktemp("cache")))


def test_friction_stops_at_the_packings(packings):
    curve = packings.curve()
    assert curve["mu"] == packings.frictions
    assert curve["free"] == [packings.packing(mu)["free"] for mu in packings.frictions]
    assert max(zip(curve["spread"], curve["mu"], strict=True))[1] == 0.2
    assert (np.diff(curve["free"]) < 0).all()


def test_s_of_the_pushed_contact_shrinks_to_a_point_at_its_limit_load(packings):
    pushed = packings.push(0)
    load, least, largest = pushed["band"].reshape(-1, 3).T
    assert (np.diff(largest - least) < 0).all() and largest[-1] < 1e-3 * largest[0]
    assert load[-1] == pytest.approx(pushed["limit"], rel=1e-3)
    forces = pushed["normal"].reshape(len(pushed["values"]), -1)[:, pushed["contact"]]
    assert (forces > np.interp(pushed["values"], load, least) - 1e-3).all()
    assert (forces < np.interp(pushed["values"], load, largest) + 1e-3).all()
    assert forces[-1] < 1e-3  # it meets the edge before


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


def test_the_walk_fills_a_small_part_of_the_shadow_of_s(packings):
    shadow, packing = packings.shadow(), packings.packing(0.1)
    outline = shadow["outline"].reshape(-1, 2)
    for k, contact in enumerate((packing["grabbed"], packing["other"])):
        ends = packing["least"][contact], packing["largest"][contact]
        np.testing.assert_allclose((outline[:, k].min(), outline[:, k].max()), ends, atol=0.01)
    assert 0.05 < shadow["share"] < 0.2
