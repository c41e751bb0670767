"""A small store, the app served from it, and pages of a browser, for the app's tests."""

import itertools
import json
import re

import numpy as np
import pytest
from serving import (
    CHROMIUM,
    FLAGS,
    KNOW,
    MANY,
    PATIENCE,
    ask,
    bars_drawn,
    more,
    no_more,
    painted,
    picture,
    scene,
    serve,
    shows,
    until,
)
from small_store import cell_parameters
from visitor import wait_for

from app.browser.bundle import APP
from app.results.library import Library
from app.state.app_state import AppState
from granforce.study import cells as study
from granforce.study import kinds
from granforce.study.store import open_store

FRICTIONS = (round(0.4 + k / 1000, 3) for k in itertools.count(1))
HERE = re.compile(r"(http|ws)://localhost:|data:|blob:|file:|about:")


def pytest_collection_modifyitems(items):
    """Tests in a browser are marked, and left out where there is none."""
    for item in items:
        if "chromium" in item.fixturenames:
            item.add_marker("browser")
            if not CHROMIUM.exists():
                item.add_marker(pytest.mark.skip(reason=f"needs chromium at {CHROMIUM}"))


@pytest.fixture(scope="session")
def shipped(tmp_path_factory):
    """A folder with finished walks at three values of μ, float32 as in the shipped store."""
    path = tmp_path_factory.mktemp("shipped") / "start.zarr"
    store = open_store(path)
    for mu in (0, 0.1, 1):
        study.get(store, kinds.WALK, cell_parameters(mu), dtypes={"states": "float32"})
    return path


@pytest.fixture(scope="session")
def served(shipped, tmp_path_factory):
    """Address and folder of the app, served with stores of its own, once for each worker."""
    folder = tmp_path_factory.mktemp("served")
    with serve(folder, GRANFORCE_DATA=str(shipped)) as (url, _):
        yield url, folder


@pytest.fixture
def own_mu():
    """A friction that no other test on this server has its packing made at."""
    return next(FRICTIONS)


@pytest.fixture(scope="session")
def address(served):
    """Address of the app."""
    return served[0]


@pytest.fixture(scope="module")
def chromium():
    """Debian's chromium, once for each module: no asyncio works beside it in the same process."""
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as context:
        browser = context.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def context(chromium):
    """context(first=False, **options): the module's one browser context with these options.

    Its pages are those of somebody who knows the page: no tour, and nothing moves by itself; or of
    somebody who was never here, each of them. They share the scripts that were fetched and, as a
    blank page keeps it open, a window: a page alone costs twice as much.
    """
    made = {}

    def context(first=False, **options):
        key = first, *sorted(options.items())
        if key not in made:
            if not first:
                options = {"reduced_motion": "reduce"} | options
            made[key] = chromium.new_context(**options)
            made[key].grant_permissions(["clipboard-read", "clipboard-write"])
            made[key].set_default_timeout(PATIENCE)
            made[key].add_init_script(f"try {{ {FORGET if first else KNOW} }} catch {{}}")
            made[key].new_page()
        return made[key]

    return context


# What a tab does as it begins: once, or each time that it goes to another page.
FORGET = "sessionStorage.begun || localStorage.clear(); sessionStorage.begun = true"


def begun(context, problems, width, height):
    """A new page, whose errors and requests to elsewhere are added to a list."""
    page = context.new_page()
    page.set_viewport_size({"width": width, "height": height})
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda told: told.type == "error" and problems.append(told.text))
    page.on("request", lambda sent: HERE.match(sent.url) or problems.append(sent.url))
    return page


def with_tabs(page):
    """Wait until a page has its picture and its tabs; the page."""
    painted(page)
    page.locator("[role=tab]").first.wait_for(state="attached")  # unseen while a tour begins
    return page


@pytest.fixture
def opening(context, address, request):
    """opening(query, width, height, …): a page on its way.

    At the end no error was told and nothing was asked of the net, and with PICTURES set the page is
    kept as a picture. first: whether it is of somebody who was never here; at: another server's
    address; wanted: what errors may say; prepare(page): done before it goes anywhere; further
    options are of its context.
    """
    problems, pages, allowed = [], [], ["favicon"]

    def opening(query, width, height, *, first=False, at=None, wanted=(), prepare=None, **options):
        page = begun(context(first, **options), problems, width, height)
        pages.append(page)
        allowed.extend(wanted)
        if prepare:
            prepare(page)
        page.goto((at or address) + query)
        return page

    yield opening
    for number, page in enumerate(pages):
        if not page.is_closed():
            picture(page, f"{request.module.__name__}/{request.node.name}-{number}", full_page=True)
            page.close()
    assert not [told for told in problems if not any(words in told for words in allowed)]


@pytest.fixture
def visit(opening):
    """visit(query, width, height, …): a page with its tabs, by `opening`."""

    def visit(query="", width=1280, height=900, **options):
        return with_tabs(opening(query or MANY, width, height, **options))

    return visit


@pytest.fixture(scope="module")
def lasting(context, address):
    """lasting(query): a page with its tabs for all tests of the module, which leave it as it is."""
    problems, pages = [], {}

    def lasting(query=MANY):
        if query not in pages:
            pages[query] = begun(context(), problems, 1280, 900)
            pages[query].goto(address + query)
        return with_tabs(pages[query])

    yield lasting
    for page in pages.values():
        page.close()
    assert not problems


@pytest.fixture
def page(lasting):
    """One page for many tests, put back to the original network at μ = 0.1, nothing selected."""
    page = lasting()
    bars_drawn(page)
    if scene(page, "scene.geometry.mu") != 0.1:
        ask(page, 0.1)
        shows(page, 0.1)
    more(page).locator(".skips").click()  # takes the focus from fields, which use keys
    page.keyboard.press("Home")
    scene(page, "scene.reset()")
    page.mouse.move(5, 5)
    if scene(page, "scene.hand.replay.held !== null"):
        page.keyboard.press("Escape")
    let_go = "scene.selected !== null && scene.onSelect(null)"  # again, where an answer was late
    until(page, f"({let_go}, scene.selected === null && scene.hand.replay.held === null)")
    no_more(page, "pull=")
    return page


@pytest.fixture
def library(shipped, tmp_path):
    return Library(shipped, tmp_path / "cache.zarr")


@pytest.fixture
def visited(library):
    """visited(query, library): the state of a page that a link opened, once it is at rest."""

    def visited(query="", library=library):
        state = AppState(library, query=query)
        wait_for(state)
        return state

    return visited


@pytest.fixture
def state(visited):
    """The state of a page that has come to rest."""
    return visited()


SCRIPTS = "http://scripts/"


@pytest.fixture(scope="module")
def blank(chromium):
    """A page that imports scripts as the modules they are, and nothing else."""
    page = chromium.new_page()
    page.route(f"{SCRIPTS}**", _answer)
    page.goto(SCRIPTS)
    return page


def _answer(route):
    name = route.request.url.removeprefix(SCRIPTS)
    if name.endswith(".js"):
        route.fulfill(path=APP / name, content_type="text/javascript")
    else:
        route.fulfill(body="<!doctype html>", content_type="text/html")


@pytest.fixture
def run(blank):
    """run(scripts, function, given): what a function of their exports and of given returns."""

    def run(scripts, function, **given):
        imports = ", ".join(f'import("./{name}.js")' for name in scripts.split())
        return blank.evaluate(
            f"""async (given) => {{
                const parts = await Promise.all([{imports}])
                return ({function})(Object.assign({{}}, ...parts), given)
            }}""",
            json.loads(json.dumps(given, default=np.ndarray.tolist)),
        )

    return run
