"""A small store for the app's tests."""

import pytest
from small_store import cell_parameters

from granforce import study
from granforce.store import open_store


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
