"""Kinds of results: each is one record, and finds what was kept before."""

from pathlib import Path

import numpy as np
import pytest

from granforce.experiment.measurements import Measurement
from granforce.paper import tables
from granforce.study import cells as study
from granforce.study.kinds import KINDS, PACKING, get_packing
from granforce.study.store import open_store

pytestmark = pytest.mark.fast

DATA = Path(__file__).resolve().parents[2] / "data"
REFERENCE = Path(__file__).parents[1] / "reference"
MADE = PACKING.parameters(20, 0.1, 1)

MEASURED = Measurement(np.array([3, 5]), np.ones((2, 2)), np.full((2, 2), 0.1))

# What entries are called since packings are of version 6, which all others name by its parameters.
NAMES = {
    "packing": ((20, 0.1, 1), {}, "packing-e92faea7640195223d3c"),
    "walk": ((MADE, 6), {"keep": 3, "relax": "nearest_piqp"}, "walk-1d62362ee85d8524a995"),
    "uniform": ((MADE, 60, 2), {"effective": 30, "chains": 2}, "uniform-febf270766dc27162c86"),
    "inference": ((MADE, MEASURED, 60), {"keep": 5}, "inference-0619124b5fa1e63a0f4b"),
    "intervals": ((MADE,), {"slice_": (0.1, 0.9, 0, 1)}, "intervals-c54698df5db99cfb720a"),
    "limit_loads": ((MADE,), {"mu": 0.5, "contacts": [7, 3]}, "limit_loads-2130d78dc07681ab080e"),
    "outline": ((MADE,), {"components": [(5, 0), (5, 1)]}, "outline-348a39809923bad22be4"),
    "stress": ((MADE,), {"angles": 16}, "stress-eff83621cfee69021951"),
    "perturbation": ((MADE,), {"random": 4}, "perturbation-94e3d80e285b8690875e"),
    "informative": ((MADE,), {"k": 5}, "informative-6bc3a4e684273fbe1590"),
    "volume": ((MADE, 0.1), {}, "volume-c25740b845d6f295aabf"),
    "perturbed_contact": ((MADE, 5), {}, "perturbed_contact-6bd9faef7813cda5c390"),
}


def named_anew(entry):
    """The parameters of an entry as its kind names them, given those that it was kept with."""
    given = {"slice_" if k == "slice" else k: v for k, v in entry.params.items() if v is not None}
    given.pop("version", None)  # nobody chooses that of packings
    return KINDS[entry.kind].parameters(**given)


def kept(name, folder=DATA):
    """The store of this name that is shipped, and its entries but the study's table."""
    store = open_store(folder / name, readonly=True)
    entries = [entry for entry in store.entries() if entry.kind != "study"]
    assert entries
    return store, entries


def test_what_is_shipped_is_found():
    store, entries = kept("start.zarr")
    for entry in entries:
        kind, parameters = KINDS[entry.kind], named_anew(entry)
        assert study.entry_name(store, kind, parameters) == entry.name
        assert study.load(store, kind, parameters) is not None
        assert entry in study.entries(store, kind)


def test_packings_of_version_1_still_open_and_are_not_taken_for_the_new_ones():
    store, entries = kept("version1.zarr", REFERENCE)
    for entry in entries:
        assert (entry.kind, entry.version) == ("packing", 1)
        opened = store.load(entry.kind, entry.params, version=entry.version)
        assert opened.sizes["grain"] == entry.params["n"]
        assert study.load(store, PACKING, named_anew(entry)) is None
        assert entry not in study.entries(store, PACKING)


def test_states_of_older_packings_are_not_listed(tmp_path):
    """Older packings did not name their version: what a cache has of them stays, unlisted."""
    shipped, entries = kept("start.zarr")
    walk = next(entry for entry in entries if entry.kind == "walk")
    older = dict(walk.params["packing"])
    del older["version"]
    store = open_store(tmp_path / "cache.zarr")
    for packing in (walk.params["packing"], older):
        dataset = study.load(shipped, KINDS["walk"], walk.params)
        named = walk.params | {"packing": packing}
        study.save(store, KINDS["walk"], named, dataset, dtypes={"states": "float32"})
    assert len(store.entries()) == 2
    assert [entry.params for entry in study.entries(store, KINDS["walk"])] == [walk.params]


def test_the_reduced_study_is_found():
    assert len(tables.load(DATA / "study.zarr").rows)


@pytest.mark.parametrize("name", KINDS)
def test_keys_do_not_change(name, tmp_path):
    given, options, expected = NAMES[name]
    parameters = KINDS[name].parameters(*given, **options)
    assert study.entry_name(open_store(tmp_path / "s"), KINDS[name], parameters) == expected


@pytest.mark.parametrize("name", KINDS)
def test_a_new_version_of_packings_renames_what_rests_on_them_alone(name, tmp_path, monkeypatch):
    store, (given, options, _) = open_store(tmp_path / "s"), NAMES[name]

    def called(packing):
        known = given if name == "packing" else (packing, *given[1:])
        named = KINDS[name].parameters(*known, **options)
        return study.entry_name(store, KINDS[name], named)

    imported = {"imported": "0" * 64, "mu": 0.1}
    before = called(MADE), name != "packing" and called(imported)
    monkeypatch.setattr("granforce.study.cells.PACKING_VERSION", 99)
    after = called(PACKING.parameters(20, 0.1, 1)), name != "packing" and called(imported)
    assert before[0] != after[0]
    assert before[1] == after[1]


def test_a_kind_is_called_by_its_name():
    assert all(kind.name == name for name, kind in KINDS.items())


def test_a_box_of_free_shape_names_another_packing(tmp_path):
    assert PACKING.parameters(20, 0.1, 1, box="square") == MADE
    asked = PACKING.parameters(20, 0.3, 7, box="isotropic")
    assert asked == PACKING.parameters(20, 0.3, 7) | {"box": "isotropic"}
    store = open_store(tmp_path / "s")
    made, cached = get_packing(store, asked)
    again, found = get_packing(store, asked)
    assert not cached and found
    assert again.tilt == made.tilt != 0
    assert again.info["box"] == "isotropic"
