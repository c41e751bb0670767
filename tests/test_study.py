"""Cells and the store behind them."""

import numpy as np
import pytest

from granforce import measures, study
from granforce.polytope import ensemble
from granforce.records import InputError
from granforce.store import open_store


def cell(mu=0.3, seed=1, states=6, n=20, **options):
    packing = study.packing_parameters(n, mu, seed)
    return study.walk_parameters(packing, states, relax="nearest", **options)


def test_a_cell_is_computed_once(tmp_path):
    store = open_store(tmp_path / "s")
    first, cached = study.get_walk(store, cell())
    again, cached_again = study.get_walk(store, cell())
    assert (cached, cached_again) == (False, True)
    assert np.array_equal(first["states"], again["states"])
    assert sorted(entry.kind for entry in store.entries()) == ["packing", "walk"]


def test_friction_is_quantised_in_names(tmp_path):
    store = open_store(tmp_path / "s")
    study.get_walk(store, cell(mu=0.3))
    assert study.get_walk(store, cell(mu=0.1 + 0.2))[1]


def test_a_damaged_cell_is_computed_again(tmp_path):
    store = open_store(tmp_path / "s")
    first, _ = study.get_walk(store, cell())
    name = store.name("walk", cell(), version=study.WALK_VERSION)
    chunk = store.path / name / "states" / "c" / "0" / "0" / "0"
    chunk.write_bytes(chunk.read_bytes()[:-9])
    with pytest.warns(UserWarning, match="damaged"):
        again, cached = study.get_walk(store, cell())
    assert not cached
    assert np.array_equal(first["states"], again["states"])
    assert all(verdict.ok for verdict in store.verify())


def test_measures_in_the_store_are_those_of_all_states(tmp_path):
    store = open_store(tmp_path / "s")
    few, _ = study.get_walk(store, cell(states=9, keep=3))
    full, _ = study.get_walk(store, cell(states=9))
    assert few.sizes["state"] == 3
    assert full.sizes["state"] == 9
    for name in ("eta1", "eta2", "eta3", "correlation"):
        assert few[name].item() == full[name].item()
    assert few["eta2"].item() == measures.eta2(full["states"].values)
    assert np.array_equal(few["states"], full["states"][[0, 4, 8]])
    packing, _ = study.get_packing(store, cell()["packing"])
    S = ensemble(packing)
    assert full["dimension"].item() == S.dimension
    assert np.array_equal(full["backbone"], S.index)


def test_packings_from_elsewhere_are_named_by_their_content(tmp_path):
    store = open_store(tmp_path / "s")
    packing, _ = study.get_packing(store, cell()["packing"])
    named = study.imported_parameters(packing)
    study.keep_packing(store, named, packing)
    walked = study.walk_parameters(named, 4, relax="nearest")
    assert study.get_walk(store, walked)[0].sizes["state"] == 4
    other = study.imported_parameters(packing._replace(mu=0.31))
    assert other != named
    with pytest.raises(InputError, match="import it again"):
        study.get_packing(store, other)


@pytest.mark.parametrize("bad", [{"relax": "magic"}, {"states": 0}, {"keep": 0}])
def test_bad_walks_are_refused(bad):
    options = {"states": 4} | bad
    with pytest.raises(InputError):
        study.walk_parameters(study.packing_parameters(20, 0.3, 1), **options)


def test_public_names_are_what_they_say():
    import granforce
    import granforce.study  # loads every module, which must not hide a function's name

    for name in granforce.__all__:
        if name != "measures":
            assert callable(getattr(granforce, name)), name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = granforce.nothing
