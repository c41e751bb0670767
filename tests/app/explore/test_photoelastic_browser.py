"""In a browser: photoelastic frames are dropped, looked at, played, saved and opened."""

from itertools import chain

import pytest
from frames import frame, write
from serving import laid_out, picture, scene, until

NUMBERS = 1, 2, 3
# Widths in pixels of the pictures of the frame that the browser shows.
PICTURES = """() => {
  const {all_models, views_manager} = Bokeh.documents[0]
  return [...all_models]
    .filter(model => model.name === "photoelastic_network" && views_manager.find_one(model))
    .map(model => model.properties.inner_width.is_unset ? 0 : model.inner_width)
}"""

# The toolbar is hidden until the pointer is on the picture; its button works all the same.
SAVE = """() => {
  const page = Bokeh.documents[0], {toolbar} = [...page.all_models].find(model =>
    model.name === "photoelastic_network" && page.views_manager.find_one(model))
  const tool = toolbar.tools.find(({description}) => description === "Save as SVG")
  return tool.callback.execute(tool)
}"""


def dropped(page, tmp_path, numbers=NUMBERS):
    """Drop some frames of one packing, measured anew each time, and wait for the last."""
    made = [frame(40, missing=0.1, noise=0.05, number=k, seed=k)[:2] for k in numbers]
    write(tmp_path, *([*chain(*rows)] for rows in zip(*made, strict=True)))
    page.locator("input[type=file]").set_input_files(
        [tmp_path / "positions.txt", tmp_path / "adjacency.txt"]
    )
    page.get_by_text("The files list").wait_for()
    laid_out(page, "photoelastic_network")


def head(page, number):
    return page.locator("p", has_text=f"frame {number}").filter(has_text="positions.txt")


@pytest.mark.parametrize(
    "width", [390, *(pytest.param(wide, marks=pytest.mark.slow) for wide in (1280, 1440, 1920))]
)
def test_pictures_are_seen_and_saved_and_the_frame_is_opened(visit, tmp_path, width):
    page = visit("?scene=many&tab=upload", width, 900)
    dropped(page, tmp_path, (1,))
    for name, count in (("Both", 2), ("Difference in σ", 1), ("Measured", 1), ("Inferred", 1)):
        page.get_by_label("Forces", exact=True).select_option(name)
        page.wait_for_function(
            f"count => {{const all = ({PICTURES})(); "
            "return all.length === count && all.every(w => w > 100)}",
            arg=count,
        )
        page.get_by_label("Forces", exact=True).evaluate("e => e.scrollIntoView()")
        picture(page, f"photoelastic/{width}_{name.split()[0]}")
    # Nothing is wider than the page.
    wide = page.evaluate("() => document.scrollingElement.scrollWidth")
    assert wide <= width
    with page.expect_download() as download:
        page.evaluate(SAVE)
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    assert path.name == "frame1.svg" and path.stat().st_size > 20_000
    assert "unit of the file" in path.read_text() and "⟨mₙ⟩" in path.read_text()
    page.get_by_role("button", name="Open as a packing").click()
    page.get_by_text("coordination z").wait_for()
    until(page, "scene.geometry.grain && new Set(scene.geometry.grain).size === 40")
    assert scene(page, "scene.painted") > 0


def test_a_series_is_played_to_frames_that_are_inferred_on_the_way(visit, tmp_path):
    page = visit("?scene=many&tab=upload", 1440, 900)
    dropped(page, tmp_path)
    head(page, 3).wait_for()
    player = page.locator(".bk-panel-models-widgets-DiscretePlayer")
    player.locator("button.play").click()
    for number in (1, 2, 3):  # round and round
        head(page, number).wait_for()
    player.locator("button.pause").click()
