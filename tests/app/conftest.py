"""A small store for the app's tests."""

import time

import pytest
from serving import CHROMIUM, FLAGS
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


@pytest.fixture(scope="module")
def chromium():
    """Debian's chromium, once for each module."""
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as context:
        browser = context.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def library(shipped, tmp_path):
    from app.data import Library

    return Library(shipped, tmp_path / "cache.zarr")


@pytest.fixture
def state(library):
    """The state of a page that has come to rest."""
    from app.state import AppState

    state = AppState(library)
    wait_for(state)
    return state


@pytest.fixture(name="wait_for")
def wait_for_fixture():
    """See wait_for."""
    return wait_for


def wait_for(state, seconds=240):
    """Poll as the page does until no task runs any more; the first ones compile all kernels."""
    end = time.monotonic() + seconds
    while state.busy and time.monotonic() < end:
        time.sleep(0.005)
        state.poll()
    assert not state.busy
