"""Measures the app in Debian's chromium and prints what it found.

    python tests/app/measurements/measure.py [PART …]

Parts: opening (first picture, changes of μ, bytes), playing (painted frames a second of 400 disks),
stalls (of the server's event loop while pages and tabs open and while it computes), dragging (of a
force, in blocks too, and of the point in force space: frames a second, hand to picture), memory
(over open–close cycles).
Each starts a server of its own on the shipped store.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[k]) for k in (1, 3)]  # tests/app, and the repository

from playwright.sync_api import sync_playwright  # noqa: E402
from serving import (  # noqa: E402
    CHROMIUM,
    CLOSED,
    FLAGS,
    MANY,
    MODEL,
    ask,
    chain,
    here,
    painted,
    place,
    scene,
    serve,
    until,
)  # fmt: skip

SIZE = {"width": 1280, "height": 900}
# A place in the packing where a drag moves the view, and pulls nothing.
FREE = """[...Array(400).keys()].map((k) => [150 + 5 * (k % 20), 150 + 5 * Math.floor(k / 20)])
    .find(([x, y]) => {
        const box = scene.root.getBoundingClientRect()
        return scene.takenAt({ clientX: box.x + x, clientY: box.y + y }, false) === null
    })"""


BODIES = {
    MANY: "400 disks",
    "?scene=arch&mu=0.7&states=100": "arch",
    "?scene=wall&mu=0.65&states=100": "wall",
}


class Stage:
    """A server, a browser, and the lines printed."""

    def __init__(self, folder, address, server, browser):
        self.folder, self.address, self.server, self.browser = folder, address, server, browser

    def open(self, query="", still=False):
        """A new page without anything cached, painted; and the seconds that took.

        still: it does not play by itself.
        """
        motion = "reduce" if still else "no-preference"
        page = self.browser.new_context(viewport=SIZE, reduced_motion=motion).new_page()
        page.set_default_timeout(1_000_000)
        page.bytes = 0
        page.on("websocket", lambda ws: ws.on("framereceived", lambda data: _count(page, data)))
        page.goto(self.address + (query or MANY))
        painted(page)
        mark = "performance.getEntriesByName('packing painted')[0].startTime"
        return page, page.evaluate(mark) / 1000  # since the page was asked for

    def memory(self):
        """Resident memory of the server, MB."""
        status = Path(f"/proc/{self.server.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1024


def _count(page, data):
    page.bytes += len(data)


def opening(stage):
    """First paint cold and warm, changes of μ within the store, bytes sent."""
    times, page = [], None
    for _ in range(4):
        if page is not None:
            page.context.close()  # pages play, and would be painted by the same two cores
        page, seconds = stage.open()
        page.wait_for_timeout(3000)
        times.append(f"{seconds:.2f} s")
    print(f"first picture in a new browser: {times[0]} of a new server, then {times[1:]}")
    print(f"bytes for the page's contents over the socket: {page.bytes / 1e6:.2f} MB")
    slider = page.locator(".friction input[type=range]")
    for visit in ("first", "second"):
        spent, sent = [], []
        for _ in range(3):
            for key in ("ArrowRight", "ArrowLeft"):
                before, bytes_before = scene(page, "scene.geometry.mu"), page.bytes
                begin = time.perf_counter()
                slider.press(key)
                page.wait_for_function(
                    "([element, mu]) => element.scene.geometry.mu !== mu",
                    arg=[page.locator(".scene").element_handle(), before],
                    polling=5,
                )
                spent.append(time.perf_counter() - begin)
                page.wait_for_timeout(400)
                sent.append(page.bytes - bytes_before)
        print(
            f"change of μ within the store, {visit} round: longest {1000 * max(spent):.0f} ms, "
            f"mean {1000 * sum(spent) / len(spent):.0f} ms; {max(sent) / 1e6:.2f} MB at most"
        )


def playing(stage):
    """400 disks: painted frames a second, and what they cost the server."""
    page, _ = stage.open(still=True)
    page.wait_for_timeout(4000)
    page.locator("input.speed").fill("1")
    print(f"segments {scene(page, 'scene.counts')}")
    before = page.bytes
    page.locator("button.play").click()
    rate, frames = _rate(page, lambda: page.wait_for_timeout(3000))
    page.locator("button.play").click()
    sent = (page.bytes - before) / frames
    print(f"playing: {rate:.1f} painted frames a second, {sent:.0f} bytes a frame")
    box = page.locator(".scene").bounding_box()
    free = scene(page, FREE)
    x, y = box["x"] + free[0], box["y"] + free[1]
    page.mouse.move(x, y)
    page.mouse.down()

    def drag():
        for k in range(90):
            page.mouse.move(x + 4 * (k % 30), y + 2 * (k % 30))
            page.wait_for_timeout(10)

    rate, _ = _rate(page, drag)
    page.mouse.up()
    print(f"panning: {rate:.1f} painted frames a second")
    page.context.close()


def _rate(page, action):
    """Painted frames a second while something is done, and how many they were."""
    begin, before = time.perf_counter(), scene(page, "scene.painted")
    action()
    frames = scene(page, "scene.painted") - before
    return frames / (time.perf_counter() - begin), frames


def stalls(stage):
    """Longest gap of the event loop: opening pages and tabs, and while states are computed."""
    log = stage.folder / "stalls"
    page, _ = stage.open()
    page.wait_for_timeout(3000)
    print(f"longest stall while the first page opens: {_longest(log)}")
    for _ in range(3):
        other, _ = stage.open()
        other.wait_for_timeout(1500)
        other.context.close()
    print(f"longest stall while pages open: {_longest(log)}")
    for tab in ("Friction", "Force space", "Push", "Your packing", "Export", "Intervals"):
        page.get_by_role("tab", name=tab).click()
        page.wait_for_timeout(3000)
    print(f"longest stall while tabs are opened: {_longest(log)}")
    ask(page, "0.17")
    page.get_by_text("μ = 0.17, N = 400").first.wait_for()
    print(f"longest stall while packing and walk are computed: {_longest(log)}")
    page.get_by_role("button", name="Compute exact intervals").wait_for(state="hidden")
    page.wait_for_timeout(1000)
    print(f"longest stall while exact intervals are computed: {_longest(log)}")


def _longest(log):
    time.sleep(1.2)
    lines = log.read_text().split("\n")[:-1]
    log.write_text("")
    gap, spent = max(tuple(map(float, line.split()[1:])) for line in lines)
    return f"{1000 * gap:.0f} ms ({1000 * spent:.0f} ms of them the server's own)"


GRABBED = """e => {
    const {hand} = e.scene, {paint} = hand.player
    window.grabbed = {asked: 0, gaps: []}
    for (const held of [hand, hand.spot]) {
        const {set} = held
        held.set = function (value) { grabbed.asked ||= performance.now(); set.call(held, value) }
    }
    hand.player.paint = function () {
        paint.call(hand.player)
        if (grabbed.asked) grabbed.gaps.push(performance.now() - grabbed.asked)
        grabbed.asked = 0
    }
}"""


def dragging(stage):
    """A force in the hand, of 400 disks and of blocks: time to its rail, frames, hand to picture.

    Then the point in force space, of 400 disks.
    """
    for query, words in BODIES.items():
        page, _ = stage.open(query, still=True)
        page.wait_for_timeout(4000)
        _, x, y = chain(page)
        page.locator(".scene").evaluate(GRABBED)
        for visit in ("first", "second"):
            _drag(page, x, y, "scene.hand.rail", f"{words}: rail of the {visit} contact")
        page.context.close()
    page, _ = stage.open()
    page.locator(".scene").evaluate(GRABBED)
    page.get_by_role("tab", name="Force space").click()
    page.wait_for_function(f"() => {MODEL}('outer')?.get_length() > 4")
    page.wait_for_timeout(1500)
    for visit in ("first", "second"):
        _drag(
            page,
            *place(page, *here(page)),
            "scene.hand.spot.fan",
            f"networks around the point, the {visit} time",
        )


# A hand that moves once a frame, as a mouse does; moved from outside, it would be the slower one.
TO_AND_FRO = """(e, [x, y]) => new Promise((done) => {
    const {scene} = e, before = scene.painted, begin = performance.now()
    let k = 0
    const step = () => {
        if (++k > 120) return done(1000 * (scene.painted - before) / (performance.now() - begin))
        e.dispatchEvent(new PointerEvent("pointermove", {
            pointerId: 1, pointerType: "mouse", buttons: 1, bubbles: true, composed: true,
            clientX: x, clientY: y - 40 * Math.abs((k % 40) - 20) / 20,
        }))
        requestAnimationFrame(step)
    }
    step()
})"""


def _drag(page, x, y, ready, words):
    """Take what is at a point, wait for its networks, and drag it to and fro."""
    begin = time.perf_counter()
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 6)
    until(page, f"{ready} !== null")
    print(f"{words}: {time.perf_counter() - begin:.2f} s")

    rate = page.locator(".scene").evaluate(TO_AND_FRO, [x, y - 6])
    gaps = page.evaluate("grabbed.gaps.splice(0)")
    print(
        f"dragging: {rate:.0f} painted frames a second, longest from hand to picture "
        f"{max(gaps):.0f} ms"
    )
    page.mouse.up()
    page.wait_for_timeout(1500)


def memory(stage, cycles=50):
    """How much the server grows over open–close cycles."""
    for k in range(cycles + 5):
        page, _ = stage.open()
        page.locator("button.step").click()
        page.context.close()
        if k == 4:
            time.sleep(13)
            before = stage.memory()
    time.sleep(13)
    after = stage.memory()
    print(f"server's memory: {before:.0f} MB after 5 pages, {after:.0f} MB after {cycles} more")


PARTS = {f.__name__: f for f in (opening, playing, dragging, stalls, memory)}


def main(names):
    """Measure the named parts, or all."""
    setup = str(Path(__file__).with_name("stalls.py"))
    cores = os.sched_getaffinity(0)
    for name in names or PARTS:
        # Browsers run elsewhere: where the loop is watched, this one keeps to one core.
        os.sched_setaffinity(0, {max(cores)} if name == "stalls" else cores)
        with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
            folder = Path(folder)
            browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
            os.sched_setaffinity(0, cores)
            options = ("--setup", setup, *CLOSED)
            with serve(folder, *options, STALLS=str(folder / "stalls")) as (address, server):
                PARTS[name](Stage(folder, address, server, browser))
            browser.close()


if __name__ == "__main__":
    main(sys.argv[1:])
