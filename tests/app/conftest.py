"""The app is a folder beside the package: make it importable, and give it a small store."""

import sys
from pathlib import Path

import pytest

from granforce import study
from granforce.store import open_store

ROOT = Path(__file__).resolve().parents[2]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

DISKS, STATES, KEPT = 30, 30, 12


def cell_parameters(mu, **options):
    """Walk parameters of the small store's cells."""
    packing = study.packing_parameters(DISKS, mu, 1)
    return study.walk_parameters(packing, STATES, 0, relax="nearest", keep=KEPT, **options)


@pytest.fixture(scope="session")
def shipped(tmp_path_factory):
    """A folder with finished walks at three values of μ, float32 as in the shipped store."""
    path = tmp_path_factory.mktemp("shipped") / "start.zarr"
    store = open_store(path)
    for mu in (0, 0.1, 1):
        study.get_walk(store, cell_parameters(mu), dtypes={"states": "float32"})
    return path


@pytest.fixture
def library(shipped, tmp_path):
    from app.data import Library

    return Library(shipped, tmp_path / "cache.zarr")


@pytest.fixture
def state(library):
    from app.state import AppState

    return AppState(library)
