"""The page in a browser: it plays on the client, to scale, and asks the net for nothing."""

import base64
import re

import numpy as np
import pytest
from serving import (
    MANY,
    MODEL,
    ask,
    at_rest,
    chain,
    column,
    expect,
    frames,
    how_it_is_made,
    no_more,
    painted,
    picture,
    scales,
    scene,
    searched,
    until,
    zoomed,
)
from small_store import DISKS, KEPT

from granforce import measures
from granforce.study.store import open_store


@pytest.fixture
def visit(visit):
    """The same once its plots are there, and nothing moves any more."""

    def drawn(*query, **options):
        return plotted(visit(*query, **options))

    return drawn


def plotted(page):
    page.wait_for_function(f"() => {MODEL}('bars') || {MODEL}('path')")
    at_rest(page.locator(".scene"))
    return page


def at(page, x, y):
    """Point on the page of a place in the packing."""
    box = page.locator(".scene").bounding_box()
    px, py = scene(page, f"scene.toPixel({x}, {y})")
    return box["x"] + px, box["y"] + py


def pixels(page):
    """The chains' canvas as an array (height, width, 4)."""
    flat, width = page.locator(".scene").evaluate(
        """element => {
            const {canvas} = element.scene.chains
            const image = element.scene.chains.getImageData(0, 0, canvas.width, canvas.height)
            const text = Array.from(image.data, (byte) => String.fromCharCode(byte)).join("")
            return [btoa(text), canvas.width]
        }"""
    )
    return np.frombuffer(base64.b64decode(flat), dtype=np.uint8).reshape(-1, width, 4)


def link_of(page, number=0):
    """(contact, x, y): the middle of a segment that lies inside the box."""
    return page.locator(".scene").evaluate(
        """(element, number) => {
            const {x0, y0, x1, y1, contact, box} = element.scene.geometry
            const inside = (v, side) => v > 0.1 * side && v < 0.9 * side
            const found = Array.from(contact.keys()).filter(k => inside(x0[k], box[0]) &&
                inside(x1[k], box[0]) && inside(y0[k], box[1]) && inside(y1[k], box[1]) &&
                element.scene.width[k] > 0.1)
            const k = found[number]
            return [contact[k], (x0[k] + x1[k]) / 2, (y0[k] + y1[k]) / 2]
        }""",
        number,
    )


# The packing


def test_disks_are_to_scale(page):
    """Painted disks are as wide as high, and as large as their radii say, in pixels."""
    page.locator(".scene").click(trial=True)  # nothing lies over it
    size, high = page.locator(".scene").evaluate("e => [e.clientWidth, e.clientHeight]")
    assert size == pytest.approx(high, abs=1) and size > 0.35 * 1280
    (x0, y0), (x1, y1) = (scene(page, f"scene.toPixel({place})") for place in ("0, 0", "1, 1"))
    assert x1 - x0 == pytest.approx(y0 - y1, rel=1e-9)
    # the box's dashed edges, as painted, stand apart as its sides say
    across, up = page.locator(".scene").evaluate(
        """element => {
            const {disks, geometry} = element.scene, {canvas} = disks
            const grab = disks.getImageData.bind(disks)
            element.scene.begin(disks)
            disks.fillStyle = "#000"
            disks.fillRect(0, 0, ...geometry.box)
            const painted = (image) => {
                let count = 0
                for (let k = 3; k < image.data.length; k += 4) count += image.data[k] > 127
                return count
            }
            const middle = Math.floor(canvas.width / 2)
            const result = [painted(grab(0, middle, canvas.width, 1)),
                            painted(grab(middle, 0, 1, canvas.height))]
            element.scene.changed()
            return result
        }"""
    )
    assert across == pytest.approx(up, abs=1)
    side = scene(page, "scene.geometry.box[0] * scene.scale * scene.ratio")
    assert across == pytest.approx(side, abs=1.5)


def test_hovering_tells_grain_and_contact(page):
    contact, x, y = link_of(page)
    page.mouse.move(*at(page, x, y))
    tip = page.locator(".tip.on")
    tip.wait_for()
    assert str(scene(page, f"scene.geometry.backbone[{contact}]")) in tip.inner_text()
    expect(tip).to_contain_text("normal force fₙ, mean = 1")
    expect(tip).to_contain_text("interval of fₙ, seen")
    grain, x, y, r = scene(
        page,
        "(k => ['grain', 'x', 'y', 'r'].map(name => scene.geometry[name][k]))"
        "(scene.geometry.touching.findIndex((n, k) => n === 0 && scene.geometry.kind[k] === 1))",
    )
    page.mouse.move(*at(page, x, y))
    page.get_by_text(f"{grain} (loose)").wait_for()
    expect(tip).to_contain_text(f"{r:.3f}")


def test_the_packing_is_whole_and_what_is_told_of_a_contact_stays_within_it(page):
    """Where rows come to it, and while what compares networks is open."""
    page.mouse.move(*chain(page)[1:])
    page.locator(".tip.on").wait_for()
    beyond = """(() => {
        const {describe, tip, root} = scene
        scene.describe = {contact: () => [["a".repeat(30), "b".repeat(15)]]} // as held forces add
        scene.fillTip()
        const box = tip.getBoundingClientRect(), around = root.getBoundingClientRect()
        scene.describe = describe
        return [around.x - box.x, box.right - around.right, 300 - box.width]
    })()"""
    assert max(scene(page, beyond)) <= 0.5
    scene(page, "scene.root.scrollIntoView()")
    frames(page, 3)
    side, packing, last = (
        page.locator(one).bounding_box() for one in (".side", ".scene", ".skips")
    )
    assert packing["y"] >= side["y"]
    assert last["y"] + last["height"] <= side["y"] + side["height"] + 0.5


def test_the_forces_on_a_disk_are_shown_and_balance(page):
    off, most, pressure, mean = scene(
        page,
        """(() => {
            const {look, replay} = scene.hand.player, {walk, mixed} = replay
            let off = 0, most = 0, sum = 0, area = 0
            for (let g = 0; g < walk.radius.length; g++) {
                const forces = look.forcesOn(g, mixed), {pressure} = look.stressOn(g, mixed)
                const total = (name) => forces.reduce((sum, force) => sum + force[name], 0)
                off = Math.max(off, Math.abs(total("fx")), Math.abs(total("fy")))
                for (const {fx, fy} of forces) most = Math.max(most, Math.hypot(fx, fy))
                sum += pressure * walk.radius[g] ** 2
                area += walk.radius[g] ** 2
            }
            return [off, most, sum / area, look.meanPressure(mixed)]
        })()""",
    )
    assert off < 1e-5 < 1 < most  # balanced as single precision has it
    assert pressure == pytest.approx(mean, rel=1e-5)
    x, y, r = scene(
        page,
        "(k => ['x', 'y', 'r'].map(name => scene.geometry[name][k]))"
        "(scene.geometry.touching.findIndex((n, k) => n === 3 && scene.geometry.kind[k] === 0))",
    )
    inside = page.locator(".scene").evaluate(
        f"""({{scene}}) => {{
            for (let turn = 0; turn < 60; turn++) {{
                const place = [Math.cos(turn / 9), Math.sin(turn / 9)]
                place[0] = {x} + 0.6 * {r} * place[0]
                place[1] = {y} + 0.6 * {r} * place[1]
                if (scene.linkAt(...scene.toPixel(...place)) < 0) return place
            }}
        }}"""
    )
    page.mouse.move(*at(page, *inside))
    tip = page.locator(".tip.on").filter(has_text="pressure / mean")
    tip.wait_for()
    expect(tip).to_contain_text("shear / pressure")
    assert scene(page, "scene.pointed") >= 0


def test_scales_of_colour_and_width_are_set_and_stay(visit):
    page = visit(MANY + "&frame=5&full=0.2&stretch=5")
    c, width, bin_, colours, change, force, radius = scene(
        page,
        """(() => {
            const {style, mixed: {normal}} = scene, first = scene.hand.player.replay.walk.normal
            const c = normal.findIndex((n, c) => n > 0.1 && Math.abs(n - first[c]) < 0.15)
            return [
                c, style.width[c], style.bin[c], style.colours.length,
                normal[c] - first[c], normal[c], Math.max(...scene.geometry.r),
            ]
        })()""",
    )
    assert c >= 0 and width == pytest.approx(5 * 0.23 * radius * force, rel=1e-5)
    assert bin_ == pytest.approx((colours - 1) * (0.5 + change / 0.4), abs=0.51)
    page.get_by_text("+0.2 ⟨fₙ⟩").wait_for()
    page.get_by_text("1.74 ⟨fₙ⟩").wait_for()
    ask(page, 1)
    searched(page, "mu=1&")
    assert "full=0.2" in page.url and "stretch=5" in page.url
    wide, full = (scales(page).get_by_label(name) for name in ("widths times", "colours full at"))
    wide.fill("-3")
    wide.press("Enter")
    expect(wide).to_have_value("5")
    full.fill("")
    full.press("Enter")
    no_more(page, "full=")
    page.get_by_text("+0.5 ⟨fₙ⟩").wait_for()


def test_a_click_selects_the_contact_everywhere(page):
    contact, x, y = link_of(page, 3)
    page.mouse.click(*at(page, x, y))
    page.wait_for_function(f"() => {MODEL}('chosen')?.get_column('rank')?.length === 1")
    rank = column(page, "chosen", "rank")[0]
    ranks, which = column(page, "bars", "rank"), column(page, "bars", "at")
    assert which[ranks.index(rank)] == contact
    searched(page, f"select={contact}")
    page.mouse.click(*at(page, x, y))
    page.wait_for_function(f"() => {MODEL}('chosen')?.get_column('rank')?.length === 0")


def test_wheel_and_drag_change_the_view_and_doubleclick_resets_it(page):
    whole = scene(page, "scene.view.half")
    free = scene(  # a rattler: where a chain is, the pointer would take its force in hand
        page,
        "(k => [scene.geometry.x[k], scene.geometry.y[k]])"
        "(scene.geometry.touching.findIndex((n, k) => n === 0 && scene.geometry.kind[k] === 1))",
    )
    x, y = (round(value) for value in at(page, *free))
    page.mouse.move(x, y)
    zoomed(page, -400)
    until(page, f"scene.view.half < 0.7 * {whole}")
    assert at(page, *free) == pytest.approx((x, y), abs=2)
    place = at(page, *free)
    outside = scene(page, "scene.counts.outside")
    assert outside > 0 and f"({outside} out of view" in page.locator(".skips").text_content()
    searched(page, "zoom=")  # links keep it
    page.mouse.down()
    page.mouse.move(x + 40, y + 25)
    page.mouse.up()
    assert at(page, *free) == pytest.approx((place[0] + 40, place[1] + 25), abs=0.1)
    page.mouse.dblclick(x, y)
    until(page, f"scene.view.half === {whole}")
    no_more(page, "zoom=")


def test_leaving_out_thin_and_unseen_chains_changes_no_pixel(page):
    """Contacts out of view and thinner than a tenth of a pixel are counted, not drawn."""
    page.mouse.move(*at(page, 4, 4))
    zoomed(page, -500)
    until(page, "scene.counts.outside > 0")
    counts = scene(page, "scene.counts")
    assert counts["drawn"] + counts["outside"] + counts["thin"] == counts["segments"]
    before = pixels(page)
    all_drawn = page.locator(".scene").evaluate(
        """element => {
            const {scene} = element, {order, width, bin, style, geometry} = scene
            geometry.contact.forEach((c, k) => { width[k] = style.width[c]; bin[k] = style.bin[c] })
            scene.begin(scene.chains)
            const every = Array.from(geometry.contact.keys()).filter(k => width[k] > 0)
            scene.stroke(every, style.colours)
            return every.length
        }"""
    )
    after = pixels(page)
    assert all_drawn > counts["drawn"]
    changed = np.abs(before.astype(int) - after.astype(int)).max()
    assert changed <= 255 * 0.1 * 1.1  # a chain that thin covers at most a tenth of a pixel


PLAYER = "Bokeh.documents[0].get_model_by_name('player').player"
# At one moment: exact intervals may arrive later, or be in the store already.
DRAWN_AND_POSSIBLE = f"""(() => {{
    const {{low, high}} = {PLAYER}.look.exact ?? {PLAYER}.look.walk
    return [scene.style.bin, low, high].map((values) => Array.from(values))
}})()"""


def test_chains_are_coloured_by_what_is_chosen(visit):
    page = visit("?mu=0.1&n=30&states=30&relax=nearest_piqp&colour=mobilised&frame=6")
    normal = np.array(scene(page, "Array.from(scene.geometry.normal)")).reshape(KEPT + 1, -1)
    for colour in ("change", "extent"):
        page.locator(".legend select").first.select_option(colour)
        until(page, f"scene.hand.player.look.settings.colour === '{colour}'")
        shown, low, high = map(np.array, scene(page, DRAWN_AND_POSSIBLE))
        extent = high - low
        part = {
            "change": 0.5 + (normal[6] - normal[0]),
            "extent": extent / np.quantile(extent, 0.98),
        }
        np.testing.assert_allclose(shown, 32 * np.clip(part[colour], 0, 1), atol=0.501)


# Playing


def test_play_changes_the_chains_without_the_server(page):
    searched(page, "paused=1", "open=check")
    page.locator("input.speed").fill("2")
    before = scene(page, "[scene.painted, Array.from(scene.style.width)]")
    page.locator("button.play").click()
    no_more(page, "paused=")  # the page reports once that it plays
    page.evaluate("""() => {
        window.told = 0
        const send = WebSocket.prototype.send
        WebSocket.prototype.send = function (...given) { window.told += 1; send.apply(this, given) }
    }""")
    until(page, f"scene.painted > {scene(page, 'scene.painted')} + 30")
    assert page.evaluate("told") < 10  # in 30 frames: a ping, or a message of three parts
    page.locator("button.play").click()
    after = scene(page, "[scene.painted, Array.from(scene.style.width)]")
    assert after[1] != before[1]
    frames(page, 20)
    assert scene(page, "scene.painted") <= after[0] + 1


def test_what_is_shown_between_two_states_is_admissible(page):
    """Halfway frames are the mean of two states: balanced like them, and inside the cones."""
    page.locator("input.speed").fill("2")
    page.locator("button.play").click()
    between = """e => {
        const {mixed, hand: {player: {replay: {position}}}} = e.scene, part = position % 1
        if (part < 0.2 || part > 0.8) return null
        return [Array.from(mixed.normal), Array.from(mixed.tangential)]
    }"""
    handle = page.locator(".scene").element_handle()
    normal, tangential = map(np.array, page.wait_for_function(between, arg=handle).json_value())
    page.locator("button.play").click()
    frames = np.array(scene(page, "Array.from(scene.geometry.normal)")).reshape(KEPT + 1, -1)
    assert not np.any(np.all(np.isclose(frames, normal, atol=1e-6), axis=1))  # none of the states
    assert np.all(np.abs(tangential) <= 0.1 * normal + 1e-6) and np.all(normal >= 0)


def test_a_pause_goes_to_the_nearest_state(page):
    page.locator("input.speed").fill("1")
    player = "scene.hand.player"
    for motion in ("no-preference", "reduce"):
        page.emulate_media(reduced_motion=motion)
        page.keyboard.press("Home")
        page.locator("button.play").click()
        until(page, f"{player}.replay.position > 0.5")
        page.locator("button.play").click()
        until(page, f"!{player}.playing && {player}.replay.position % 1 === 0")
        shown, frames, frame, told = scene(
            page,
            f"[scene.mixed.normal, scene.geometry.normal, {player}.replay.frame,"
            f" {player}.model.frame].map((value) => value.length ? Array.from(value) : value)",
        )
        assert shown == frames[frame * len(shown) : (frame + 1) * len(shown)] and told == frame


def test_step_back_and_restart(page):
    def normal():
        return scene(page, "Array.from(scene.mixed.normal)")

    start = normal()
    page.locator("button.step").click()
    assert normal() != start
    expect(page.locator(".state")).to_have_text("of 30")
    page.locator("button.step").click()
    page.locator("button.back").click()
    page.keyboard.press("Home")
    assert normal() == start
    expect(page.locator(".state")).to_have_text("of 30, as packed")


def test_keys_play_step_and_change_tabs(page):
    page.locator(".scene").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowLeft")
    state = page.locator(".state")
    expect(state).to_have_text("of 30")
    page.keyboard.press("Home")
    expect(state).to_have_text("of 30, as packed")
    page.keyboard.press(" ")
    page.locator(".stage.playing").wait_for()
    page.keyboard.press(" ")
    page.locator(".stage:not(.playing)").wait_for()
    page.keyboard.press("2")
    searched(page, "tab=")
    page.keyboard.press("1")
    no_more(page, "tab=")


def test_keys_typed_into_a_field_stay_there(page):
    typed = page.locator("input.typed")
    typed.fill("")
    typed.type("0.2 ")
    expect(page.locator(".stage.playing")).to_have_count(0)
    assert "tab=" not in page.url
    typed.fill("0.1")  # as it was, or it would be computed when the field is left


def test_numbers_told_while_playing_are_those_of_measures(page):
    """η1, η2, η3 of the frames passed, against granforce.measures."""
    page.locator("input.scrub").fill(str(KEPT))
    forces = [
        np.array(scene(page, f"Array.from(scene.geometry.{name})")).reshape(KEPT + 1, -1)[1:]
        for name in ("normal", "tangential")
    ]
    states = np.stack(forces, axis=2)
    expected = {
        "eta1": measures.eta1(states),
        "eta2": measures.eta2(states),
        "eta3": measures.eta3(*measures.sampled_intervals(states)),
    }
    expected["eta3"] *= 0.15  # on one scale with the others
    for name, value in expected.items():
        assert float(page.locator(f"b.{name}").text_content()) == pytest.approx(value, abs=6e-4)
        assert column(page, "growth", name)[-1] == pytest.approx(value, rel=1e-3)
    told = page.locator(".running").text_content()  # nothing was played: the slider was moved
    assert f"up to this one, {KEPT} of {KEPT}" in told and "played" not in told
    original = np.array(scene(page, "Array.from(scene.geometry.normal)")).reshape(KEPT + 1, -1)[0]
    apart = np.mean(np.abs(states[-1, :, 0] - original))
    expect(page.locator("b.apart")).to_have_text(f"{100 * apart:.0f} %")
    assert re.fullmatch(r"\de-\d+", page.locator("b.residual").text_content())


def test_what_was_seen_stands_still_while_dots_move(page):
    seen = [column(page, "bars", name) for name in ("low", "high")]
    before = column(page, "bars", "now")
    page.locator("input.scrub").fill("4")
    page.wait_for_function(f"now => {MODEL}('bars').get_column('now')[0] !== now", arg=before[0])
    assert [column(page, "bars", name) for name in ("low", "high")] == seen
    now = column(page, "bars", "now")
    inside = [a - 1e-6 <= x <= b + 1e-6 for a, x, b in zip(seen[0], now, seen[1], strict=True)]
    assert all(inside)


# Selecting and computing


SLOW_TO_ANSWER = """
    const send = WebSocket.prototype.send, held = []
    let fetching = false, left = 0
    WebSocket.prototype.send = function (...given) {
        if (String(given[0]).includes("PULL-DOC-REQ")) { fetching = true; left = 3 } // frames of it
        if (!fetching || left-- > 0) return send.apply(this, given)
        held.push(() => send.apply(this, given))
    }
    window.answer = () => {
        WebSocket.prototype.send = send
        for (const sent of held) sent()
    }
"""


def test_states_computed_while_the_page_is_on_its_way_are_shown(opening, served):
    """The browser has fetched the page, and says so only when the states have been computed."""
    query, cache = "?mu=0.1&n=30&states=5&walkseed=77", served[1] / "cache"
    page = opening(query, 1280, 900, prepare=lambda page: page.add_init_script(SLOW_TO_ANSWER))
    for _ in range(1800):
        if cache.is_dir() and open_store(cache).find("walk", seed=77):
            break
        page.wait_for_timeout(100)
    page.wait_for_timeout(500)  # until the page's thread knows
    page.evaluate("answer()")
    painted(page)  # nothing before: no other packing is shown in place of the requested one
    until(page, "scene.geometry.states === 5")
    expect(page.locator(".source")).to_contain_text("5 networks")


def test_another_stored_mu_is_shown_by_a_key(page):
    page.locator(".friction input[type=range]").press("ArrowRight")
    until(page, "scene.geometry.mu > 0.1")  # 1, or what other tests have stored in between
    page.get_by_text(f"μ = {scene(page, 'scene.geometry.mu'):g}, 30 disks").wait_for()


def test_mu_typed_is_computed_and_shown_with_exact_intervals(page, own_mu):
    ask(page, own_mu)
    page.get_by_text(f"μ = {own_mu}, 30 disks").wait_for()
    page.wait_for_function(  # they follow by themselves
        f"() => {MODEL}('bars').get_column('exact_high').every(Number.isFinite)"
    )
    high, seen = (np.array(column(page, "bars", name)) for name in ("exact_high", "high"))
    assert np.all(high >= seen - 1e-5)
    picture(page, "intervals")


def test_scripts_are_fetched_once_and_run_as_they_are(page):
    """What is fetched early is what Panel asks for later, and nothing is translated in the page."""
    fetched = page.evaluate(
        "performance.getEntriesByType('resource').map((e) => e.name).filter((n) => /[.]js/.test(n))"
    )
    assert any("panel-material-ui" in name for name in fetched)
    assert len(fetched) == len(set(fetched))
    own = page.evaluate(
        """() => [...Bokeh.documents[0].all_models]
        .filter((model) => model.esm).map((model) => [model.class_name, model.bundle])"""
    )
    assert {"Player", "FrictionSlider", "Header"} <= {name for name, _ in own}
    assert all(bundle for _, bundle in own)


def test_a_copied_link_reopens_the_view(page, visit):
    page.locator("input.scrub").fill("4")
    page.keyboard.press("Tab")
    contact, x, y = link_of(page)
    page.mouse.click(*at(page, x, y))
    page.get_by_role("button", name="zoom in").click()
    searched(page, "network=8", "select", "zoom")
    page.get_by_role("button", name="Copy link").click()
    link = page.evaluate("navigator.clipboard.readText()")
    again = visit(link[link.index("?") :])
    until(again, "scene.selected !== null")
    assert scene(again, "scene.selected") == contact
    assert scene(again, "scene.view.half") == pytest.approx(scene(page, "scene.view.half"), 1e-4)
    expect(again.locator("input.number")).to_have_value(page.locator("input.number").input_value())


def test_the_command_line_is_copied(page):
    how_it_is_made(page).get_by_role("button", name="Copy CLI command").click()
    command = page.evaluate("navigator.clipboard.readText()")
    assert command.startswith(f"granforce walk -n {DISKS} --mu 0.1 --seed 1 --states 30")


# Themes and widths


def test_a_narrow_page_is_dark_by_night_and_no_wider_than_the_window(visit):
    page = visit("?dark=1&frame=7&colour=extent", 400)
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert sum(int(value) for value in re.findall(r"\d+", background)[:3]) / 3 < 80
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
