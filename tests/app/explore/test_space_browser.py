"""In a browser: the point in force space is pulled, and two networks are seen side by side."""

import numpy as np
import pytest
from serving import (
    MODEL,
    ask,
    at_rest,
    column,
    expect,
    here,
    laid_out,
    more,
    no_more,
    normal,
    place,
    pulled,
    scene,
    searched,
    shows,
    until,
    zoomed,
)

# The outermost element of force space that is ever made pale.
VIEW_ABOVE = """(() => {
    const page = Bokeh.documents[0], view = page.views_manager.find_one(
        page.get_model_by_name("path_figure"))
    let pale = view.el
    for (let at = view.el; at; at = at.parentNode ?? at.host) {
        if (at instanceof Element && getComputedStyle(at).opacity < 1) return at
        if (at instanceof Element) pale = at
    }
    return pale
})()"""


def ready(page):
    page.wait_for_function(f"() => {MODEL}('outer')?.get_length() > 4")
    laid_out(page, "path_figure")
    at_rest(page.locator(".scene"))  # and so are the axes
    until(page, "scene.hand.player.plots.plane.xn?.length > 0")


def test_the_point_follows_the_hand_and_the_network_the_point(visit):
    page = visit("?axes=principal", 1920, 1000)
    ready(page)
    pulled(page)  # first; in the plane of a pair this contact would become one of the two
    page.mouse.up()
    searched(page, "pull=")
    until(page, "scene.hand.player.replay.held.pull !== undefined")
    before, start, frames = normal(page), here(page), scene(page, "scene.hand.frames")
    middle = [np.mean(column(page, "outer", name)) for name in "xy"]
    (x, y), (u, v) = place(page, *start), place(page, *middle)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 2, y + 2)
    until(page, "scene.hand.spot.fan !== null")
    page.mouse.move(u, v)
    until(page, f"scene.hand.spot.at !== null && scene.hand.frames > {frames}")
    page.wait_for_function(
        f"([u, v]) => Math.abs({MODEL}('current').get_column('x')[0] - u)"
        " < 1e-2 * (1 + Math.abs(u))",
        arg=middle,
    )
    during = normal(page)
    assert np.abs(during - before).max() > 1e-3 and during.min() > -1e-6
    expect(page.locator(".message")).to_contain_text("point in force space pulled")
    # beyond the outline it stays on it
    page.mouse.move(u + 5000, v)
    until(page, "scene.hand.spot.at[0] < 1e3")
    edge = max(column(page, "outer", "x"))
    page.wait_for_function(f"() => {MODEL}('current').get_column('x')[0] <= {edge} + 1e-6")
    page.mouse.move(u, v)
    page.mouse.up()
    page.wait_for_function("() => /pull=.*[pn]%3A/.test(location.search)")
    until(page, "scene.hand.player.replay.held.pull?.length === 3")
    assert float(page.locator("b.residual").text_content()) < 1e-9
    np.testing.assert_allclose(normal(page), during, atol=2e-3)
    page.keyboard.press("z")
    until(page, "scene.hand.player.replay.held?.pull?.length !== 3")
    np.testing.assert_allclose(normal(page), before, atol=1e-6)


def test_force_space_opens_without_a_warning_and_its_tools_cover_nothing(visit):
    told = []

    def listen(page):
        page.on("console", lambda one: one.type == "warning" and told.append(one.text))

    page = visit("?tab=plane", 1024, 700, prepare=listen)
    ready(page)
    frame, tools = page.evaluate(
        """() => {
            const page = Bokeh.documents[0]
            const view = page.views_manager.find_one(page.get_model_by_name("path_figure"))
            const box = view.canvas_view.el.getBoundingClientRect(), bar = view.model.toolbar
            const {left} = page.views_manager.find_one(bar).el.getBoundingClientRect()
            return [box.left + view.frame.bbox.right, left]
        }"""
    )
    assert tools >= frame
    plot, below = page.locator(".bk-Figure").first, page.locator("fieldset", has_text="Plane")
    box = plot.bounding_box()
    assert box["height"] > 200 and below.bounding_box()["y"] >= box["y"] + box["height"] - 1
    assert not told


def test_the_point_stands_where_a_pull_led_before_force_space_was_opened(visit):
    """And can be taken there: the next pull begins where the first ended."""
    page = visit()
    pulled(page)
    page.mouse.up()
    searched(page, "pull=")
    page.get_by_role("tab", name="Force space").click()
    ready(page)
    spot = scene(page, "scene.hand.player.plots.projected(scene.mixed)")
    page.wait_for_function(
        f"([x, y]) => Math.hypot({MODEL}('current').get_column('x')[0] - x, "
        f"{MODEL}('current').get_column('y')[0] - y) < 1e-4",
        arg=spot,
    )
    x, y = place(page, *spot)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 10, y + 10)
    until(page, "scene.hand.spot.fan !== null")
    page.mouse.up()
    searched(page, "~")


def test_force_space_fills_while_the_walk_goes_on(visit, own_mu):
    """Every state that has arrived has its place, on axes of those found before."""
    page = visit(f"?mu={own_mu}&n=30&states=20000&relax=nearest_piqp&tab=plane", 1280, 1000)
    until(page, "scene.hand.player.grows && scene.hand.player.replay.last > 30")
    there = f"{MODEL}('path')?.get_column('x')?.filter(Number.isFinite).length"
    page.wait_for_function(f"() => {there} > 20")
    count = page.evaluate(there)
    page.wait_for_function(f"() => {there} > {count} + 5")
    page.wait_for_function(f"() => getComputedStyle({VIEW_ABOVE}).opacity === '1'")
    page.keyboard.press(" ")  # a rest, in which all that came is drawn
    until(page, "!scene.hand.player.playing")
    until(page, "scene.hand.player.plots.placed.drawn > 20")
    off = scene(
        page,
        f"""(() => {{
            const {{plots, replay: {{walk}}}} = scene.hand.player, path = {MODEL}("path"), off = []
            for (let k = 0; k < plots.placed.count; k++) {{
                const cut = (name) =>
                    walk[name].subarray(k * walk.contacts, (k + 1) * walk.contacts)
                const [x, y] = plots.projected(
                    {{normal: cut("normal"), tangential: cut("tangential")}})
                off.push(x - path.get_column("x")[k], y - path.get_column("y")[k])
            }}
            return off
        }})()""",
    )
    assert len(off) > 40 and np.abs(off).max() < 1e-5
    x, y = (column(page, "path", name) for name in "xy")
    seen = np.isfinite(x)
    assert np.ptp(np.array(x)[seen]) > 1e-3 and np.ptp(np.array(y)[seen]) > 1e-3
    assert len(x) > seen.sum()  # there is room for more
    page.get_by_role("button", name="Discard").first.click()
    until(page, "!scene.hand.player.grows")
    page.wait_for_function(f"() => {MODEL}('path')?.get_column('x')?.every(Number.isFinite)")


def test_two_networks_side_by_side_with_one_player(visit):
    page = visit("?frame=3&reference=1")
    more(page).locator("button.split").click()
    searched(page, "split=1")
    until(page, "scene.hand.player.split.twin.painted > 0 && scene.hand.player.split.on")
    boxes = [page.locator(f".{name}").bounding_box() for name in ("twin", "scene")]
    assert boxes[0]["width"] == pytest.approx(boxes[1]["width"], abs=1)
    assert boxes[0]["y"] == boxes[1]["y"] and boxes[0]["x"] < boxes[1]["x"]
    expect(page.locator(".twin .caption")).to_contain_text("network")
    widths = "Array.from(scene.hand.player.split.twin.style.width)"
    pinned, contacts = scene(page, widths), scene(page, "scene.geometry.contacts")
    normals = np.array(scene(page, "Array.from(scene.geometry.normal)")).reshape(-1, contacts)
    shown = np.argsort(pinned)
    assert np.all(np.diff(normals[1][shown]) >= -1e-6)
    # the view is one, and the player moves only the network that is not pinned
    page.mouse.move(boxes[0]["x"] + 50, boxes[0]["y"] + 50)
    zoomed(page, -200)
    until(page, "scene.view.half < 0.49 * (scene.geometry.window[1] - scene.geometry.window[0])")
    here, beside = scene(page, "[scene.view, scene.hand.player.split.twin.view]")
    assert beside == pytest.approx(here)
    page.locator("button.step").click()
    until(page, "scene.hand.player.replay.frame === 4")
    assert scene(page, widths) == pinned
    more(page).locator("button.pin").click()
    searched(page, "pinned=8")
    until(page, f"scene.hand.player.split.twin.style.width.some((v, k) => v !== {pinned}[k])")
    more(page).locator("button.split").click()
    until(page, "!scene.hand.player.split.on")
    expect(page.locator(".twin")).to_be_hidden()


def widths(page, of):
    return np.array(scene(page, f"Array.from({of}.style.width)"))


def test_another_mu_comes_beside_the_packing_of_the_first(visit):
    """Both keep their own packing; one player, one view, and a link that opens the same."""
    page, twin = visit(), "scene.hand.player.split.twin"
    more(page).locator("button.split").click()
    until(page, f"scene.hand.player.split.on && {twin}.painted > 0")
    ask(page, "1")
    searched(page, "split=1&beside=0.1")
    until(page, f"scene.geometry.mu === 1 && {twin}.geometry.mu === 0.1")
    query = page.evaluate("location.search")
    for at in (page, visit(query)):
        until(at, f"scene.geometry.mu === 1 && {twin}.geometry?.mu === 0.1")
        captions = [at.locator(f".{name} .caption").inner_text() for name in ("twin", "scene")]
        assert captions == ["μ = 0.1: network 0 of 30, as packed", "μ = 1"]
        assert scene(at, "scene.geometry.box[0]") != scene(at, f"{twin}.geometry.box[0]")
        before = widths(at, "scene"), widths(at, twin)
        at.locator("button.step").click()
        until(at, "scene.hand.player.split.other.frame === 1")
        until(at, "scene.hand.player.replay.frame === 1")
        after = widths(at, "scene"), widths(at, twin)
        contacts = [scene(at, f"{of}.geometry.contacts") for of in ("scene", twin)]
        # So few disks at μ = 1 may hold in one way only: there nothing has to change.
        for old, new, count, least in zip(before, after, contacts, (0, 1e-4), strict=True):
            assert len(old) == len(new) == count and np.abs(old - new).max() >= least
        normal_of_twin = np.array(scene(at, f"Array.from({twin}.geometry.normal)"))[contacts[1] :]
        order = np.argsort(after[1])
        assert np.all(np.diff(normal_of_twin[order]) >= -1e-6)
        # what fills one picture fills the other, and so does a part of it
        box = at.locator(".twin").bounding_box()
        at.mouse.move(box["x"] + 60, box["y"] + 60)
        zoomed(at, -300)
        part = "{0}.view.half / ({0}.geometry.window[1] - {0}.geometry.window[0])"
        until(at, f"{part.format('scene')} < 0.45")
        assert scene(at, part.format(twin)) == pytest.approx(scene(at, part.format("scene")))
    # pinned, a state of this packing is beside it again
    more(page).locator("button.pin").click()
    no_more(page, "beside")
    until(page, f"{twin}.geometry.mu === 1 && scene.hand.player.split.other === null")
    assert page.locator(".twin .caption").inner_text() == "pinned: network 1"


def test_a_new_mu_is_seen_to_jam_beside_the_old_one(visit):
    page = visit("?mu=0.1&n=200&states=8&relax=nearest_piqp&split=1")
    until(
        page,
        "scene.geometry.states === 8 && !scene.hand.player.grows && scene.hand.player.split.on",
    )
    # Each picture is drawn when it arrives: a browser that is late leaves out those of a packing
    # that has been replaced by its walk meanwhile.
    page.locator(".scene").evaluate(
        """e => {
            const {live, split} = e.scene.hand.player, {receive, show} = live
            const later = window.requestAnimationFrame
            window.beside = []
            live.show = (picture) => {
                show.call(live, picture)
                beside.push([split.on, split.other?.walk.mu, split.twin.counts.drawn])
            }
            live.receive = (news) => {
                window.requestAnimationFrame = (draw) => draw(performance.now())
                receive.call(live, news)
                window.requestAnimationFrame = later
            }
        }"""
    )
    ask(page, "10")  # takes longest to jam
    shows(page, 10)
    seen = page.evaluate("beside")
    assert seen and all(on and mu == 0.1 and drawn > 20 for on, mu, drawn in seen)
    expect(page.locator(".twin")).to_be_visible()
