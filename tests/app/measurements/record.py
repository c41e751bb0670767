"""Records the page in Debian's chromium: a packing jams, a walk explores it, forces are pulled.

    python tests/app/measurements/record.py [FILE.webp]

By default app/page.webp, the picture of the README. Also takes data/figures/app.png, the picture of
the documentation. The app is served with the shipped store and a cache of its own, so that the
packing has to be made.
"""

import base64
import io
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[k]) for k in (1, 3)]  # tests/app, and the repository

from PIL import Image  # noqa: E402
from playwright.sync_api import sync_playwright  # noqa: E402
from serving import (  # noqa: E402
    CHROMIUM,
    FLAGS,
    KNOW,
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
)
from small_store import ROOT  # noqa: E402

SIZE = {"width": 1500, "height": 880}
STILL = ROOT / "data" / "figures" / "app.png"
WIDTH = 900  # px of the file
MOST_BYTES = 3e6
LEAST_MS = 120  # between two pictures kept
FASTER = 2  # than it was recorded
MOST_PICTURES = 110
LONGEST_MS = 150  # that one picture stays, but for the last one
LINGER_MS = 1500
QUALITIES = (60, 45, 30, 20)  # the first whose file is small enough
COMPILED = "?n=30&seed=7&mu=0.3&states=20&relax=nearest&source=walk"
ASKED = "0.15"  # the friction whose packing is made, which no store has


class Recorder:
    """Pictures of a page as it paints them, with their times in ms, while `on`."""

    def __init__(self, page):
        self.pictures, self.on = [], False
        self._wire = page.context.new_cdp_session(page)
        self._wire.on("Page.screencastFrame", self._take)
        self._wire.send("Page.startScreencast", {"format": "jpeg", "quality": 90})

    def stop(self):
        """No more pictures."""
        self._wire.remove_listener("Page.screencastFrame", self._take)
        self._wire.send("Page.stopScreencast")

    def _take(self, told):
        self._wire.send("Page.screencastFrameAck", {"sessionId": told["sessionId"]})
        time = 1000 * told["metadata"]["timestamp"]
        if self.on and (not self.pictures or time > self.pictures[-1][0] + LEAST_MS):
            self.pictures.append((time, base64.b64decode(told["data"])))

    def save(self, path):
        """An animated WebP of at most MOST_BYTES."""
        kept = self.pictures[:: -(-len(self.pictures) // MOST_PICTURES)]  # of a busy machine many
        height = round(WIDTH * SIZE["height"] / SIZE["width"])
        images = [
            Image.open(io.BytesIO(data)).convert("RGB").resize((WIDTH, height), Image.LANCZOS)
            for _, data in kept
        ]
        times = [time for time, _ in kept]
        lasts = [min(round((b - a) / FASTER), LONGEST_MS) for a, b in pairwise(times)]
        for quality in QUALITIES:
            made = io.BytesIO()
            images[0].save(
                made, "WEBP", save_all=True, append_images=images[1:], loop=0, method=4,
                duration=[*lasts, LINGER_MS], quality=quality, minimize_size=True,
            )  # fmt: skip
            if made.tell() <= MOST_BYTES:
                break
        path.write_bytes(made.getvalue())
        seconds = (sum(lasts) + LINGER_MS) / 1000
        print(
            f"{path}: {len(images)} pictures of {WIDTH}×{height}, {seconds:.0f} s, "
            f"quality {quality}, {made.tell() / 1e6:.2f} MB"
        )


def compiled(browser, address):
    """Have the server compile everything before anything is recorded."""
    page = browser.new_page()
    page.set_default_timeout(300_000)
    page.goto(address + COMPILED)
    painted(page)
    until(page, "scene.geometry.mu === 0.3 && !scene.hand.player.grows")
    page.context.close()


def drag(page, path, ready):
    """Take what lies at the first point of a path, and go along it once there are networks."""
    (x, y), *rest = path
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 1, y - 5)
    until(page, ready)
    for x, y in rest:
        page.mouse.move(x, y)
        page.wait_for_timeout(30)
    page.wait_for_timeout(500)
    page.mouse.up()
    page.wait_for_timeout(700)


def straight(start, *stops, steps=28):
    """Points from stop to stop."""
    path = [start]
    for x, y in stops:
        a, b = path[-1]
        path += [(a + (x - a) * k / steps, b + (y - b) * k / steps) for k in range(1, steps + 1)]
    return path


def act(page, recorder):
    """What is seen: packing, walking, grabbing."""
    recorder.on = True
    ask(page, ASKED)
    until(page, "scene.hand.player.grows")
    recorder.on = False  # nothing moves until there are networks
    until(page, "scene.hand.player.replay.last > 25")
    recorder.on = True
    page.wait_for_timeout(2500)
    recorder.on = False
    until(page, "!scene.hand.player.grows && !scene.hand.player.model.busy")
    if scene(page, "scene.hand.player.playing"):
        page.locator("button.play").click()
    page.get_by_role("tab", name="Force space").click()
    page.wait_for_function(f"() => {MODEL}('outer')?.get_length() > 4")
    page.wait_for_timeout(1500)
    recorder.on = True
    page.wait_for_timeout(600)
    _, x, y = chain(page)
    drag(page, straight((x, y), (x, y - 150), (x, y + 90)), "scene.hand.rail !== null")
    corners = [near_outline(page, part) for part in (0.1, 0.4, 0.7)]
    start = place(page, *here(page))
    drag(page, straight(start, *corners, start), "scene.hand.spot.fan !== null")


def near_outline(page, part):
    """On the page, a point not far inside the outline of force space, so far around it."""
    x, y = page.evaluate(
        f"""part => {{
            const outer = {MODEL}("outer"), [x, y] = ["x", "y"].map((n) => outer.get_column(n))
            const k = Math.floor(part * x.length)
            const mean = (values) => values.reduce((a, b) => a + b) / values.length
            return [[x, mean(x)], [y, mean(y)]].map(([v, middle]) => 0.8 * v[k] + 0.2 * middle)
        }}""",
        part,
    )
    return place(page, x, y)


def main(path):
    """Record to a file."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        with serve(Path(folder)) as (address, _):
            compiled(browser, address)
            context = browser.new_context(viewport=SIZE)
            context.add_init_script(f"try {{ {KNOW} }} catch {{}}")
            page = context.new_page()
            page.set_default_timeout(300_000)
            page.goto(address + MANY)
            painted(page)
            page.get_by_text("All contacts as a table").wait_for()  # the last to come
            page.wait_for_timeout(4000)
            still = Image.open(io.BytesIO(page.screenshot()))
            still.quantize(256).save(STILL, optimize=True)
            recorder = Recorder(page)
            act(page, recorder)
            recorder.stop()
            recorder.save(path)
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "app" / "page.webp")
