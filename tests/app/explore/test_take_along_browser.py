"""What visitors take along: a page in one file, movies, all states, pictures with captions."""

import base64
import io

import numpy as np
import pytest
import xarray as xr
from PIL import Image
from serving import PATIENCE, column, expect, painted, picture, scene, searched
from small_store import DISKS, KEPT, ROOT, STATES

# What was taken along, to be looked at; ignored by git.
ARTEFACTS = ROOT / "artefacts" / "along"


@pytest.fixture
def page(visit):
    """A page with the buttons."""
    return visit("?tab=export&frame=3&colour=extent", 1280, 1000)


def taken(page, words, folder):
    button = page.get_by_role("button", name=words, exact=True)
    with page.expect_download(timeout=2 * PATIENCE) as saved:
        button.click()
    path = folder / saved.value.suggested_filename
    saved.value.save_as(path)
    return path


def test_the_page_as_one_file_works_without_server_and_network(page, chromium, tmp_path):
    normal = scene(page, "Array.from(scene.mixed.normal)")
    path = taken(page, "This view as a page (HTML)", tmp_path)
    assert path.stat().st_size < 10e6
    context = chromium.new_context(viewport={"width": 1280, "height": 1000}, offline=True)
    alone, problems = context.new_page(), []
    alone.set_default_timeout(PATIENCE)
    alone.on("pageerror", lambda error: problems.append(str(error)))
    inside = "data:", "blob:", path.as_uri()
    alone.on("request", lambda sent: sent.url.startswith(inside) or problems.append(sent.url))
    alone.goto(path.as_uri())
    painted(alone)
    assert scene(alone, "Array.from(scene.mixed.normal)") == pytest.approx(normal, abs=1e-6)
    expect(alone.locator(".state")).to_have_text("of 30")  # the state that was on screen
    alone.keyboard.press("Home")
    before = column(alone, "bars", "now"), column(alone, "current", "x")
    alone.locator("button.step").click()
    after = column(alone, "bars", "now"), column(alone, "current", "x")
    assert before[0] != after[0] and before[1] != after[1]
    assert len(column(alone, "outer", "x")) > 3  # the exact outline of S
    alone.locator("button.play").click()
    alone.locator(".stage.playing").wait_for()
    picture(alone, "along/standalone", full_page=True)
    context.close()
    assert problems == []


def test_a_movie_is_recorded_in_the_browser(page, tmp_path):
    page.locator("input.speed").fill("3")
    path = taken(page, "Movie (WebM)", tmp_path)
    content = path.read_bytes()
    assert path.suffix == ".webm" and content[:4] == b"\x1a\x45\xdf\xa3" and len(content) > 5000
    expect(page.get_by_role("button", name="Movie (WebM)", exact=True)).to_be_visible()
    # The player is where it was; the movie has its caption, and says how long it is.
    searched(page, "network=6")
    assert scene(page, "scene.hand.player.replay.position") == 3
    assert scene(page, "scene.disks.canvas.width === Math.round(scene.root.clientWidth)")
    width, height, duration, picture = page.evaluate(
        """async (content) => {
            const bytes = Uint8Array.from(atob(content), (letter) => letter.charCodeAt(0))
            const video = document.createElement("video")
            video.muted = true
            video.src = URL.createObjectURL(new Blob([bytes], { type: "video/webm" }))
            await new Promise((resolve) => { video.onloadeddata = resolve })
            video.currentTime = video.duration / 2 // it can be wound
            await new Promise((resolve) => { video.onseeked = resolve })
            const canvas = document.createElement("canvas")
            canvas.width = video.videoWidth
            canvas.height = video.videoHeight
            canvas.getContext("2d").drawImage(video, 0, 0)
            return [canvas.width, canvas.height, video.duration, canvas.toDataURL()]
        }""",
        base64.b64encode(content).decode(),
    )
    assert width == 900 and height > 980 and 0.1 < duration < 60
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    picture = base64.b64decode(picture.partition(",")[2])
    (ARTEFACTS / "webm.png").write_bytes(picture)
    with Image.open(io.BytesIO(picture)) as image:
        pixels = np.asarray(image.convert("L"))
    assert (pixels[:900] < 200).any() and (pixels[905:] < 100).any()  # packing, and words below it


def test_all_states_are_exported_not_only_those_kept(visit, tmp_path):
    # Then all are stored: other tests look at those that are kept at μ = 0.1.
    selection = f"?n={DISKS}&seed=1&mu=1&source=walk&states={STATES}&relax=nearest_piqp"
    page = visit(f"{selection}&tab=export&frame=3", 1280, 1000)
    path = taken(page, "Networks (NetCDF)", tmp_path)
    with xr.open_dataset(io.BytesIO(path.read_bytes()), engine="scipy") as whole:
        states = whole["states"].values / whole["force_scale"].item()
    assert len(states) == STATES > KEPT
    kept = np.array(scene(page, "Array.from(scene.geometry.normal)")).reshape(KEPT + 1, -1)[1:]
    pick = np.linspace(0, STATES - 1, KEPT).astype(int)
    assert np.allclose(kept, states[pick, :, 0], atol=1e-5)
