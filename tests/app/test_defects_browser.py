"""What visitors stumbled over, one test each: the page answers, and says what is so."""

import re

import numpy as np
import pytest
from packings import packed
from serving import (
    MANY,
    MODEL,
    ask,
    at_rest,
    expect,
    how_it_is_made,
    no_more,
    scales,
    scene,
    searched,
    shows,
    until,
)
from small_store import ROOT

import granforce as gf

# 1: Back and Forward


def test_back_and_forward_restore_views_and_copied_links(visit):
    page = visit()
    shows(page, 0.1)
    ask(page, 1)
    shows(page, 1)
    searched(page, "mu=1&")
    page.get_by_role("tab", name="Export").click()
    searched(page, "tab=export")
    page.go_back()
    no_more(page, "tab=")
    page.locator("[role=tab][aria-selected=true]", has_text="Intervals").wait_for()
    page.go_back()
    shows(page, 0.1)
    searched(page, "mu=0.1&")
    page.get_by_role("button", name="Copy link").click()
    link = page.evaluate("navigator.clipboard.readText()")
    assert "mu=0.1&" in link and "tab=" not in link
    page.go_forward()
    shows(page, 1)
    searched(page, "mu=1&")
    page.go_forward()
    page.locator("[role=tab][aria-selected=true]", has_text="Export").wait_for()


# A page's address by its script alone, and `gone(steps)`: Back or Forward, once it has been heard.
ADDRESSED = """async ({render}, {first, query}) => {
    const sent = [], heard = {}
    const model = {
        first, query, settled: 0, passing: [], send_msg: (message) => sent.push(message.query),
        on(names, hear) { for (const name of [names].flat()) heard[name] = hear },
    }
    const gone = (steps) => new Promise((done) => {
        addEventListener("popstate", () => done(location.search), {once: true})
        history.go(steps)
    })
    history.replaceState(null, "", "/")
    render({model, view: {model: {document: {knownThere: true, on_event() {}}}}})
    try { %s } finally { heard.remove() }
}"""


def test_the_first_view_is_gone_back_to_although_another_is_asked_for_as_the_page_opens(run):
    """On a slow machine the next one is there before the script that keeps the address."""
    seen = "return [location.search, await gone(-1)]"
    views = run("explore/page_address", ADDRESSED % seen, first="?mu=0.1", query="?mu=1")
    assert views == ["?mu=1", "?mu=0.1"]


def test_back_and_forward_at_once_end_at_the_last_view(run):
    """However long the server takes, and although it answers the first of them meanwhile."""
    seen = """
        await gone(-1)
        await gone(1)
        Object.assign(model, {query: first, settled: 1})
        heard.query()
        const meanwhile = location.search
        Object.assign(model, {query, settled: 2})
        heard.settled()
        return [[...sent], meanwhile, location.search, await gone(-1)]"""
    views = run("explore/page_address", ADDRESSED % seen, first="?mu=0.1", query="?mu=1")
    assert views == [["?mu=0.1", "?mu=1"], "?mu=1", "?mu=1", "?mu=0.1"]


def test_steps_of_the_player_are_not_gone_back_to(page):
    before = page.evaluate("history.length")
    for _ in range(3):
        page.locator("button.step").click()
    searched(page, "network=6")
    assert page.evaluate("history.length") == before


# 3: What is refused, and fields


def test_what_is_refused_is_told_at_the_lower_edge(visit):
    page = visit(width=390, height=844)
    ask(page, "10e9")
    told = page.get_by_role("alert").filter(has_text="too large for the balance of forces")
    told.wait_for()
    edges = told.bounding_box()
    assert edges["y"] + edges["height"] <= 844 and edges["x"] >= 0
    told.get_by_role("button", name="Close").click()
    told.wait_for(state="hidden")
    ask(page, "10e9")
    told.wait_for()  # the same refusal is told again


def test_a_mark_of_the_slider_is_chosen_by_a_click(page):
    page.locator(".scale button").get_by_text("1", exact=True).click()
    shows(page, 1)


def rgb(locator, name):
    """Red, green, blue and, unless it is 1, opacity of a colour of an element."""
    colour = locator.evaluate("(e, name) => getComputedStyle(e)[name]", name)
    return [float(part) for part in re.findall(r"[\d.]+", colour)]


def test_an_error_bar_below_0_holds_nothing(visit):
    page = visit()
    page.keyboard.press("n")
    field = page.locator("input.uncertainty")
    ink, paper = (rgb(field, name) for name in ("color", "backgroundColor"))
    assert paper[3:] == [0] and min(ink) > 200  # light, on the dark ground of the tools
    field.fill("-1")
    page.locator("button.hold").click()
    page.locator(".message").get_by_text("Enter an error bar of 0 or more").wait_for()
    assert "hold=" not in page.url
    page.locator("input.uncertainty").fill("0.1")
    page.locator("button.hold").click()
    searched(page, "hold=")


def test_a_force_that_is_let_go_at_once_goes_where_it_was_flung(page):
    flung = page.locator(".scene").evaluate(
        """e => {
            const {hand, geometry} = e.scene, [xa, ya, xb, yb] = e.scene.ends(5)
            const at = e.scene.toPixel((xa + xb) / 2, (ya + yb) / 2)
            hand.takeInScene(geometry.contact[5], ...at)
            hand.moveInScene(at[0], at[1] - 40)
            hand.leave()
            return [hand.rail === null, geometry.contact[5]]
        }"""
    )
    assert flung[0]  # let go before it could be pulled
    searched(page, f"pull={flung[1]}%3A")
    until(page, "scene.hand.replay.held && !scene.hand.active")


# 4: Number fields


def test_number_fields_take_whole_numbers_and_typing_after_enter(visit):
    page = visit()
    disks = how_it_is_made(page).get_by_role("spinbutton", name="Disks N")
    before = disks.input_value()
    disks.fill("many")
    disks.press("Enter")
    page.get_by_text("Disks N must be a whole number").filter(visible=True).wait_for()
    expect(disks).to_have_value(before)
    field = how_it_is_made(page).get_by_role("spinbutton", name="Networks")
    field.click()
    for number in (31, 32, 100_050 // 10):
        page.keyboard.press("Control+A")
        page.keyboard.type(str(number))
        page.keyboard.press("Enter")
        searched(page, f"states={number}")
        expect(field).to_have_value(str(number))
    inside = field.evaluate("e => e.scrollWidth <= e.clientWidth + 1")
    assert inside  # nothing is cut


# 5: Uploaded packings


def test_uploaded_packings_show_their_own_number_of_disks_and_stay(visit, tmp_path):
    page = visit("?tab=upload")
    given = page.locator("input[type=file]")
    gf.save_packing(packed(40, 0.3), tmp_path / "mine.npz")
    given.set_input_files(tmp_path / "mine.npz")
    page.get_by_text("dimension h of S").wait_for()
    searched(page, "packing=")
    given.set_input_files(ROOT / "LICENSE")
    page.get_by_text("neither an NPZ of granforce").wait_for()
    page.get_by_text("dimension h of S").wait_for(state="detached")
    page.locator(".source", has_text="mine.npz").wait_for(state="attached")
    expect(how_it_is_made(page).get_by_role("spinbutton", name="Disks N")).to_have_value("40")
    page.get_by_role("spinbutton", name="Seed").wait_for(state="hidden")
    # A look at Learn does not lose the packing and the view.
    page.get_by_role("tab", name="Export").click()
    searched(page, "tab=export")
    page.get_by_role("link", name="Learn", exact=True).first.click()
    page.get_by_role("heading", name="Pull one force").first.wait_for()
    page.get_by_role("link", name="Explore", exact=True).click()
    page.locator(".source", has_text="mine.npz").wait_for(state="attached")
    page.locator("[role=tab][aria-selected=true]", has_text="Export").wait_for()
    searched(page, "packing=")


# 6: Keys


def test_space_and_arrows_play_except_where_tab_leads_to_a_widget(page):
    page.get_by_role("tab", name="Intervals").click()
    page.keyboard.press("ArrowRight")
    state = page.locator(".state")
    page.wait_for_function("e => !e.textContent.endsWith('as packed')", arg=state.element_handle())
    page.keyboard.press(" ")
    page.locator(".stage.playing").wait_for()
    page.keyboard.press(" ")
    page.locator(".stage:not(.playing)").wait_for()
    scales(page).get_by_label("colours full at").focus()
    page.keyboard.press("Tab")
    wide = page.get_by_label("widths times")
    assert wide.evaluate("e => e.getRootNode().activeElement === e")
    page.keyboard.press(" ")
    expect(page.locator(".stage.playing")).to_have_count(0)


# 7: What is not computed yet


def test_what_is_asked_for_moves_nothing_and_stays_pale_no_longer_than_it_is_old(visit, own_mu):
    page = visit()
    plot = page.locator(".bk-Figure").first
    plot.wait_for()
    page.wait_for_function(f"() => {MODEL}('bars')?.get_length() > 0")
    before = at_rest(plot)
    page.evaluate(MOST_BARS)
    ask(page, own_mu)
    shows(page, own_mu)
    assert len(page.evaluate("window.mostBars")) <= 1
    page.locator(".task").first.wait_for(state="hidden")
    results = page.locator(".results").first
    page.wait_for_function("e => getComputedStyle(e).opacity === '1'", arg=results.element_handle())
    assert at_rest(plot)["y"] == before["y"]


# 8: Two contacts


def middles(page, count):
    """Points on the page in the middle of the thickest chains inside the box, far apart."""
    return page.locator(".scene").evaluate(
        """(element, count) => {
            const { scene } = element, { x0, y0, x1, y1, contact, box } = scene.geometry
            const inside = (v, side) => v > 0.15 * side && v < 0.85 * side
            const found = Array.from(contact.keys()).filter((k) => inside(x0[k], box[0]) &&
                inside(x1[k], box[0]) && inside(y0[k], box[1]) && inside(y1[k], box[1]) &&
                contact[k] !== scene.selected)
            found.sort((a, b) => scene.width[b] - scene.width[a])
            const { left, top } = element.getBoundingClientRect()
            return found.slice(0, count).map((k) => {
                const [x, y] = scene.toPixel((x0[k] + x1[k]) / 2, (y0[k] + y1[k]) / 2)
                return [contact[k], x + left, y + top]
            })
        }""",
        count,
    )


def test_a_line_that_is_clicked_takes_the_place_of_the_green_one(visit):
    page = visit("?tab=plane")
    until(page, "scene.pair.length === 2")
    green, a = scene(page, "scene.pair")
    b, *place = next(found for found in middles(page, 3) if found[0] not in (green, a))
    page.mouse.click(*place)
    until(page, f"`${{scene.pair}}` === '{b},{a}'")
    assert scene(page, "scene.selected") == b
    page.wait_for_function(f"() => {MODEL}('outer')?.get_column('x')?.length > 3")
    backbone = scene(page, "Array.from(scene.geometry.backbone)")
    which = f"Green: contact {backbone[b]}; violet: contact {backbone[a]}."
    page.get_by_text(which).wait_for(state="attached")  # among what is to be opened
    searched(page, f"span={b}-{a}")


# 9: Small things


@pytest.mark.parametrize("query", [MANY, "?tab=statistics"])
def test_legends_lie_where_no_curve_goes(lasting, query):
    page = lasting(query)
    page.wait_for_function(
        """() => [...Bokeh.documents[0].all_models]
            .filter((m) => m.type === "Figure" &&
                !m.properties.inner_width.is_unset && m.inner_width > 50).length >= 2"""
    )
    places = page.evaluate(
        """() => [...Bokeh.documents[0].all_models]
            .filter((m) => m.type === "Figure" &&
                !m.properties.inner_width.is_unset && m.inner_width > 50)
            .map((m) => [m.center, m.above].map(
                (part) => part.filter((r) => r.type === "Legend" && r.visible).length))"""
    )
    assert len(places) >= 2
    assert sum(within for within, _ in places) == 0
    assert any(above for _, above in places)


def test_ticks_of_friction_stand_apart(lasting):
    page = lasting("?tab=statistics")
    page.get_by_text("Maxima, the paper’s walk").wait_for()
    page.wait_for_function(
        "() => [...Bokeh.documents[0].all_models]"
        ".some((m) => m.type === 'LogAxis' && m.axis_label === 'friction μ')"
    )
    ticks, width = page.evaluate(
        """() => {
            const models = [...Bokeh.documents[0].all_models]
            const fig = models.find((m) => m.type === "Figure" &&
                m.below.some((axis) => axis.axis_label === "friction μ"))
            return [fig.below.find((axis) => axis.ticker).ticker.ticks.length, fig.inner_width]
        }"""
    )
    assert width / ticks > 40  # px for each label of at most five letters


# What is said must be so


def test_friction_shows_figures_1_4_and_6_and_the_claims_with_verdicts(lasting):
    page = lasting("?tab=statistics")
    for words in ("Maxima, the paper’s walk", "How long are the intervals seen?"):
        page.get_by_text(words).wait_for()
    page.get_by_text("Are the strong contacts the undetermined ones?").wait_for()
    page.wait_for_function(f"() => {MODEL}('indeterminacy_marks')?.get_length() === 3")
    page.wait_for_function(f"() => {MODEL}('coordination_marks')?.get_length() === 1")
    page.get_by_role("cell", name="η(μ) is not monotonic").wait_for()
    verdicts = page.get_by_role("cell").filter(has_text="✓")
    assert verdicts.count() >= 5 and "largest" in verdicts.first.inner_text()


def test_what_is_unfolded_comes_into_view(visit):
    page = visit("?tab=intervals")
    page.get_by_role("button", name="How many networks does it take?").click()
    fold = page.locator(".MuiAccordion-root").first
    results = page.get_by_role("region", name="Results")
    page.wait_for_function(  # it grows, and is followed
        "([fold, results]) => fold.offsetHeight > 150 &&"
        " fold.getBoundingClientRect().bottom < results.getBoundingClientRect().top",
        arg=[fold.element_handle(), results.element_handle()],
    )


# Colour and width by limit load


def test_limit_loads_are_shown_as_colour_and_width(visit):
    page = visit("?colour=load&thickness=load")
    page.wait_for_function(
        f"() => {MODEL}('player').loads?.length > 0 || {MODEL}('player').data?.loads?.length > 0"
    )
    until(page, "scene.style.width.some((w) => w > 0)")
    widths = np.array(scene(page, "Array.from(scene.style.width)"))
    bins = np.array(scene(page, "Array.from(scene.style.bin)"))
    widest = np.array(scene(page, "Array.from(scene.hand.player.look.widest)"))
    free = widths < widest  # small disks limit the others
    assert (np.diff(bins[free][np.argsort(widths[free])]) >= 0).all() and bins.max() == 32
    assert free.mean() > 0.8
    chosen = "all => all.map((one) => one.selectedOptions[0]?.textContent)"
    assert page.locator("select").evaluate_all(chosen).count("limit load") == 2


# Counts progress bars that are seen at once, for as long as the page is open.
MOST_BARS = """() => {
    window.mostBars = []
    const all = (root) => [...root.querySelectorAll("*")].flatMap(
        (e) => [e, ...(e.shadowRoot ? all(e.shadowRoot) : [])])
    const count = () => {
        const bars = all(document).filter(
            (e) => e.matches(".bar[role=progressbar]") && e.offsetHeight)
        if (bars.length > window.mostBars.length) window.mostBars = bars.map((e) => e.outerHTML)
        requestAnimationFrame(count)
    }
    count()
}"""


def test_the_line_of_results_opens_tables_at_the_height_of_a_laptop(visit):
    page = visit()
    page.set_viewport_size({"width": 1440, "height": 900})
    results = page.get_by_role("region", name="Results")
    note = results.get_by_text("Not counted:")
    expect(note).to_be_hidden()
    results.get_by_role("button", name="tables").click()
    expect(note).to_be_visible()
