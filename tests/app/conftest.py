"""A small store for the app's tests."""

import time

import pytest
from serving import CHROMIUM, FLAGS, MANY, painted, serve
from small_store import cell_parameters

from granforce.study import cells as study
from granforce.study import kinds
from granforce.study.store import open_store

PATIENCE = 60_000  # ms, on a busy machine


def pytest_collection_modifyitems(items):
    """Tests in a browser are left out where there is none."""
    for item in items:
        if item.get_closest_marker("browser") and not CHROMIUM.exists():
            item.add_marker(pytest.mark.skip(reason=f"needs chromium at {CHROMIUM}"))


@pytest.fixture(scope="session")
def shipped(tmp_path_factory):
    """A folder with finished walks at three values of μ, float32 as in the shipped store."""
    path = tmp_path_factory.mktemp("shipped") / "start.zarr"
    store = open_store(path)
    for mu in (0, 0.1, 1):
        study.get(store, kinds.WALK, cell_parameters(mu), dtypes={"states": "float32"})
    return path


@pytest.fixture(scope="module")
def address(shipped, tmp_path_factory):
    """The app, served with stores of its own, once for each module."""
    with serve(tmp_path_factory.mktemp("served"), GRANFORCE_DATA=str(shipped)) as (url, _):
        yield url


@pytest.fixture(scope="module")
def chromium():
    """Debian's chromium, once for each module."""
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as context:
        browser = context.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        browser.fresh_context = browser.new_context  # of somebody who was never here
        browser.new_context = lambda **options: _returning(browser, **options)
        browser.new_page = lambda **options: browser.new_context(**options).new_page()
        yield browser
        browser.close()


def _returning(browser, **options):
    """A context of somebody who knows the page: no tour, and nothing moves by itself."""
    context = browser.fresh_context(**{"reduced_motion": "reduce"} | options)
    context.add_init_script("try { localStorage.setItem('granforce.tour', 'seen') } catch {}")
    return context


@pytest.fixture
def opening(chromium, address):
    """opening(query, width, height, …): a page on its way; at the end no error was told.

    first: whether it is of somebody who was never here; at: another server's address; wanted: what
    errors may say; further options are of its context.
    """
    errors, contexts, allowed = [], [], ["favicon"]

    def opening(query, width, height, first=False, at=None, wanted=(), **options):
        begin = chromium.fresh_context if first else chromium.new_context
        context = begin(viewport={"width": width, "height": height}, **options)
        contexts.append(context)
        context.set_default_timeout(PATIENCE)
        page = context.new_page()
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda told: told.type == "error" and errors.append(told.text))
        allowed.extend(wanted)
        page.goto((at or address) + query)
        return page

    yield opening
    for context in contexts:
        context.close()
    assert not [error for error in errors if not any(words in error for words in allowed)]


@pytest.fixture
def visit(opening):
    """visit(query, width, height, …): a page with its tabs, by `opening`."""

    def visit(query="", width=1280, height=900, **options):
        page = opening(query or MANY, width, height, **options)
        painted(page, PATIENCE)
        page.locator("[role=tab]").first.wait_for(state="attached")  # unseen while a tour begins
        return page

    return visit


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
    while state.work.busy and time.monotonic() < end:
        time.sleep(0.005)
        state.work.poll()
    assert not state.work.busy
