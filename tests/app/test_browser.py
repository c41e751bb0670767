"""The page in a browser: it plays on the client, to scale, and asks the net for nothing."""

import os
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest
from small_store import DISKS, KEPT, ROOT

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not CHROMIUM.exists(), reason="needs chromium at /usr/bin/chromium"),
]

MODEL = "Bokeh.documents[0].get_model_by_name"


@pytest.fixture(scope="module")
def address(shipped, tmp_path_factory):
    """The app, served from the repository's root on a free port, with stores of its own."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    folder = tmp_path_factory.mktemp("served")
    env = os.environ | {"GRANFORCE_DATA": str(shipped), "GRANFORCE_CACHE": str(folder / "cache")}
    command = [sys.executable, "-m", "panel", "serve", "app", "--port", str(port)]
    with open(folder / "log", "w") as log:
        server = subprocess.Popen(command, cwd=ROOT, env=env, stdout=log, stderr=log)
    url = f"http://localhost:{port}/app"
    try:
        _wait_until_served(url, server, folder / "log")
        yield url
    finally:
        server.terminate()
        server.wait(20)


def _wait_until_served(url, server, log):
    for _ in range(300):
        if server.poll() is not None:
            pytest.fail(f"the server ended: {log.read_text()}")
        try:
            urllib.request.urlopen(url, timeout=30).close()
            return
        except (urllib.error.URLError, ConnectionError):
            time.sleep(0.1)
    pytest.fail(f"nothing served: {log.read_text()}")


@pytest.fixture(scope="module")
def chromium():
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as context:
        browser = context.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def page(chromium, address):
    """The page, loaded; afterwards no error was told and nothing was asked from elsewhere."""
    page = chromium.new_page(viewport={"width": 1280, "height": 900})
    errors, foreign = [], []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda told: told.type == "error" and errors.append(told.text))
    page.on("request", lambda request: _is_foreign(request.url) and foreign.append(request.url))
    page.goto(address)
    page.wait_for_function(f"() => window.Bokeh?.documents[0] && {MODEL}('links')", timeout=30_000)
    page.wait_for_function(f"() => Math.max(...{MODEL}('links').get_column('width')) > 0")
    yield page
    page.close()
    assert not [error for error in errors if "favicon" not in error]
    assert not foreign


def _is_foreign(url):
    return not url.startswith(("http://localhost:", "ws://localhost:", "data:", "blob:"))


def column(page, source, name):
    """A column of a plot as the browser holds it."""
    return page.evaluate(f"() => Array.from({MODEL}('{source}').get_column('{name}'))")


def scale(page):
    """px per unit along x and y."""
    return page.evaluate(f"""() => {{
        const {{inner_width, inner_height, x_range, y_range}} = {MODEL}('packing')
        return [inner_width / (x_range.end - x_range.start),
                inner_height / (y_range.end - y_range.start)]
    }}""")


def settled(page):
    """Wait until the layout no longer moves."""
    page.wait_for_function(f"() => {MODEL}('packing').inner_width > 100")
    page.wait_for_timeout(500)


def test_disks_are_to_scale(page):
    settled(page)
    for width in (1280, 1000, 400):
        page.set_viewport_size({"width": width, "height": 900})
        page.wait_for_timeout(500)
        across, up = scale(page)
        assert across == pytest.approx(up, rel=1e-3) and across > 10
        assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_play_changes_the_chains_without_the_server(page):
    settled(page)
    page.evaluate("""() => {
        window.told = 0
        const send = WebSocket.prototype.send
        WebSocket.prototype.send = function (...given) { window.told += 1; send.apply(this, given) }
    }""")
    before = column(page, "links", "width")
    page.locator("input.speed").fill("3")
    page.locator("button.play").click()
    page.wait_for_timeout(700)
    page.locator("button.play").click()
    assert column(page, "links", "width") != before
    stopped = column(page, "links", "width")
    page.wait_for_timeout(400)
    assert column(page, "links", "width") == stopped
    assert page.evaluate("told") <= 2  # of nearly six frames; a ping may fall in


def test_step_back_and_restart(page):
    start = column(page, "links", "f_n")
    page.locator("button.step").click()
    assert column(page, "links", "f_n") != start
    assert page.locator("b.state").inner_text().endswith(" of 30")
    page.locator("button.step").click()
    page.locator("button.back").click()
    page.locator("button.restart").click()
    assert column(page, "links", "f_n") == start
    assert page.locator("b.state").inner_text() == "original"


def test_intervals_grow_with_the_walk_and_shrink_on_the_way_back(page):
    def extent():
        pairs = zip(column(page, "bars", "high"), column(page, "bars", "low"), strict=True)
        return sum(high - low for high, low in pairs)

    grown = []
    for frame in (1, 4, KEPT, 4):
        page.locator("input.scrub").fill(str(frame))
        grown.append(extent())
    assert grown[0] == 0 and grown[0] < grown[1] < grown[2]
    assert grown[3] == pytest.approx(grown[1])


def test_mu_typed_is_computed_and_shown(page):
    page.get_by_label("μ", exact=True).fill("0.4")
    disks = page.get_by_label("Disks N")
    disks.fill(str(DISKS))
    disks.press("Tab")
    page.get_by_role("button", name="Show or compute").click()
    page.get_by_text("μ = 0.4, N = 30").wait_for(timeout=40_000)
    page.wait_for_function(f"() => {MODEL}('links').get_column('f_n').some(f => f > 0)")


def test_wrong_mu_is_one_clear_line(page):
    page.get_by_label("μ", exact=True).fill("-2")
    page.get_by_role("button", name="Show or compute").click()
    page.get_by_text("friction coefficient must be finite and ≥ 0").wait_for(timeout=10_000)
