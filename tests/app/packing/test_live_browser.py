"""In a browser: it is seen to jam and to walk, and its forces can be taken in hand."""

import numpy as np
import pytest
from packings import reference, skewed
from serving import (
    MODEL,
    ask,
    at_rest,
    bars_drawn,
    chain,
    column,
    expect,
    how_it_is_made,
    laid_out,
    no_more,
    normal,
    picture,
    pulled,
    scene,
    searched,
    shows,
    until,
)
from small_store import KEPT

from app.results import geometry

# With each picture: a side of the box, how pale the bars are, and the numbers beside.
WATCH = """(e, [bars, results]) => {
    const {hand} = e.scene, {live} = hand.player, {receive} = live
    window.seen = {pictures: [], states: 0, pale: 0}
    live.receive = (news) => {
        if (news.picture) {
            const {picture} = news, box = picture.box ?? picture.get("box")
            const values = [...results.querySelectorAll("td")].map((one) => one.textContent)
            seen.pictures.push([[...box][0], getComputedStyle(bars).opacity, values])
        } else seen.states += 1
        receive.call(live, news)
    }
    new MutationObserver(() => { seen.pale += hand.player.buttons.root.matches(".pale") })
        .observe(hand.player.buttons.root, {attributes: true})
}"""


@pytest.fixture
def visit(visit):
    """The same with the intervals drawn."""

    def drawn(*query, **options):
        page = visit(*query, **options)
        bars_drawn(page)
        return page

    return drawn


def ask_for_many_states(page):
    """So many that the walk cannot end before the browser has seen it grow."""
    how_it_is_made(page).get_by_label("Networks").first.fill("20000")
    page.get_by_label("Networks").first.press("Enter")


# Seen while it is computed


def test_a_tilting_packing_is_drawn_with_its_images(visit):
    """By brute force over many images: those that reach into the strip around the cell."""
    page = visit()
    packing = skewed(reference("n100_mu1_s12"), ((1, 1), (0, 1)))[0]
    x, c, cell = packing.cell.wrapped(packing.x), packing.contacts, packing.cell
    picture = {
        "box": packing.box.tolist(),
        "tilt": packing.tilt,
        "centres": x.ravel().tolist(),
        "radius": packing.r.tolist(),
        "i": c.i.tolist(),
        "j": c.j.tolist(),
        "reach": (c.length[:, None] * c.normal).ravel().tolist(),
        "normal": packing.forces[:, 0].tolist(),
        "tangential": packing.forces[:, 1].tolist(),
        "fraction": 0.8,
        "unbalance": 0.1,
        "mu": 1.0,
    }
    shown = page.locator(".scene").evaluate(
        """({scene}, picture) => {
            scene.hand.player.live.show(picture)
            const {x, y, x0, y0, window, tilt} = scene.geometry
            return [x, y, x0, y0, window, scene.view.half]
        }""",
        picture,
    )
    margin, shifts = packing.r.max(), np.mgrid[-8:9, -8:9].reshape(2, -1).T @ cell.vectors
    disks, begin = (at[:, None] + shifts for at in (x, x[c.i]))
    end = begin + (c.length[:, None] * c.normal)[:, None]
    ends, r = (cell.across(begin), cell.across(end)), packing.r[:, None, None]
    disks_at = cell.across(disks)
    for places, low, high, drawn in (
        (disks, disks_at - r, disks_at + r, shown[:2]),
        (begin, np.minimum(*ends), np.maximum(*ends), shown[2:4]),
    ):
        seen = np.all((high > -margin) & (low < cell.heights + margin), axis=-1)
        wanted, drawn = places[seen], np.column_stack(drawn)
        order = [np.lexsort(np.round(rows, 6).T) for rows in (drawn, wanted)]
        assert drawn[order[0]] == pytest.approx(wanted[order[1]], abs=1e-9)
    assert shown[4] == pytest.approx(geometry.square(x, packing))
    assert shown[5] == pytest.approx((shown[4][1] - shown[4][0]) / 2)


def test_a_new_mu_is_seen_to_jam_and_to_walk_and_can_be_discarded(visit, own_mu):
    """Pale at once, a shrinking box, then a walk that grows; without it, the old one is back."""
    page = visit()
    bars, values = page.locator(".in-intervals"), page.locator(".results td")
    beside = [bars.element_handle(), page.locator("section.results").element_handle()]
    page.locator(".scene").evaluate(WATCH, beside)
    faint = "e => getComputedStyle(e).opacity"
    z = values.all_inner_texts()[-4]
    ask_for_many_states(page)
    ask(page, own_mu)
    until(page, "scene.hand.player.grows && scene.hand.player.replay.last > 5")
    assert bars.evaluate(faint) == "1"  # of the walk that grows
    assert values.all_inner_texts()[-4] not in (z, "–")  # z is already that of the new packing
    assert set(values.all_inner_texts()[1:5]) == {"–"}
    shows(page, own_mu)
    seen = page.evaluate("seen")
    sides, pale, beside = zip(*seen["pictures"], strict=True)
    assert seen["pale"] and len(sides) >= 12 and seen["states"]
    assert sides[0] > 1.1 * sides[-1]
    # Beside the new packing there is no number of the old one.
    assert set(pale) == {"0"} and all(text.endswith("–") for one in beside for text in one[1:5])
    # The walk is on screen, not the packing that moved before.
    until(page, "!scene.hand.player.live.moves && scene.painted > 0")
    page.get_by_role("button", name="Discard").click()
    until(page, "!scene.hand.player.grows && scene.geometry.states === 30")
    no_more(page, str(own_mu))
    expect(page.locator(".stage.pale")).to_have_count(0)
    expect(page.locator("input.typed").first).to_have_value("0.1")


def test_computed_states_are_shown_to_the_last(visit, own_mu):
    page = visit(f"?mu={own_mu}&n=30&states=300&relax=nearest_piqp")
    until(page, f"scene.geometry.mu === {own_mu} && !scene.hand.player.grows")
    page.get_by_text(f"μ = {own_mu}, 30 disks").wait_for(state="attached")  # in a fold
    page.keyboard.press("End")  # the last state, where all intervals have been seen
    until(page, "scene.hand.player.replay.frame === scene.hand.player.replay.last")
    page.wait_for_function(
        f"() => {MODEL}('growth')?.get_column('eta1')?.every((v, k) => !k || Number.isFinite(v))"
    )
    expect(page.locator(".stage.pale")).to_have_count(0)
    expect(page.locator(".requested")).to_be_empty()


def test_a_walk_that_ends_in_the_push_tab_leaves_one_network_on_screen_and_in_the_address(
    visit, own_mu
):
    """With the push, the network as packed; after it, in another tab, that of before."""
    page, walk = visit("?mu=0.1&n=30&network=8&paused=1"), "scene.hand.player.replay"
    number = f"{walk}.walk.number[{walk}.frame]"
    until(page, f"{number} === 8")
    how_it_is_made(page).get_by_label("Networks").first.fill("3000")
    ask(page, own_mu)
    until(page, "scene.hand.player.grows && scene.hand.player.replay.last > 5")
    page.get_by_role("tab", name="Push").click()
    until(page, f"!scene.hand.player.grows && scene.geometry.mu === {own_mu}")
    until(page, "scene.hand.player.pushed.held")
    page.get_by_role("tab", name="Export").click()
    until(page, "!scene.hand.player.pushed.held")
    assert scene(page, number) == 8
    page.wait_for_function("() => location.search.includes('network=8')")
    assert scene(page, f"{walk}.frame === scene.hand.player.model.frame")


# A message is of three frames: the one that says that the page has come is half a second late.
LATE = """
const {send} = WebSocket.prototype
let frames = []
WebSocket.prototype.send = function (frame) {
    if (!frames.length && !/"msgtype"/.test(frame)) return send.call(this, frame)
    frames.push(frame)
    if (frames.length < 3) return
    const whole = frames, pass = () => { for (const one of whole) send.call(this, one) }
    frames = []
    if (/document_ready/.test(frame)) setTimeout(pass, 500)
    else pass()
}
"""


def test_two_pages_see_the_same_walk(visit, own_mu):
    """The second although its player is there, and hears of the walk, before the page is."""
    query = f"?mu={own_mu}&n=30&states=20000&relax=nearest_piqp"
    one = visit(query)
    until(one, "scene.hand.player.grows && scene.hand.player.replay.last > 5")
    two = visit(query, prepare=lambda page: page.add_init_script(LATE))
    until(two, "scene.hand.player.grows && scene.hand.player.replay.last > 5")
    walked = "scene.hand.player.replay.walk"
    first, second = (
        np.array(scene(page, f"Array.from({walked}.normal.subarray(0, 5 * {walked}.contacts))"))
        for page in (one, two)
    )
    np.testing.assert_array_equal(first, second)
    for page in (one, two):
        page.get_by_role("button", name="Cancel").or_(
            page.get_by_role("button", name="Discard")
        ).click()


# In the hand


def test_a_dragged_chain_follows_the_hand_and_stays(page):
    contact, before = pulled(page)
    until(page, f"Math.abs(scene.mixed.normal[{contact}] - scene.hand.value) < 1e-6")
    rail = scene(page, "({lower: scene.hand.rail.lower, upper: scene.hand.rail.upper})")
    during = normal(page)
    assert before[contact] < during[contact] <= rail["upper"] + 1e-6
    assert np.abs(during - before).max() > 0 and np.all(during > -1e-6)
    expect(page.locator(".message")).to_contain_text("pulled to")
    picture(page, "live/dragging")
    page.mouse.up()
    searched(page, "pull=")
    assert normal(page)[contact] == pytest.approx(during[contact], abs=1e-5)
    assert float(page.locator("b.residual").text_content()) < 1e-9
    until(page, f"scene.selected === {contact}")
    # what was pulled is coloured by what it changed
    change = normal(page) - before
    shown = np.array(scene(page, "Array.from(scene.style.bin)"))
    np.testing.assert_allclose(shown, 32 * np.clip(0.5 + change, 0, 1), atol=0.51)
    page.keyboard.press("z")
    no_more(page, "pull=")
    until(page, "scene.hand.player.replay.held === null")
    np.testing.assert_allclose(normal(page), before, atol=1e-6)


def test_at_the_end_of_the_rail_the_page_says_why(page):
    contact, _ = pulled(page, up=600)
    until(page, "scene.hand.end === 1")
    page.get_by_text("it stops because").wait_for()
    until(page, f"Math.abs(scene.mixed.normal[{contact}] - scene.hand.value) < 1e-6")
    assert normal(page)[contact] == pytest.approx(scene(page, "scene.hand.rail.upper"), abs=1e-4)
    picture(page, "live/end")
    page.mouse.up()
    searched(page, "pull=")


def test_brackets_move_the_selected_force_and_escape_lets_go(page):
    contact, x, y = chain(page)
    page.mouse.click(x, y)
    until(page, f"scene.selected === {contact}")
    before = normal(page)
    for key in "[[":
        page.keyboard.press(key)
    searched(page, "pull=")
    assert normal(page)[contact] < before[contact]
    page.keyboard.press("Escape")
    no_more(page, "pull=")
    np.testing.assert_allclose(normal(page), before, atol=1e-6)


def test_a_contact_selected_and_taken_in_one_moment_is_in_the_hand(page):
    """The server hears of both before it has answered the first."""
    contact, _, _ = chain(page)
    for _ in range(5):
        page.locator(".scene").evaluate(
            """(e, contact) => {
                const {hand} = e.scene
                hand.player.model.contact = contact
                hand.take(contact, () => 0)
            }""",
            contact,
        )
        until(page, "scene.hand.rail !== null")
        page.keyboard.press("Escape")
        page.locator(".scene").evaluate("e => { e.scene.hand.player.model.contact = null }")


def test_a_link_holds_what_was_pulled(visit):
    page = visit()
    pulled(page)
    page.mouse.up()
    searched(page, "pull=")
    until(page, "scene.hand.player.replay.held.pull !== undefined")
    again = visit(page.evaluate("location.search"))
    until(again, "scene.hand.player.replay.held !== null")
    np.testing.assert_allclose(normal(again), normal(page), atol=1e-4)


def moves_the_view(page, x, y):
    """A drag from this place to the right does, and pulls nothing."""
    before = scene(page, "scene.view.x")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y)
    page.mouse.up()
    assert scene(page, "scene.view.x") < before and scene(page, "!scene.hand.active")


def test_a_drag_beside_the_chains_moves_the_view(page):
    x, y = page.locator(".scene").evaluate(
        """e => {
            const box = e.getBoundingClientRect(), {scene} = e, side = scene.size
            for (let a = 0.2; a < 0.8; a += 0.01) for (let b = 0.2; b < 0.8; b += 0.01) {
                const [px, py] = [a * side, b * side]
                if (scene.linkAt(px, py, 12) < 0) return [box.x + px, box.y + py]
            }
        }"""
    )
    moves_the_view(page, x, y)


def test_a_drag_moves_the_view_where_every_point_lies_near_a_chain(page):
    scene(page, "scene.view.half *= 40, scene.changed()")  # as small as disks are in a crowd
    _, x, y = chain(page)
    moves_the_view(page, x, y)


def test_a_finger_pulls_the_selected_contact(visit):
    page = visit("", 400, 900, has_touch=True, is_mobile=True)
    page.keyboard.press("Escape")
    page.locator(".scene").scroll_into_view_if_needed()
    contact, x, y = chain(page)
    page.touchscreen.tap(x, y)
    until(page, f"scene.selected === {contact}")
    before, wire = normal(page), page.context.new_cdp_session(page)

    def touch(kind, *points):
        wire.send(
            "Input.dispatchTouchEvent",
            {"type": kind, "touchPoints": [{"x": x, "y": y} for x, y in points]},
        )

    touch("touchStart", (x, y))
    for k in range(1, 8):
        touch("touchMove", (x, y - 2 * k))
    until(page, "scene.hand.rail !== null")
    for k in range(8, 20):
        touch("touchMove", (x, y - 2 * k))
    until(page, f"scene.mixed.normal[{contact}] > {before[contact] + 1e-3}")
    touch("touchEnd")
    searched(page, "pull=")


def test_a_grip_without_a_pull_leaves_what_is_told(page):
    """Let go before its rail is there, a contact is only selected."""
    before, (contact, *_) = page.locator(".message").inner_text(), chain(page)
    told = page.locator(".scene").evaluate(
        """(e, contact) => {
            const {hand} = e.scene, source = hand.player.buttons.part("message")
            hand.take(contact, () => 0)
            const told = source.textContent
            hand.leave()
            return told
        }""",
        contact,
    )
    until(page, f"scene.selected === {contact}")
    assert "Finding" in told and page.locator(".message").inner_text() == before


def test_playing_on_lets_go(page):
    pulled(page)
    page.mouse.up()
    searched(page, "pull=")
    page.locator("button.step").click()
    no_more(page, "pull=")
    until(page, "scene.hand.player.replay.held === null")
    frames = np.array(scene(page, "Array.from(scene.geometry.normal)")).reshape(KEPT + 1, -1)
    np.testing.assert_allclose(normal(page), frames[1], atol=1e-6)
    assert column(page, "bars", "now")


def dot(page, contact):
    """Where the dot of a contact lies among the intervals, on the page."""
    return page.evaluate(
        """contact => {
            const page = Bokeh.documents[0], bars = page.get_model_by_name("bars")
            const k = Array.from(bars.get_column("at")).indexOf(contact)
            const view = page.views_manager.find_one(page.get_model_by_name("bars_figure"))
            const box = view.canvas_view.el.getBoundingClientRect(), {x_scale, y_scale} = view.frame
            return [box.x + x_scale.compute(bars.get_column("rank")[k]),
                    box.y + y_scale.compute(bars.get_column("now")[k])]
        }""",
        contact,
    )


def test_a_dot_of_the_intervals_is_dragged_along_its_bar(page):
    page.wait_for_function(f"() => {MODEL}('bars')?.get_column('at').length > 0")
    laid_out(page, "bars_figure")
    contact = column(page, "bars", "at")[-1]
    before, (x, y) = normal(page), dot(page, contact)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y + 12)
    until(page, "scene.hand.rail !== null")
    page.mouse.move(x, y + 15)
    until(page, f"scene.mixed.normal[{contact}] < {before[contact]} - 1e-3")
    until(page, f"Math.abs(scene.mixed.normal[{contact}] - scene.hand.value) < 1e-6")
    low = scene(page, "scene.hand.rail.lower")
    if scene(page, "scene.hand.value") > low + 1e-3:  # the dot is where the hand is
        assert dot(page, contact)[1] == pytest.approx(y + 15, abs=3)
    page.mouse.up()
    searched(page, "pull=")


def test_while_it_plays_bokeh_draws_nothing_and_at_rest_the_same_is_drawn(page):
    laid_out(page, "bars_figure")
    drawn = f"{MODEL}('bars_figure').renderers.map(r => r.visible)"
    visible = page.evaluate(f"() => JSON.stringify({drawn})")
    page.evaluate("""() => {
        const page = Bokeh.documents[0], view = page.views_manager.find_one(
            page.get_model_by_name("bars_figure")), paint = view.paint
        window.painted = 0
        view.paint = function (...given) { window.painted += 1; return paint.apply(this, given) }
    }""")
    page.locator("input.speed").fill("1")
    page.locator("button.play").click()
    until(page, "scene.hand.player.plots.layers.bars?.on")
    # A few times as it begins; then not in twenty frames.
    page.evaluate("() => { window.since = [-1, 0] }")
    until(
        page,
        """(since[0] === painted || (since = [painted, scene.painted]))
        && scene.painted > since[1] + 20""",
    )
    before = page.evaluate("painted")
    page.locator("button.play").click()
    until(page, "!scene.hand.player.plots.layers.bars.on")
    page.wait_for_function("before => painted > before", arg=before)
    page.wait_for_function(f"visible => JSON.stringify({drawn}) === visible", arg=visible)


def inside(page, selector):
    """Whether what is shown by a selector lies on screen without scrolling."""
    box, size = page.locator(selector).first.bounding_box(), page.viewport_size
    right, bottom = box["x"] + box["width"], box["y"] + box["height"]
    return box["x"] >= 0 and box["y"] >= 0 and right <= size["width"] and bottom <= size["height"]


def test_packing_force_space_and_intervals_side_by_side_on_a_wide_screen(visit):
    page = visit("", 1920, 1080)
    page.wait_for_function(f"() => {MODEL}('path')?.get_length() > 2")
    laid_out(page, "path_figure")
    page.get_by_role("tab", name="Force space").wait_for(state="hidden")
    assert inside(page, ".scene")
    for name in ("path_figure", "bars_figure"):
        box = page.evaluate(
            """name => {
                const page = Bokeh.documents[0], view = page.views_manager.find_one(
                    page.get_model_by_name(name))
                const {x, y, right, bottom} = view.el.getBoundingClientRect()
                return [x, y, right, bottom]
            }""",
            name,
        )
        assert min(box) >= 0 and box[2] <= 1920 and box[3] <= 1080
    results = "e => e.getRootNode().host.scrollWidth <= e.getRootNode().host.clientWidth"
    assert page.locator("section.results").evaluate(results)
    # the state on screen moves in all of them
    until(page, "scene.hand.player.replay.frame === 0 && !scene.hand.player.grows")
    page.wait_for_function(f"() => Number.isFinite({MODEL}('current').get_column('x')[0])")
    before = column(page, "current", "x")[0]
    page.locator("button.step").click()
    until(page, "scene.hand.player.replay.frame === 1")
    page.wait_for_function(f"b => {MODEL}('current').get_column('x')[0] !== b", arg=before)
    page.set_viewport_size({"width": 1280, "height": 900})
    page.get_by_role("tab", name="Force space").wait_for()
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280


def test_the_tabs_are_beside_a_packing_that_the_window_holds(visit):
    """One that it was opened with, and those that it is given."""
    page = visit("", 1700, 900)
    first, last = (page.get_by_role("tab", name=name) for name in ("Intervals", "Export"))
    for width, height in [(1700, 900), (1440, 900), (1280, 800), (1536, 864)]:
        page.set_viewport_size({"width": width, "height": height})
        last.wait_for()
        packing = at_rest(page.locator(".scene").first)
        assert first.bounding_box()["x"] > packing["x"] + 0.9 * packing["width"]
        assert inside(page, ".scene") and last.bounding_box()["y"] < 0.4 * height
        assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_the_packing_is_seen_whole_below_its_controls_and_above_its_player(visit):
    page = visit("", 700, 768)
    page.get_by_label("logarithm of μ").wait_for()
    for width in (700, 1024, 1440):
        page.set_viewport_size({"width": width, "height": 768})
        at_rest(page.locator(".scene").first)
        assert inside(page, ".scene") and inside(page, ".friction")
    # Everything is on one screen, and keeps its size when lines come and go.
    before = at_rest(page.locator(".scene").first)
    for key in ("n", "Enter"):
        page.keyboard.press(key)
        page.locator(".message", has_text="contact").wait_for()
    page.locator(".legend select").first.select_option("extent")
    ask(page, "none")
    page.get_by_role("alert").filter(has_text="none").wait_for()
    assert at_rest(page.locator(".scene").first) == before
    for part in ("button.play", ".legend", ".results", ".line"):
        assert inside(page, part), part
    page.set_viewport_size({"width": 400, "height": 900})
    at_rest(page.locator(".scene").first)
    above, below = (
        page.locator(f".stage {name}").bounding_box() for name in (".scene", ".bar:has(.play)")
    )
    assert above["y"] + above["height"] <= below["y"] + 1
