"""Kinds of results: each is one record, and finds what was kept before."""

from pathlib import Path

import numpy as np
import pytest

from granforce.packing.importers.measurements import Measurement
from granforce.paper import tables
from granforce.study import cells as study
from granforce.study.kinds import KINDS, PACKING
from granforce.study.store import open_store

DATA = Path(__file__).resolve().parents[2] / "data"
MADE = PACKING.parameters(20, 0.3, 1)

MEASURED = Measurement(np.array([3, 5]), np.ones((2, 2)), np.full((2, 2), 0.1))

# What entries were called when the kinds were spelled out one by one.
NAMES = {
    "packing": ((20, 0.3, 1), {}, "packing-29cd0ea4d0e838ff1bab"),
    "walk": ((MADE, 6), {"keep": 3, "relax": "nearest"}, "walk-443d5ea63d65bb921e92"),
    "uniform": ((MADE, 60, 2), {"effective": 30, "chains": 2}, "uniform-702e781259968ff77076"),
    "inference": ((MADE, MEASURED, 60), {"keep": 5}, "inference-fe6a10d377a20e3258b2"),
    "intervals": ((MADE,), {"slice_": (0.1, 0.9, 0, 1)}, "intervals-1aff28fa6d545ecb76c5"),
    "limit_loads": ((MADE,), {"mu": 0.5, "contacts": [7, 3]}, "limit_loads-092955e97f3a3586be08"),
    "outline": ((MADE,), {"components": [(5, 0), (5, 1)]}, "outline-4740e5f166f6f194600f"),
    "stress": ((MADE,), {"angles": 16}, "stress-0891373dfc55dcaa1ea5"),
    "perturbation": ((MADE,), {"random": 4}, "perturbation-413a671867c7bb00de18"),
    "informative": ((MADE,), {"k": 5}, "informative-bd48c4f776db160b6af4"),
    "volume": ((MADE, 0.1), {}, "volume-477ef570b54ce16375c9"),
    "perturbed_contact": ((MADE, 5), {}, "perturbed_contact-951ec8ca931bc7aec025"),
}


def named_anew(entry):
    """The parameters of an entry as its kind names them, given those that it was kept with."""
    given = {"slice_" if k == "slice" else k: v for k, v in entry.params.items() if v is not None}
    return KINDS[entry.kind].parameters(**given)


@pytest.mark.parametrize("name", ["start.zarr", "study.zarr"])
def test_what_is_shipped_is_found(name):
    store = open_store(DATA / name, readonly=True)
    entries = [entry for entry in store.entries() if entry.kind != "study"]
    assert entries
    for entry in entries:
        kind, parameters = KINDS[entry.kind], named_anew(entry)
        assert study.entry_name(store, kind, parameters) == entry.name
        assert study.load(store, kind, parameters) is not None
        assert entry in study.entries(store, kind)


def test_the_reduced_study_is_found():
    assert tables.load(DATA / "study.zarr").rows


@pytest.mark.parametrize("name", KINDS)
def test_keys_do_not_change(name, tmp_path):
    given, options, expected = NAMES[name]
    parameters = KINDS[name].parameters(*given, **options)
    assert study.entry_name(open_store(tmp_path / "s"), KINDS[name], parameters) == expected


def test_a_kind_is_called_by_its_name():
    assert all(kind.name == name for name, kind in KINDS.items())
