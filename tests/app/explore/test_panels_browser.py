"""The tabs beside the packing in a browser: what they show, and the files they take and give."""

import io
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from packings import REFERENCE, reference, skewed
from serving import (
    MODEL,
    bars_drawn,
    column,
    frames,
    scene,
    until,
    zoomed,
)
from small_store import DISKS, KEPT, STATES

import granforce as gf

LAMMPS = REFERENCE.parent / "lammps"


def filled(page, source, least=3):
    """Wait until a source has rows."""
    page.wait_for_function(f"() => {MODEL}('{source}')?.get_length() >= {least}")


def to_scale(page, source):
    """Wait until a unit is as long along x as along y in the plot that shows a source."""
    page.wait_for_function(
        """name => {
            const models = [...Bokeh.documents[0].all_models]
            const source = models.find((model) => model.name === name)
            const fig = models.find((model) => model.type === "Figure" &&
                model.renderers.some((renderer) => renderer.data_source === source))
            const {inner_width, inner_height, x_range, y_range} = fig
            const across = inner_width / (x_range.end - x_range.start)
            const up = inner_height / (y_range.end - y_range.start)
            return Math.abs(across - up) <= 1e-3 * up
        }""",
        arg=source,
    )


def drawn(page, number=1):
    """Wait until so many plots of the visible tab have been painted."""
    page.wait_for_function(
        """number => {
            const figures = [...Bokeh.documents[0].all_models]
                .filter((model) => model.type === "Figure" &&
                    !model.properties.inner_width.is_unset && model.inner_width > 50)
            return figures.length >= number
        }""",
        arg=number,
    )
    frames(page, 2)


def download(page, action, folder):
    """The file that an action has the browser save, and its content."""
    with page.expect_download() as saved:
        action()
    path = folder / saved.value.suggested_filename
    saved.value.save_as(path)
    return path


@pytest.mark.parametrize("width, dark", [(1280, 1), (400, 0)])
def test_force_space_is_to_scale_and_follows_the_player(visit, width, dark):
    page = visit(f"?tab=plane&axes=principal&dark={dark}", width, 1000 if width > 400 else 2200)
    filled(page, "outer")
    to_scale(page, "path")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    path = np.stack([column(page, "path", name) for name in "xy"], axis=1)
    assert len(path) == KEPT + 1
    for _ in range(2):
        page.locator("button.step").dispatch_event("click")  # the sidebar may lie above it
    page.wait_for_function(
        f"() => Math.abs({MODEL}('current').get_column('x')[0] - {path[2, 0]}) < 1e-6"
    )
    assert column(page, "current", "y")[0] == pytest.approx(path[2, 1], abs=1e-6)
    outer = np.stack([column(page, "outer", name) for name in "xy"], axis=1)
    assert np.all(path.max(axis=0) <= outer.max(axis=0) + 1e-6)


def slow(page):
    """Have a page compute four times as slowly."""
    page.context.new_cdp_session(page).send("Emulation.setCPUThrottlingRate", {"rate": 4})


def test_a_window_may_change_its_size_while_a_slow_browser_still_builds_the_page(visit):
    page = visit("?tab=plane", 400, 2200, prepare=slow)
    page.evaluate(
        """() => setInterval(() => {
            document.body.style.width = document.body.style.width === "396px" ? "398px" : "396px"
        }, 10)"""
    )
    filled(page, "outer")


def test_friction_by_night_on_a_narrow_screen(visit):
    page = visit("?tab=statistics&dark=1", width=400, height=2200)
    drawn(page, 2)
    page.get_by_role("button", name="how many forces are large").click()
    page.get_by_text("of the forces are smaller than the mean force").wait_for()
    assert page.evaluate("document.documentElement.scrollWidth") <= 400


def test_a_push_is_followed_by_the_network_and_ends_where_disks_move(visit, served):
    page = visit("?tab=perturb&contact=5")
    slider = page.get_by_role("slider", name="push, in mean forces")
    slider.wait_for()
    packed = scene(page, "Array.from(scene.mixed.normal)")
    slider.evaluate("e => { e.value = e.step; e.dispatchEvent(new Event('input')) }")
    until(page, "scene.hand.player.pushed.held !== null")
    page.locator(".state").get_by_text("pushed").wait_for()
    load = scene(page, "scene.hand.player.pushed.load")
    now = scene(page, "Array.from(scene.mixed.normal)")
    # A small push is taken over by the contact itself, as far as balance goes.
    assert 0 < load and now[5] < packed[5] + 1e-6 and now != packed
    assert scene(page, "scene.offset") is None
    page.keyboard.press("Escape")  # which lets all go
    until(page, "scene.hand.player.replay.held === null")
    assert slider.evaluate("e => e.value") == "0"
    slider.evaluate("e => { e.value = e.max; e.dispatchEvent(new Event('input')) }")
    page.get_by_text("contacts open").first.wait_for()
    end = scene(page, "scene.hand.player.pushed.load")
    assert load < end == pytest.approx(float(slider.get_attribute("max")))
    until(page, "scene.hand.player.pushed.motion !== null")
    assert scene(page, "scene.offset") is None  # a still, with arrows
    drawn(page)
    picture = scene(
        page,
        "scene.hand.player.picture({ lines: [], width: 1, "
        "bar: { low: '0', high: '1', stops: ['#fff', '#000'] } })",
    )
    assert re.search(r"Contact \d+: push [\d.]+ .*F_crit [\d.]+ .*limit load", picture)
    assert picture.count(scene(page, "scene.palette.selected")) > 6  # the arrows
    page.get_by_label("animate the first motion").click()
    until(page, "Math.abs(scene.offset?.amplitude) > 0.001")
    assert scene(page, "scene.offset.field.length") == 2 * DISKS
    slider.evaluate("e => { e.value = 0; e.dispatchEvent(new Event('input')) }")
    until(page, "scene.offset === null")
    page.locator(".state").get_by_text("as packed").wait_for()
    assert scene(page, "Array.from(scene.mixed.normal)") == packed
    slider.evaluate("e => { e.value = e.step; e.dispatchEvent(new Event('input')) }")
    until(page, "scene.hand.player.pushed.held !== null")
    page.get_by_role("tab", name="Intervals").click()
    until(page, "scene.hand.player.replay.held === null")
    assert scene(page, "scene.hand.player.pushed.load") == 0
    assert "already known" not in (served[1] / "log").read_text()


def test_a_tilted_packing_is_seen_whole(visit, tmp_path):
    """Its cell is a parallelogram on screen and in the picture, and all of it is in the window."""
    packing = skewed(reference("n100_mu1_s12"))[0]
    gf.save_packing(packing, tmp_path / "tilted.npz")
    page = visit("?tab=upload")
    page.locator("input[type=file]").set_input_files(tmp_path / "tilted.npz")
    page.locator(".source", has_text="tilted").wait_for(state="attached")
    until(page, "scene.geometry.tilt !== 0")
    page.get_by_text(f"tilted by {packing.tilt:.2f}".replace("-", "−")).first.wait_for(
        state="attached"
    )
    corners = page.locator(".scene").evaluate(
        """({scene}) => {
            const corners = [], through = (x, y) => corners.push([x, y]), context = {
                beginPath() {}, closePath() {}, setLineDash() {}, stroke() {},
                moveTo: through, lineTo: through,
            }
            scene.drawBox(context)
            return corners
        }"""
    )
    assert np.array(corners) == pytest.approx(packing.cell.corners[:4], abs=1e-5)
    left, right, bottom, top = scene(page, "scene.geometry.window")
    x, y = np.array(corners).T
    assert left < x.min() and x.max() < right and bottom < y.min() and y.max() < top
    # As many disks as by brute force reach into the strip of one radius around the cell.
    steps = np.mgrid[-6:7, -6:7].reshape(2, -1).T
    at = packing.cell.across(packing.x[:, None] + steps @ packing.cell.vectors)
    reach = packing.r[:, None, None] + packing.r.max()
    seen = np.all((at > -reach) & (at < packing.cell.heights + reach), axis=-1)
    assert scene(page, "scene.geometry.x.length") == np.count_nonzero(seen)
    page.get_by_role("tab", name="Export").click()
    button = page.get_by_role("button", name="SVG", exact=True)
    whole = ElementTree.fromstring(download(page, button.click, tmp_path).read_text())
    (polygon,) = (e for e in whole.iter() if e.tag.endswith("polygon") and e.get("points"))
    points = np.array([point.split(",") for point in polygon.get("points").split()], float)
    assert points * [1, -1] == pytest.approx(packing.cell.corners[:4], abs=1e-2)


# The server tells of another label just before a component begins to listen.
CHANGED_EARLY = """() => {
    const {prototype} = Bokeh.Models.get("panel.models.esm.ReactComponent")
    const {watch} = prototype
    prototype.watch = function (view, name, ...others) {
        if (this.class_name === "Button" && name === "label") this.data.label = "told early"
        watch.call(this, view, name, ...others)
    }
}"""


def test_a_change_that_comes_before_a_component_listens_is_seen(visit):
    page = visit("")
    page.evaluate(CHANGED_EARLY)
    page.get_by_role("tab", name="Your packing").click()
    page.get_by_text("told early").first.wait_for(state="attached")


def test_everything_can_be_taken_along(visit, tmp_path):
    # A walk of its own, all of whose states are stored.
    page = visit(f"?n={DISKS}&seed=1&mu=0.1&states={STATES}&walkseed=3&tab=export&frame=3")
    # Before, nothing is saved under the name of the link.
    until(page, f"scene.geometry.states === {STATES} && !scene.hand.player.model.busy")

    def take(words):
        button = page.get_by_role("button", name=words, exact=True)
        return download(page, button.click, tmp_path)

    ElementTree.fromstring(take("SVG").read_text())
    assert take("PNG").read_bytes()[:4] == b"\x89PNG"
    text = take("Contacts (CSV)").read_text().splitlines()
    head = [row for row in text if row.startswith("# ")]
    rows = text[len(head) :]
    assert any(row.startswith("# f_n_seen_low [mean]: smallest normal force") for row in head)
    assert rows[0].startswith("contact,i,j,x,y,n_x,n_y,wall,f_n_original")
    assert len(rows) > DISKS
    packing = gf.load_packing(io.BytesIO(take("Packing (NPZ)").read_bytes()))
    assert len(packing.r) == DISKS
    assert take("Networks (NetCDF)").read_bytes()[:3] == b"CDF"
    assert take("Networks (Zarr, zipped)").read_bytes()[:2] == b"PK"
    assert '"command": "granforce walk' in take("Parameters (JSON)").read_text()


def test_the_picture_is_that_of_the_screen_whole_and_to_scale(visit, tmp_path):
    page = visit("?tab=export&frame=5&colour=extent&thickness=difference")
    page.locator(".scene").hover()
    zoomed(page, -400)  # what is in view makes no difference
    button = page.get_by_role("button", name="SVG", exact=True)
    whole = ElementTree.fromstring(download(page, button.click, tmp_path).read_text())
    told = " ".join(whole.itertext())
    for words in ("5 largest radii", "Width: ", "colour: interval ΔFₙ, ", "granforce ?"):
        assert words in told
    assert any(e.tag.endswith("linearGradient") for e in whole.iter())
    root = next(e for e in whole.iter() if e.tag.endswith("svg") and e is not whole)
    box = [float(value) for value in root.get("viewBox").split()]
    window = scene(page, "scene.geometry.window")
    assert box == pytest.approx([window[0], -window[3], *[window[1] - window[0]] * 2], rel=1e-4)
    elements = {
        name: [e for e in root.iter() if e.tag.endswith(name)] for name in ("circle", "line")
    }
    radii = scene(page, "Array.from(scene.geometry.r)")
    drawn = [float(e.get("r")) for e in elements["circle"][: len(radii)]]
    assert sorted(drawn) == pytest.approx(sorted(radii), rel=1e-4)
    widths, colours = scene(
        page,
        "[Array.from(scene.geometry.contact, c => scene.style.width[c]),"
        " Array.from(scene.geometry.contact, c => scene.style.colours[scene.style.bin[c]])]",
    )
    least = 0.1 * (window[1] - window[0]) / 900  # a tenth of a pixel
    expected = [(w, c) for w, c in zip(widths, colours, strict=True) if w > least]
    found = [(float(e.get("stroke-width")), e.get("stroke")) for e in elements["line"]]
    assert [c for _, c in found] == [c for _, c in expected] and len(found) > 20
    assert [w for w, _ in found] == pytest.approx([w for w, _ in expected], rel=1e-4)


def test_plots_are_saved_as_svg(visit, tmp_path):
    page = visit("?tab=plane")
    drawn(page)
    filled(page, "outer")
    # Toolbars are hidden until the pointer is on the plot; their buttons work all the same.
    save = """() => {
        const models = [...Bokeh.documents[0].all_models]
        const tool = models.find((m) => m.description === "Save as SVG")
        return tool.callback.execute(tool)
    }"""
    path = download(page, lambda: page.evaluate(save), tmp_path)
    svg = ElementTree.fromstring(path.read_text())
    assert path.suffix == ".svg" and len(list(svg.iter())) > 30


def test_packing_and_plots_are_one_figure_of_a_chosen_width(visit, tmp_path):
    page = visit("", 1440, 900)
    bars_drawn(page)
    page.get_by_role("button", name="Save as one figure").click()
    width = page.get_by_role("spinbutton", name="Width, mm")
    width.fill("180")
    width.press("Enter")
    with page.expect_download() as waited:
        page.get_by_role("button", name="SVG, packing and plots").click()
    waited.value.save_as(tmp_path / "figure.svg")
    root = ElementTree.parse(tmp_path / "figure.svg").getroot()
    wide, high = (float(side) for side in root.get("viewBox").split()[2:])
    assert root.get("width") == "180mm"
    assert float(root.get("height")[:-2]) == pytest.approx(180 * high / wide)
    parts = [child for child in root if child.tag.endswith("}svg")]
    assert len(parts) == 3  # the packing, the bars, the curves; side by side
    assert [float(one.get("x")) > 0 for one in parts] == [False, True, True]
    text = (tmp_path / "figure.svg").read_text()
    assert "contacts, sorted by" in text and text.count("<line ") > 50
    assert text.count("<image ") <= 7  # marks of legends
    names = re.findall(r'\bid="([^"]+)"', text)
    assert len(names) == len(set(names)) and set(re.findall(r"url\(#([^)]+)\)", text)) <= set(names)
    page.get_by_role("button", name="PDF, by printing").click()
    sheet = page.locator("iframe[title='The figure, to be printed']")
    sheet.wait_for(state="attached")
    assert "size: 180mm" in sheet.get_attribute("srcdoc")


AT_ITS_MIDDLE = """(tip) => {
    tip.style.pointerEvents = "auto"
    const { left, top, width, height } = tip.getBoundingClientRect()
    const middle = [left + width / 2, top + height / 2]
    let found = document.elementFromPoint(...middle)
    while (found.shadowRoot && found.shadowRoot.elementFromPoint(...middle) !== found) {
        found = found.shadowRoot.elementFromPoint(...middle)
    }
    return tip.contains(found)
}"""


# While the pointer rests, before the definition opens: the page scrolls, and new results arrive.
SCROLLED_AND_REPLACED = """node => {
    node.replaceWith(node.cloneNode(true))
    window.dispatchEvent(new Event("scroll"))
}"""


def test_definitions_lie_above_everything(visit):
    page = visit()
    tip = page.get_by_role("tooltip")
    page.get_by_role("tooltip", include_hidden=True).wait_for(state="attached")
    for term in (".results [data-term=eta2]", ".status [data-term=accepted]"):
        page.locator(term).first.hover()
        page.locator(term).first.evaluate(SCROLLED_AND_REPLACED)
        tip.wait_for()
        assert tip.evaluate(AT_ITS_MIDDLE), term
        page.mouse.move(5, 5)
        tip.wait_for(state="hidden")
