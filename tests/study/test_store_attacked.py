"""A store whose bytes rot, and whose clock goes backwards."""

import os
import re
import socket
import time
import warnings

import numpy as np
import xarray as xr

from granforce.study.schema import labelled
from granforce.study.store import Verdict, open_store

PARAMS = {"mu": 0.1, "grains": 400, "seed": 3}


def dataset():
    rng = np.random.default_rng(0)
    return labelled(
        {
            "states": rng.normal(size=(250, 7, 2)),
            "residual": rng.random(250),
            "sweeps": rng.integers(0, 1000, 250),
            "backbone": np.arange(7),
        }
    )


def test_two_hundred_bytes_changed_are_told_or_change_nothing(tmp_path):
    """One byte of any file at a time: what is loaded is what was saved, or nothing with a word."""
    store, rng, saved = open_store(tmp_path / "store"), np.random.default_rng(1), dataset()
    entry = store.path / store.save("walk", PARAMS, saved, version=1)
    files = sorted(path for path in entry.rglob("*") if path.is_file())
    refused = 0
    for _ in range(200):
        path = files[rng.integers(len(files))]
        content = path.read_bytes()
        at = int(rng.integers(len(content)))
        path.write_bytes(
            content[:at] + bytes([content[at] ^ rng.integers(1, 256)]) + content[at + 1 :]
        )
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            found = store.load("walk", PARAMS, version=1)
        if found is None:
            refused += 1
            assert len(told) == 1 and "is damaged" in str(told[0].message)
            assert not store.verify()[0].ok
        else:
            xr.testing.assert_identical(found.drop_attrs(), saved.drop_attrs())
        path.write_bytes(content)
    assert refused > 100
    assert store.verify()[0].ok


def test_a_clock_that_goes_backwards_takes_nothing_from_writers(tmp_path):
    store = open_store(tmp_path / "store")
    host = re.sub(r"\W", "_", socket.gethostname())
    ours = store.path / f".tmp-{host}-{os.getpid()}-aa"
    ours.mkdir(parents=True)
    elsewhere = store.path / ".tmp-far_away-1-ee"
    elsewhere.mkdir()
    for made in (ours, elsewhere):
        os.utime(made, (time.time() + 1e6,) * 2)
    assert store.clean() == 0
    name = store.save("walk", PARAMS, dataset(), version=1)
    assert store.verify() == [Verdict(name, True, "")]
    xr.testing.assert_equal(store.load("walk", PARAMS, version=1), dataset())
    assert ours.is_dir() and elsewhere.is_dir()
