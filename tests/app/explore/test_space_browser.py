"""In a browser: the point in force space is pulled."""

import numpy as np
from serving import (
    MODEL,
    at_rest,
    column,
    expect,
    here,
    laid_out,
    normal,
    place,
    pulled,
    scene,
    searched,
    until,
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
