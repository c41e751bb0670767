"""Data of the chapters, from the stores that ship."""

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


def test_without_a_study_friction_stops_at_the_packings(packings, monkeypatch):
    monkeypatch.setattr(study_data, "against_friction", lambda measure: [])
    curve = packings.curve()
    assert curve["mu"] == curve["packed"] == packings.frictions
    assert curve["spread"] == [packings.packing(mu)["spread"] for mu in packings.frictions]
