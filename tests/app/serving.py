"""The app served as a visitor gets it, and what is asked of a page in a browser."""

import os
import socket
import subprocess
import sys
import time
import urllib.request
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from small_store import ROOT

CHROMIUM = Path(os.environ.get("CHROMIUM", "/usr/bin/chromium"))
# Of 400 disks, as older links have it; an address without a view says the same.
MANY = "?scene=many"
PATIENCE = 180_000  # ms, on a busy machine
# What makes a browser one that was here before, for the small scenes.
SEEN = "['tour', 'guess', 'hand', 'network']"
KNOW = f"for (const what of {SEEN}) localStorage.setItem(`granforce.${{what}}`, 'seen')"
FLAGS = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]
# Closed pages are soon given up, but not too soon for a busy machine: a session given
# up before its page has connected comes back without what panel serve knows of it.
CLOSED = ("--unused-session-lifetime", "10000", "--check-unused-sessions", "500")
# The newest model of a name, as the page itself looks it up: what moves to another place is made
# anew there, and for a moment there are two.
MODEL = (
    "(name => [...Bokeh.documents[0].all_models].findLast(model => model.name === name) ?? null)"
)


@contextmanager
def serve(folder, *options, port=None, wait=True, **variables):
    """Address and process of the app on a free port or this one; cache and log are in folder."""
    port = port or free_port()
    env = os.environ | variables
    env.setdefault("GRANFORCE_CACHE", str(folder / "cache"))
    # The program, not `python -m panel`, which would find modules in the working folder too.
    panel = Path(sys.executable).with_name("panel")
    command = [str(panel), "serve", "app", "--port", str(port), *options]
    with open(folder / "log", "a") as log:
        server = subprocess.Popen(command, cwd=ROOT, env=env, stdout=log, stderr=log)
    try:
        if wait:
            address = f"http://localhost:{port}/static/js/bokeh.min.js"
            wait_until_served(address, server, folder / "log")
        yield f"http://localhost:{port}/app", server
    finally:
        server.terminate()
        server.wait(60)  # it may be compiling


def free_port():
    """A port that nobody listens on just now."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def wait_until_served(url, server, log):
    """Wait until an address answers, however busy the machine; RuntimeError if the server ends."""
    for _ in range(6000):
        if server.poll() is not None:
            raise RuntimeError(f"the server ended: {log.read_text()}")
        try:
            urllib.request.urlopen(url, timeout=30).close()
            return
        except OSError:
            time.sleep(0.1)
    raise RuntimeError(f"nothing served: {log.read_text()}")


def how_it_is_made(page):
    """Open what only those need who compute something of their own; the page."""
    heading = page.get_by_role("button", name="How it is made")
    if heading.get_attribute("aria-expanded") != "true":
        heading.click()
    return page


def scales(page):
    """Open where colours are full, and how wide lines are; the page."""
    if page.locator(".legend details:not([open])").count():
        page.locator(".legend summary").click()
    return page


def more(page):
    """Open what compares and checks networks; the page."""
    if page.locator(".extras:not([open])").count():
        page.locator(".extras summary").click()
    return page


def painted(page):
    """Wait until the packing has been painted; how many frames were."""
    page.locator(".scene").wait_for()
    until(page, "scene.painted > 0")
    return scene(page, "scene.painted")


def laid_out(page, name):
    """Wait until a figure has its place on the page."""
    page.wait_for_function(
        f"""() => {{
            const fig = {MODEL}("{name}")
            return fig && !fig.properties.inner_width.is_unset && fig.inner_width > 50
        }}"""
    )


def at_rest(place):
    """The box of a place, once it has been the same in twenty frames."""
    place.evaluate(
        """(element, patience) => new Promise((done, failed) => {
            const end = performance.now() + patience
            let before = "", same = 0
            const look = () => {
                const now = JSON.stringify(element.getBoundingClientRect())
                same = now === before ? same + 1 : 0
                before = now
                if (same >= 20) done()
                else if (performance.now() > end) failed(new Error(`it never rests: ${now}`))
                else requestAnimationFrame(look)
            }
            look()
        })""",
        PATIENCE,
    )
    return place.bounding_box()


def frames(page, count):
    """Let a page paint so many times."""
    page.evaluate(
        """count => new Promise((done) => {
            const next = () => (count-- > 0 ? requestAnimationFrame(next) : done())
            next()
        })""",
        count,
    )


def bars_drawn(page):
    """Wait until the intervals of the contacts are there."""
    page.wait_for_function(f"() => {MODEL}('bars')?.get_length() > 0")


def column(page, source, name):
    """A column of a plot as the browser holds it."""
    return page.evaluate(f"() => Array.from({MODEL}('{source}').get_column('{name}'))")


def scene(page, expression):
    """An expression of `scene`, the Scene of the packing (app/packing/drawing/scene.js)."""
    return page.locator(".scene").evaluate(
        f"element => {{ const {{scene}} = element; return {expression} }}"
    )


def expect(locator):
    """Playwright's assertions on a locator, which wait: what a server answers comes later."""
    from playwright import sync_api  # not at the top: most tests need no browser

    sync_api.expect.set_options(timeout=PATIENCE)
    return sync_api.expect(locator)


def until(page, expression):
    """Wait for an expression of `scene`."""
    page.wait_for_function(
        f"element => {{ const {{scene}} = element; return {expression} }}",
        arg=page.locator(".scene").element_handle(),
    )


def shows(page, mu):
    """Wait until the packing at μ is on screen."""
    until(page, f"scene.geometry.mu === {mu}")


def ask(page, mu):
    """Ask for a friction by typing it."""
    typed = page.locator("input.typed")
    typed.fill(str(mu))
    typed.press("Enter")


def zoomed(page, by):
    """Turn the wheel, with the key that has it zoom."""
    page.keyboard.down("Control")
    page.mouse.wheel(0, by)
    page.keyboard.up("Control")


def searched(page, *parts):
    """Wait until the address has all these parts after its "?"."""
    page.wait_for_function("parts => parts.every((s) => location.search.includes(s))", arg=parts)


def no_more(page, part):
    """Wait until the address has no such part after its "?"."""
    page.wait_for_function("part => !location.search.includes(part)", arg=part)


def picture(page, name, **options):
    """What is seen of a page, as artefacts/NAME.png, where PICTURES is set: to be looked at."""
    if "PICTURES" in os.environ:
        page.screenshot(path=ROOT / "artefacts" / f"{name}.png", **options)


def chain(page):
    """(contact, x, y): the middle of the strongest chain well inside the picture, on the page."""
    return page.locator(".scene").evaluate(
        """e => {
            const {scene} = e, {geometry: g, size} = scene, box = e.getBoundingClientRect()
            let best, most = 0
            for (let k = 0; k < g.contact.length; k++) {
                const [x, y] = scene.toPixel((g.x0[k] + g.x1[k]) / 2, (g.y0[k] + g.y1[k]) / 2)
                const inside = [x, y].every((v) => v > 0.3 * size && v < 0.7 * size)
                if (inside && scene.width[k] > most) {
                    most = scene.width[k]
                    best = [g.contact[k], box.x + x, box.y + y]
                }
            }
            return best
        }"""
    )


def normal(page):
    return np.array(scene(page, "Array.from(scene.mixed.normal)"))


def pulled(page, up=60):
    """Drag the strongest chain upwards; returns it and what was there before."""
    contact, x, y = chain(page)
    before = normal(page)
    frames = scene(page, "scene.hand.frames")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 5)
    until(page, "scene.hand.rail !== null")
    for k in range(6):
        page.mouse.move(x, y - 5 - up * (k + 1) / 6)
    until(page, f"scene.hand.frames > {frames}")
    return contact, before


def place(page, x, y):
    """Where a point of force space is on the page."""
    return page.evaluate(
        """([x, y]) => {
            const page = Bokeh.documents[0]
            const view = page.views_manager.find_one(page.get_model_by_name("path_figure"))
            const box = view.canvas_view.el.getBoundingClientRect(), {x_scale, y_scale} = view.frame
            return [box.x + x_scale.compute(x), box.y + y_scale.compute(y)]
        }""",
        [x, y],
    )


def here(page):
    return [column(page, "current", name)[0] for name in "xy"]
