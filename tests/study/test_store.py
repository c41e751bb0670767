"""The store: keys, round trips, damage, and writers that compete or are killed."""

import json
import multiprocessing
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import platformdirs
import pytest
import xarray as xr
import zarr
from full_disk import files_of

from granforce.records import Contacts, InputError, Packing, make_contacts, make_packing
from granforce.study import entries, keys
from granforce.study.keys import canonical
from granforce.study.schema import VARIABLES, dataset_packing, labelled, packing_dataset
from granforce.study.store import Verdict, default_path, open_store

PARAMS = {"mu": 0.1, "grains": 400, "seed": 3}

# Children start from a server that has imported everything already, and before zarr has threads.
processes = multiprocessing.get_context("forkserver")
processes.set_forkserver_preload(["granforce.study.store", "pytest"])


@pytest.fixture
def store(tmp_path):
    return open_store(tmp_path / "store")


def walk_dataset(seed=0, states=250, contacts=7):
    rng = np.random.default_rng(seed)
    return labelled(
        {
            "states": rng.normal(size=(states, contacts, 2)),
            "residual": rng.random(states),
            "sweeps": rng.integers(0, 1000, states),
            "backbone": np.arange(contacts),
        }
    )


def awkward_packing():
    """Open in y, no pressure, a negative zero, and info of every plain type."""
    contacts = make_contacts(
        [0, 1], [1, 2], [[1, 0], [0.6, 0.8]], [1.7, 1.6], np.array([1, 0.7, 1])
    )
    info = {"seed": 3, "steps": 10**12, "tail": 0.1 + 0.2, "nan": np.inf, "note": "µ", "none": None}
    packing = make_packing(
        [[0, 0], [1 / 3, 0], [2, 1]],
        [1, 0.7, 1],
        [7.1, np.inf],
        contacts,
        [[1 / 3, -0.0], [2, 1e-300]],
        0.1,
        load=[[0, 0, 1], [0, 0, 0], [0, -1, 0]],
        info=info,
    )
    assert np.isnan(packing.pressure)
    return packing


def assert_same_packing(a, b):
    assert (a.info, repr(a.mu), repr(a.pressure)) == (b.info, repr(b.mu), repr(b.pressure))
    assert type(b) is Packing and type(b.contacts) is Contacts
    one, two = (
        [field for field in (*packing.contacts, *(packing.shapes or ())) if field is not None]
        + [packing.x, packing.r, packing.box, packing.forces, packing.load]
        for packing in (a, b)
    )
    for left, right in zip(one, two, strict=True):
        assert left.dtype == right.dtype and left.shape == right.shape
        assert left.tobytes() == right.tobytes()
        assert right.flags.c_contiguous and right.flags.writeable


# keys


def test_equal_parameters_have_one_key(store):
    name = store.name("walk", {"mu": 0.3, "n": 4, "shape": [1, 2], "none": None}, version=1)
    same = {
        "shape": (np.int32(1), 2.0),
        "none": None,
        "n": np.uint8(4),
        "mu": np.float64(0.1) + np.float64(0.2),
    }
    assert store.name("walk", same, version=np.int64(1)) == name
    assert canonical(np.float32(0.3)) == canonical(0.3) == "0.3"
    assert canonical(-0.0) == canonical(0) == "0"
    assert canonical({"b": 1, "a": np.True_}) == '{"a":true,"b":1}'


@pytest.mark.parametrize(
    "kind, params, version",
    [
        ("packing", PARAMS, 1),
        ("walk", PARAMS, 2),
        ("walk", PARAMS | {"mu": 0.100000001}, 1),
        ("walk", PARAMS | {"seed": 4}, 1),
        ("walk", PARAMS | {"seed": 2**60 + 1}, 1),
        ("walk", PARAMS | {"seed": None}, 1),
        ("walk", PARAMS | {"seed": "3"}, 1),
        ("walk", PARAMS | {"states": 10}, 1),
    ],
)
def test_different_parameters_have_different_keys(store, kind, params, version):
    name = store.name(kind, params, version=version)
    assert name != store.name("walk", PARAMS, version=1)
    assert name != store.name("walk", PARAMS | {"seed": 2**60}, version=1)


def test_schema_version_enters_the_key(store):
    name = store.name("walk", PARAMS, version=1)
    assert name == keys.entry_name("walk", PARAMS, 1, keys.SCHEMA_VERSION)
    assert name != keys.entry_name("walk", PARAMS, 1, 99)


def test_key_never_changes(store):
    """A fixed value: a key that moved would make every stored result unreachable."""
    assert store.name("walk", PARAMS, version=1) == "walk-da8e3588879e85aae0b0"


@pytest.mark.parametrize("value", [np.zeros(2), {1, 2}, 1j, b"x", object(), np.nan, np.inf, {1: 2}])
def test_what_has_no_canonical_form_is_refused(value):
    with pytest.raises(TypeError, match=r"parameters\['mu'\] cannot be part of a key"):
        canonical({"mu": value})


@pytest.mark.parametrize("kind", ["", "Walk", "a/b", "../walk", ".walk", "1walk"])
def test_kind_is_a_plain_word(store, kind):
    with pytest.raises(ValueError, match="kind must be"):
        store.name(kind, PARAMS, version=1)


# round trips


def test_packing_round_trip(store):
    packing = awkward_packing()
    assert_same_packing(packing, dataset_packing(packing_dataset(packing)))
    store.save("packing", PARAMS, packing_dataset(packing), version=1)
    assert_same_packing(packing, dataset_packing(store.load("packing", PARAMS, version=1)))


def test_packing_without_contacts(store):
    nobody = make_contacts([], [], np.zeros((0, 2)), [], np.ones(1))
    packing = make_packing([[0, 0]], [1], [9, 9], nobody, np.zeros((0, 2)), 0, pressure=1)
    store.save("packing", PARAMS, packing_dataset(packing), version=1)
    assert_same_packing(packing, dataset_packing(store.load("packing", PARAMS, version=1)))


def test_negative_zeros_survive(store):
    """Zarr leaves out chunks that equal the fill value 0; in Zarr 3.0.8 those of −0.0 too."""
    saved = labelled({"states": np.full((3, 2, 2), -0.0), "residual": np.zeros(3)})
    name = store.save("walk", PARAMS, saved, version=1)
    assert (store.path / name / "residual" / "c").exists()
    assert np.signbit(store.load("walk", PARAMS, version=1)["states"]).all()


def test_walk_round_trip_and_labels(store):
    saved = walk_dataset().assign_attrs(note="µ = 0.1", count=np.int64(3))
    name = store.save("walk", PARAMS, saved, version="a1")
    loaded = store.load("walk", PARAMS, version="a1")
    xr.testing.assert_equal(saved, loaded)
    assert {k: v.dtype for k, v in saved.items()} == {k: v.dtype for k, v in loaded.items()}
    for key, array in loaded.items():
        assert array.attrs == {"units": VARIABLES[key].units, "long_name": VARIABLES[key].long_name}
    attrs = loaded.attrs
    assert json.loads(attrs["parameters"]) == PARAMS
    assert (attrs["kind"], attrs["seed"], attrs["algorithm_version"]) == ("walk", 3, "a1")
    assert (attrs["note"], attrs["count"]) == ("µ = 0.1", 3)
    assert attrs["schema_version"] == keys.SCHEMA_VERSION
    assert attrs["numpy_version"] == np.__version__ and attrs["zarr_version"] == zarr.__version__
    assert {"granforce_version", "numba_version", "xarray_version", "created"} <= attrs.keys()
    assert store.load("walk", PARAMS, version="a2") is None
    assert store.verify() == [Verdict(name, True, "")]


def test_states_can_be_stored_with_fewer_bits(store):
    saved = walk_dataset()
    name = store.save("walk", PARAMS, saved, version=1, dtypes={"states": "float32"})
    loaded = store.load("walk", PARAMS, version=1)
    assert loaded["states"].dtype == np.float32 and loaded["residual"].dtype == np.float64
    np.testing.assert_array_equal(loaded["states"], saved["states"].astype(np.float32))
    assert store.verify() == [Verdict(name, True, "")]


def test_checksum_is_that_of_the_result(tmp_path):
    """The same result gives the same checksum elsewhere; another number, shape or name does not."""
    datasets = [walk_dataset(0), walk_dataset(0), walk_dataset(1)]
    datasets.append(datasets[0].isel(state=slice(1, None)))
    datasets.append(datasets[0].drop_vars("sweeps"))
    sums = []
    for k, dataset in enumerate(datasets):
        store = open_store(tmp_path / str(k))
        store.save("walk", PARAMS, dataset, version=1)
        sums.append(store.load("walk", PARAMS, version=1).attrs["checksum"])
    assert sums[0] == sums[1] and len(set(sums)) == 4


def test_saving_twice_keeps_the_first(store):
    """Nothing is written either, as in a folder where nothing can be."""
    name = store.save("walk", PARAMS, walk_dataset(0), version=1)
    with files_of(0):
        assert store.save("walk", PARAMS, walk_dataset(1), version=1) == name
    xr.testing.assert_equal(store.load("walk", PARAMS, version=1), walk_dataset(0))


def test_a_loaded_dataset_can_be_saved_elsewhere(store, tmp_path):
    store.save("walk", PARAMS, walk_dataset(), version=1)
    other = open_store(tmp_path / "other")
    loaded = store.load("walk", PARAMS, version=1)
    other.save("uniform", {"mu": 0.5}, loaded, version=2)
    again = other.load("uniform", {"mu": 0.5}, version=2)
    xr.testing.assert_equal(loaded, again)
    assert again.attrs["kind"] == "uniform" and "seed" not in again.attrs


# the schema


def test_undeclared_variable_is_refused(store):
    dataset = walk_dataset().assign(speed=("state", np.zeros(250)))
    with pytest.raises(ValueError, match="'speed' is not declared"):
        store.save("walk", PARAMS, dataset, version=1)
    with pytest.raises(ValueError, match="'speed' is not declared"):
        labelled({"speed": [1.0]})
    assert not store.exists


@pytest.mark.parametrize(
    "wrong, match",
    [
        (("state", np.zeros(250, np.int64)), "must be float64"),
        (("state", np.zeros(250, np.float32)), "must be float64"),
        (("contact", np.zeros(7)), "must have dims"),
    ],
)
def test_wrong_dims_or_dtype_are_refused(store, wrong, match):
    with pytest.raises(ValueError, match=match):
        store.save("walk", PARAMS, walk_dataset().assign(residual=wrong), version=1)


def test_integers_are_not_stored_as_something_else(store):
    with pytest.raises(ValueError, match="cannot be stored as float32"):
        store.save("walk", PARAMS, walk_dataset(), version=1, dtypes={"sweeps": "float32"})


def test_wrong_number_of_dimensions_is_refused():
    with pytest.raises(ValueError, match="must have dims"):
        labelled({"residual": np.zeros((2, 2))})


def test_every_row_of_the_schema_is_complete():
    for name, row in VARIABLES.items():
        assert name not in row.dims  # xarray would take it for an index
        assert np.dtype(row.dtype).kind in "fib" and row.units and row.long_name


# reading


def test_entries_are_read_without_arrays(store):
    store.save("walk", PARAMS, walk_dataset(), version=1)
    store.save("packing", PARAMS, packing_dataset(awkward_packing()), version=1)
    for array in store.path.glob("*/*/zarr.json"):
        array.write_bytes(b"damaged")
    packing, walk = store.entries()
    assert (walk.kind, walk.params, walk.version) == ("walk", PARAMS, 1)
    on_disk = [f.stat().st_size for f in (store.path / walk.name).rglob("*") if f.is_file()]
    assert walk.bytes == sum(on_disk) > 0
    assert store.size() > walk.bytes + packing.bytes
    assert walk.created.endswith("+00:00")


def test_find_compares_as_keys_do(store):
    for mu in (0.1, 0.3):
        for seed in (1, 2):
            store.save("walk", {"mu": mu, "seed": seed}, walk_dataset(seed), version=1)
    store.save("uniform", {"mu": 0.3, "seed": 1}, walk_dataset(), version=1)
    assert len(store.find("walk", mu=0.1 + 0.2)) == 2
    assert [e.params["seed"] for e in store.find("walk", mu=np.float64(0.3), seed=2)] == [2]
    assert len(store.find(seed=1)) == 3
    assert store.find("walk", seed=True) == store.find(length=1) == store.find("packing") == []


def test_mapping_opens_lazily(store):
    name = store.save("walk", PARAMS, walk_dataset(), version=1)
    assert list(store) == [name] and len(store) == 1 and name in store
    assert "walk-" + 20 * "0" not in store and 3 not in store
    with pytest.raises(KeyError):
        store["../store"]
    dataset = store[name]
    frame = dataset["states"].isel(state=120)
    # Only the chunk of states 100 … 199 is needed for frame 120.
    for chunk in (store.path / name / "states" / "c").iterdir():
        if chunk.name != "1":
            shutil.rmtree(chunk)
    np.testing.assert_array_equal(frame.values, walk_dataset()["states"][120])
    with pytest.raises(InputError, match="lacks its part states/c/0/0/0"):
        dataset["states"][0].load()


def test_what_was_opened_and_then_cleared_is_no_zeros(store):
    name = store.save("walk", PARAMS, walk_dataset().assign(force_scale=2.5), version=1)
    dataset = store[name]
    open_store(store.path).clear()
    for variable in dataset:
        with pytest.raises(InputError, match=f"{name}.*lacks its part {variable}/c"):
            dataset[variable].load()


def test_zarr_and_xarray_read_the_folder(store):
    name = store.save("walk", PARAMS, walk_dataset(), version=1)
    group = zarr.open_group(store.path, mode="r")
    assert list(group.group_keys()) == [name]
    assert group[name]["states"].chunks == (100, 7, 2)
    assert group[name]["sweeps"].chunks == (250,)
    assert "Zstd" in str(group[name]["states"].compressors)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        opened = [xr.open_zarr(store.path / name), xr.open_zarr(store.path / name, chunks=None)]
        opened.append(xr.open_zarr(store.path, group=name, consolidated=False))
    for one in opened:
        xr.testing.assert_equal(one.load(), walk_dataset())
    tree = xr.open_datatree(store.path, engine="zarr", consolidated=False)
    xr.testing.assert_equal(tree[name].to_dataset().load(), walk_dataset())


def test_metadata_are_consolidated_as_zarr_does_it(store):
    name = store.save("walk", PARAMS, walk_dataset(), version=1)
    ours = json.loads((store.path / name / "zarr.json").read_text())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it is no part of Zarr's specification yet
        zarr.consolidate_metadata(store.path / name)
    assert json.loads((store.path / name / "zarr.json").read_text()) == ours


# damage


def damage_metadata(entry):
    text = (entry / "zarr.json").read_bytes()
    (entry / "zarr.json").write_bytes(text[: len(text) // 2])


def damage_array_metadata(entry):
    (entry / "states" / "zarr.json").write_bytes(b'{"zarr_format": 3')


def damage_chunk(entry):
    chunk = entry / "states" / "c" / "1" / "0" / "0"
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(data)


def damage_number(entry):
    """A well-formed chunk with one other number in it: only the checksum can tell."""
    zarr.open_array(entry / "sweeps", mode="r+")[7] += 1


def damage_parameters(entry):
    text = (entry / "zarr.json").read_text()
    (entry / "zarr.json").write_text(text.replace('\\"grains\\":400', '\\"grains\\":401'))


def damage_attribute(entry):
    text = (entry / "zarr.json").read_text()
    (entry / "zarr.json").write_text(text.replace("first note", "other note"))


def edit(name, old, new):
    """A function that changes a word in one of an entry's files of metadata."""

    def damage(entry):
        text = (entry / name / "zarr.json").read_text()
        assert old in text
        (entry / name / "zarr.json").write_text(text.replace(old, new))

    return damage


DAMAGES = {
    "truncated metadata": damage_metadata,
    "no metadata": lambda entry: (entry / "zarr.json").unlink(),
    "no array metadata": lambda entry: (entry / "states" / "zarr.json").unlink(),
    "truncated array metadata": damage_array_metadata,
    "no array": lambda entry: shutil.rmtree(entry / "residual"),
    "no chunk": lambda entry: (entry / "states" / "c" / "1" / "0" / "0").unlink(),
    "flipped bit": damage_chunk,
    "truncated chunk": lambda entry: os.truncate(entry / "sweeps" / "c" / "0", 20),
    "another number": damage_number,
    "other parameters": damage_parameters,
    "another attribute": damage_attribute,
    "another unit": edit("states", VARIABLES["states"].units, "kN"),
    "another name": edit("residual", VARIABLES["residual"].long_name, "no residual"),
    "another unit where it is consolidated": edit("", VARIABLES["states"].units, "kN"),
    "another date": edit("", '"created": "20', '"created": "19'),
    "no checksum of the metadata": edit("", "metadata_checksum", "metadata_nothing"),
}


@pytest.mark.parametrize(
    "put", [lambda path: path.write_text("somebody's"), lambda path: path.symlink_to("nowhere")]
)
def test_a_file_where_an_entry_belongs_is_told_at_once_and_left(store, put):
    name = store.name("walk", PARAMS, version=1)
    store.path.mkdir()
    put(store.path / name)
    left = (store.path / name).lstat()
    for use in (
        lambda: store.load("walk", PARAMS, version=1),
        lambda: store.save("walk", PARAMS, walk_dataset(), version=1),
    ):
        with pytest.raises(InputError, match=f"{name} is a file where an entry"):
            use()
    assert store.verify() == [Verdict(name, False, "it is a file, not a folder")]
    with pytest.warns(UserWarning, match="metadata"):
        assert store.find("walk") == []
    now = (store.path / name).lstat()
    assert list(store) == [] and (now.st_ino, now.st_mtime) == (left.st_ino, left.st_mtime)
    assert store.clear() == 1 and store.verify() == []


# What a look at an entry uses, each of which others may overtake.
LOOKS = {
    "load": lambda store: store.load("walk", PARAMS, version=1),
    "verify": lambda store: store.verify() or None,
    "entries": lambda store: store.entries() or None,
    "find": lambda store: store.find("walk", mu=0.1) or None,
    "open": lambda store: store.get(store.name("walk", PARAMS, version=1)),
}


@pytest.mark.parametrize("step", ["read_attributes", "_metadata", "_lazily"])
@pytest.mark.parametrize("look", LOOKS.values(), ids=LOOKS.keys())
@pytest.mark.parametrize("again", [False, True])
def test_what_vanishes_meanwhile_is_absent(store, monkeypatch, step, look, again):
    """At each step of a look another process clears the store, and may save the entry again."""
    store.save("walk", PARAMS, walk_dataset(0), version=1)
    rival, before = open_store(store.path), getattr(entries, step)

    def overtaken(*args):
        monkeypatch.setattr(entries, step, before)
        rival.clear()
        if again:
            rival.save("walk", PARAMS, walk_dataset(1), version=1)
        return before(*args)

    monkeypatch.setattr(entries, step, overtaken)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = look(store)
    overtook = getattr(entries, step) is before
    monkeypatch.setattr(entries, step, before)
    assert again or not overtook or found is None or step == "read_attributes"
    if isinstance(found, xr.Dataset):
        xr.testing.assert_equal(found.load(), walk_dataset(int(again)))
    elif found is not None:
        assert len(found) == 1 and getattr(found[0], "ok", True)


def test_one_clears_while_others_read_and_write(tmp_path, caplog):
    """Nothing is told of damage, nor by asyncio, and what is found is what was saved."""
    store, saved, left = open_store(tmp_path / "store"), walk_dataset(), [60]

    def clears():
        while left[0]:
            open_store(store.path).clear()

    def uses(seed):
        while left[0]:
            left[0] = max(0, left[0] - 1)
            store.save("walk", {"seed": seed}, saved, version=1)
            found = store.load("walk", {"seed": seed}, version=1)
            assert found is None or found.equals(saved)
            assert all(verdict.ok for verdict in store.verify())
            assert all(entry.kind == "walk" for entry in store.find("walk"))

    with warnings.catch_warnings(), ThreadPoolExecutor(3) as threads:
        warnings.simplefilter("error")
        running = [threads.submit(clears), *(threads.submit(uses, seed) for seed in (1, 1))]
        try:
            for one in running[1:]:
                one.result()
        finally:
            left[0] = 0
        running[0].result()
    assert not caplog.records
    assert not list(store.path.glob(".tmp-*"))


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES.keys())
def test_damage_is_reported_and_replaced(store, damage):
    saved = walk_dataset().assign_attrs(note="first note")
    name = store.save("walk", PARAMS, saved, version=1)
    before = (store.path / name / "zarr.json").read_bytes()
    assert store.verify() == [Verdict(name, True, "")]
    damage(store.path / name)
    with pytest.warns(UserWarning, match=f"{name}.*damaged"):
        assert store.load("walk", PARAMS, version=1) is None
    ((_, ok, reason),) = store.verify()
    assert not ok and reason
    store.save("walk", PARAMS, saved, version=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        xr.testing.assert_equal(store.load("walk", PARAMS, version=1), saved)
    assert len(before) == len((store.path / name / "zarr.json").read_bytes())
    assert list(store.path.glob(".tmp-*")) == []


DAMAGED = (
    '{"zarr_format": 3',
    '{"zarr_format": 3}',
    "[]",
    "\xff",
    "",
    '{"zarr_format": 9}',
    9999 * "[",
)


def test_metadata_damaged_all_over_is_one_line(store):
    """In a process of its own: what asyncio says of tasks comes late, and on stderr itself."""
    for seed, text in enumerate(DAMAGED):
        name = store.save("walk", {"seed": seed}, walk_dataset(), version=1)
        for metadata in (store.path / name).glob("*/zarr.json"):
            metadata.write_bytes(text.encode("latin-1"))
        with pytest.raises(InputError, match="is damaged"):
            _ = store[name]
    assert not any(verdict.ok for verdict in store.verify())
    code = (
        "import sys, warnings\n"
        "from granforce.study.store import open_store\n"
        "from granforce.system.terminal import one_line\n"
        "warnings.formatwarning = one_line\n"
        "store = open_store(sys.argv[1])\n"
        f"for seed in 3 * [*range({len(DAMAGED)})]:\n"
        "    assert store.load('walk', {'seed': seed}, version=1) is None\n"
    )
    words = [sys.executable, "-c", code, str(store.path)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    lines = done.stderr.splitlines()
    assert len(lines) == len(DAMAGED)
    assert all("is damaged (the metadata of its" in line for line in lines)


def test_a_store_of_a_newer_schema_is_not_written_to(store):
    store.save("walk", PARAMS, walk_dataset(), version=1)
    root = json.loads((store.path / "zarr.json").read_text())
    root["attributes"]["granforce_store"] += 1
    (store.path / "zarr.json").write_text(json.dumps(root))
    before = sorted(store.path.rglob("*"))
    with pytest.raises(InputError, match=r"made by a newer granforce \(schema 2, here 1\)"):
        open_store(store.path)
    with pytest.raises(InputError, match="made by a newer granforce"):
        store.save("walk", {"seed": 1}, walk_dataset(), version=1)
    assert sorted(store.path.rglob("*")) == before
    assert len(open_store(store.path, readonly=True)) == 1


@pytest.mark.parametrize("name", ["~nouser/x", "x" * 300, "a\0b", "loop"])
def test_what_cannot_be_a_path_is_one_line(away, name):
    (away / "loop").symlink_to("loop")
    with pytest.raises(InputError) as told:
        open_store(name)
    assert "\n" not in str(told.value)


def test_entry_under_the_name_of_another_is_not_taken_for_it(store):
    name = store.save("walk", PARAMS, walk_dataset(), version=1)
    other = store.name("walk", PARAMS | {"mu": 0.2}, version=1)
    shutil.copytree(store.path / name, store.path / other)
    with pytest.warns(UserWarning, match=other):
        assert store.load("walk", PARAMS | {"mu": 0.2}, version=1) is None
    assert list(store) == [name]


def test_entry_with_damaged_metadata_is_left_out(store):
    name = store.save("walk", PARAMS, walk_dataset(), version=1)
    damage_metadata(store.path / name)
    with pytest.warns(UserWarning, match="metadata"):
        assert store.entries() == []
    assert list(store) == [] and name not in store
    assert store.clear() == 1 and store.verify() == []


def test_damaged_root_is_made_anew(store):
    store.save("walk", PARAMS, walk_dataset(0), version=1)
    (store.path / "zarr.json").write_text("{")
    again = open_store(store.path)
    assert again.load("walk", PARAMS, version=1) is not None
    again.save("walk", PARAMS | {"seed": 4}, walk_dataset(1), version=1)
    assert len(list(zarr.open_group(store.path, mode="r").group_keys())) == 2


def test_folder_removed_under_an_open_store(store):
    store.save("walk", PARAMS, walk_dataset(), version=1)
    shutil.rmtree(store.path)
    assert store.load("walk", PARAMS, version=1) is None and not store.exists
    store.save("walk", PARAMS, walk_dataset(), version=1)
    assert len(open_store(store.path, readonly=True)) == 1


def test_clear(store):
    for seed in range(3):
        store.save("walk", {"seed": seed}, walk_dataset(seed), version=1)
    store.save("uniform", {"seed": 0}, walk_dataset(), version=1)
    assert store.clear("walk") == 3
    assert [e.kind for e in store.entries()] == ["uniform"]
    assert store.clear() == 1 and len(store) == 0
    assert [item.name for item in store.path.iterdir()] == ["zarr.json"]


# opening


def test_location(tmp_path, monkeypatch):
    monkeypatch.setenv("GRANFORCE_CACHE", str(tmp_path / "from_environment"))
    assert open_store(tmp_path / "argument").path == tmp_path / "argument"
    assert open_store().path == tmp_path / "from_environment"
    monkeypatch.setenv("HOME", str(tmp_path))
    assert open_store("~/home").path == tmp_path / "home"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    for unset in (
        lambda: monkeypatch.setenv("GRANFORCE_CACHE", ""),
        lambda: monkeypatch.delenv("GRANFORCE_CACHE"),
    ):
        unset()
        assert default_path() == Path(platformdirs.user_cache_dir("granforce"))
        assert tmp_path in default_path().parents and default_path().name == "granforce"


def test_a_missing_store_is_made_by_the_first_entry(tmp_path):
    path = tmp_path / "a" / "b"
    with pytest.raises(InputError, match="no store at"):
        open_store(path, readonly=True)
    store = open_store(path)
    assert not store.exists and not (tmp_path / "a").exists()
    store.save("walk", PARAMS, walk_dataset(), version=1)
    assert len(open_store(path, readonly=True)) == 1


def test_what_is_not_a_store_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "thesis.tex").write_text("")
    (tmp_path / "empty").mkdir()
    zarr.create_group(tmp_path / "foreign", zarr_format=3)
    for readonly in (False, True):
        with pytest.raises(InputError, match="is a file, not a store"):
            open_store(tmp_path / "file", readonly=readonly)
        with pytest.raises(InputError, match=r"contains 'thesis\.tex'"):
            open_store(tmp_path / "home", readonly=readonly)
        with pytest.raises(InputError, match=r"contains 'zarr\.json'"):
            open_store(tmp_path / "foreign", readonly=readonly)
    with pytest.raises(InputError, match="empty, not a store"):
        open_store(tmp_path / "empty", readonly=True)
    with pytest.raises(InputError, match="cannot write"):
        open_store(tmp_path / "file" / "below")
    assert [item.name for item in (tmp_path / "home").iterdir()] == ["thesis.tex"]


def test_readonly_store(store):
    name = store.save("walk", PARAMS, walk_dataset(), version=1)
    (store.path / ".tmp-elsewhere-1-0").mkdir()
    os.utime(store.path / ".tmp-elsewhere-1-0", (0, 0))
    before = sorted(store.path.rglob("*"))
    readonly = open_store(store.path, readonly=True)
    assert readonly.load("walk", PARAMS, version=1) is not None
    for write in (
        lambda: readonly.save("walk", {}, walk_dataset(), version=1),
        lambda: readonly.save("walk", PARAMS, walk_dataset(), version=1),
        readonly.clear,
        readonly.clean,
    ):
        with pytest.raises(InputError, match="read-only"):
            write()
    assert sorted(store.path.rglob("*")) == before and name in readonly


@pytest.mark.skipif(os.name != "posix", reason="mode bits")
def test_folder_that_cannot_be_written_can_be_read(nobody):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "store"
        store = open_store(path)
        store.save("walk", PARAMS, walk_dataset(), version=1)
        path.chmod(0o555)
        try:
            unwritable = open_store(path)
            assert unwritable.load("walk", PARAMS, version=1) is not None
            with pytest.raises(InputError, match=r"cannot write to the store .*Permission denied"):
                unwritable.save("walk", {}, walk_dataset(), version=1)
            with pytest.raises(InputError, match="cannot write"):
                unwritable.refuse_unwritable()
            with pytest.raises(InputError, match="cannot write"):
                unwritable.clear()
            with pytest.raises(InputError, match="cannot write"):
                open_store(path / "below")
        finally:
            path.chmod(0o755)


def test_temporaries_of_dead_writers_are_cleaned(store):
    store.path.mkdir()
    ended = subprocess.Popen(["true"])
    ended.wait()
    zombie = subprocess.Popen(["true"])  # ended, but not waited for
    os.waitid(os.P_PID, zombie.pid, os.WEXITED | os.WNOWAIT)
    host = re.sub(r"\W", "_", socket.gethostname())  # as in the name of every temporary
    ages = {
        f".tmp-{host}-{ended.pid}-aa": 0,  # dead
        f".tmp-{host}-{zombie.pid}-ff": 0,  # dead too
        f".tmp-{host}-{os.getpid()}-bb": 0,  # alive
        f".tmp-{host}-{os.getpid()}-cc": 4000,  # too old for any writer
        f".tmp-far_away-{ended.pid}-dd": 0,  # nobody here can tell
        ".tmp-far_away-1-ee": 4000,
    }
    for name, age in ages.items():
        (store.path / name).mkdir()
        (store.path / name / "zarr.json").write_text("{}")
        os.utime(store.path / name, (time.time() - age, time.time() - age))
    for name, age in ((".granforce-ab.part", 0), (".granforce-cd.part", 4000)):  # of names.json
        (store.path / name).write_text("{}")
        os.utime(store.path / name, (time.time() - age, time.time() - age))
    assert store.clean() == 5
    assert [item.name for item in store.path.glob("*.part")] == [".granforce-ab.part"]
    zombie.wait()
    kept = {item.name[-2:] for item in store.path.glob(".tmp-*")}
    assert kept == {"bb", "dd"}
    os.utime(store.path / f".tmp-far_away-{ended.pid}-dd", (0, 0))
    open_store(store.path)
    assert {item.name[-2:] for item in store.path.glob(".tmp-*")} == {"bb"}


def test_failed_write_leaves_nothing(store):
    with files_of(4000), pytest.raises(InputError, match="File too large"):
        store.save("walk", PARAMS, walk_dataset(), version=1)
    assert [item.name for item in store.path.iterdir()] == ["zarr.json"]


# competing and killed writers


def save_many(path, seeds, together):
    """Target of a writer process: one entry per seed, begun at the same moment as the others."""
    store = open_store(path)
    together.wait(20)
    for seed in seeds:
        store.save("walk", {"seed": seed}, walk_dataset(seed), version=1)


@pytest.mark.parametrize("same", [True, False])
def test_concurrent_writers(tmp_path, same):
    path = tmp_path / "store"
    together = processes.Barrier(2)
    seeds = [range(12), range(12) if same else range(12, 24)]
    writers = [processes.Process(target=save_many, args=(path, s, together)) for s in seeds]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join(30)
        assert writer.exitcode == 0
    store = open_store(path, readonly=True)
    assert len(store) == len({*seeds[0], *seeds[1]})
    assert all(verdict.ok for verdict in store.verify())
    assert list(path.glob(".tmp-*")) == []
    for entry in store.entries():
        xr.testing.assert_equal(store[entry.name].load(), walk_dataset(entry.params["seed"]))


def test_loser_of_the_race_discards_its_copy(store, monkeypatch):
    """Another writer finishes the same entry between our check and our rename."""
    rival = open_store(store.path)
    write = entries.write

    def overtaken(*args):
        write(*args)
        monkeypatch.setattr(entries, "write", write)
        rival.save("walk", PARAMS, walk_dataset(0), version=1)

    monkeypatch.setattr(entries, "write", overtaken)
    store.save("walk", PARAMS, walk_dataset(1), version=1)
    xr.testing.assert_equal(store.load("walk", PARAMS, version=1), walk_dataset(0))
    assert list(store.path.glob(".tmp-*")) == []


def save_until_killed(path, first):
    store = open_store(path)
    for seed in range(first, first + 10_000):
        store.save("walk", {"seed": seed}, walk_dataset(seed), version=1)


def pace(path):
    """How long saving an entry takes on this machine just now, s."""
    store, before = open_store(path), time.monotonic()
    for seed in range(8):
        store.save("walk", {"seed": seed}, walk_dataset(seed), version=1)
    return (time.monotonic() - before) / 8


def kill_writers(path, kills, delays):
    """So many writers killed at work, one after the other; how many left a part behind."""
    interrupted, took = 0, pace(path.with_name("pace"))
    for kill in range(kills):
        left_before = set(path.glob(".tmp-*"))
        writer = processes.Process(target=save_until_killed, args=(path, 10_000 * kill))
        writer.start()
        deadline = time.monotonic() + 120
        while set(path.glob(".tmp-*")) <= left_before and time.monotonic() < deadline:
            time.sleep(0.002)  # until the writer is at work
        time.sleep(delays.uniform(0, 4 * took))
        os.kill(writer.pid, signal.SIGKILL)
        writer.join()
        assert writer.exitcode == -signal.SIGKILL
        store = open_store(path, readonly=True)
        interrupted += bool(set(path.glob(".tmp-*")) - left_before)
        assert [v for v in store.verify() if not v.ok] == []
    assert len(store) > 0
    open_store(path)
    assert list(path.glob(".tmp-*")) == []
    return interrupted


@pytest.mark.skipif(os.name != "posix", reason="SIGKILL")
def test_killed_writers_leave_no_broken_entry(tmp_path):
    # Were there fewer, the kills fell between the saves and tested nothing.
    assert kill_writers(tmp_path / "store", 8, random.Random(1)) >= 2


@pytest.mark.stress
@pytest.mark.skipif(os.name != "posix", reason="SIGKILL")
@pytest.mark.parametrize("batch", range(49))
def test_a_thousand_killed_writers_leave_no_broken_entry(tmp_path, batch):
    """980 writers; twenty parents of scans are killed in test_scan."""
    assert kill_writers(tmp_path / "store", 20, random.Random(100 + batch)) >= 5


# cost


def test_import_is_light():
    code = (
        "import sys, granforce.study.store\n"
        "print(*{m.split('.')[0] for m in sys.modules} & {'numba', 'panel', 'holoviews'})"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert loaded.returncode == 0 and loaded.stdout.split() == []
