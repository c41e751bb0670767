"""What somebody stumbled over who saw the page for the first time, one test each."""

import pytest
from serving import (
    MODEL,
    ask,
    how_it_is_made,
    more,
    painted,
    picture,
    scene,
    shows,
    until,
)

from granforce.glossary import TERMS

AT = "?mu=0.1&n=30&states=30&relax=nearest"

# Whether an element lies over no text of the page's main part.
COVERS = """(found) => {
    const box = found.getBoundingClientRect()
    const all = (root) => [...root.querySelectorAll("*")].flatMap(
        (e) => [e, ...(e.shadowRoot ? all(e.shadowRoot) : [])])
    const main = all(document).find((e) => e.matches(".main-content")).getBoundingClientRect()
    return box.height > 0 && box.bottom > main.top && box.top < main.bottom
}"""


def computing(page):
    """Ask for a packing that takes longer than any test, and wait until it is computed."""
    disks = how_it_is_made(page).get_by_role("spinbutton", name="Disks N")
    disks.fill("9000")
    disks.press("Enter")
    bar = page.locator(".task").filter(visible=True).first
    bar.wait_for()
    return bar


@pytest.fixture
def cancelled():
    """Pages whose computation is ended after the test."""
    pages = []
    yield pages.append
    for page in pages:
        page.get_by_role("button", name="Cancel").filter(visible=True).first.click()
        page.locator(".task").filter(visible=True).first.wait_for(state="detached")


# 1: what is shown at a friction is of that friction


def test_where_a_series_has_no_states_none_of_another_friction_is_named(visit, cancelled):
    page = visit(AT)
    shows(page, 0.1)
    chosen = how_it_is_made(page).get_by_role("combobox", name="Precomputed results")
    assert chosen.locator("option:checked").inner_text().endswith(" μ from 0 to 1")
    computing(page)
    cancelled(page)
    none = chosen.locator("option:checked").filter(has_text="none with N = 9000")
    none.wait_for(state="attached")


# 2: what was opened stays open


def test_the_explanation_stays_open_when_another_packing_comes(visit):
    page = visit(AT)
    page.get_by_text("What am I seeing?").click()
    why = page.locator("details[open] p").first
    why.wait_for()
    before = why.inner_text()
    ask(page, 1)
    shows(page, 1)
    page.wait_for_function("([e, text]) => e.isConnected ? e.innerText !== text : true",
        arg=[why.element_handle(), before])  # fmt: skip
    assert page.locator("details[open] p").first.inner_text() != before


# 3: nothing lies over the page's text


@pytest.mark.parametrize("width, height", [(1280, 900), (1920, 1080)])
def test_progress_and_tour_cover_nothing(visit, cancelled, width, height):
    page = visit(AT, width, height)
    tour = page.get_by_role("button", name="Tour", exact=True)
    tour.wait_for()
    assert not tour.evaluate(COVERS)
    bar = computing(page)
    cancelled(page)
    assert not bar.evaluate(COVERS)
    picture(page, f"newcomer/computing-{width}")


def test_on_a_narrow_page_there_is_room_below_the_text_for_what_is_computed(visit, cancelled):
    page = visit(AT, 390, 844)
    page.locator("input.typed").wait_for()
    page.get_by_role("button", name="Open drawer").click()
    bar = computing(page)
    cancelled(page)
    page.keyboard.press("Escape")  # which closes the sidebar
    height = bar.evaluate("e => e.offsetHeight")
    page.wait_for_function(
        """height => {
            const all = (root) => [...root.querySelectorAll("*")].flatMap(
                (e) => [e, ...(e.shadowRoot ? all(e.shadowRoot) : [])])
            const main = all(document).find((e) => e.matches(".main-content"))
            return parseFloat(getComputedStyle(main).paddingBottom) >= height
        }""",
        arg=height,
    )
    picture(page, "newcomer/computing-390")


# 6: the tour points at what it speaks of, as long as it does


def ring(page):
    """What the tour's ring is around, once it is seen: (left, top, right, bottom)."""
    found = page.locator(".ring").filter(visible=True)
    box = None
    while box is None:  # it may be laid out anew between the two
        found.wait_for()
        box = found.bounding_box()
    return box["x"], box["y"], box["x"] + box["width"], box["y"] + box["height"]


# 8: words are explained where they stand


def test_words_that_were_not_understood_are_explained(visit):
    page = visit(AT + "&frame=5")
    more(page)
    page.get_by_text("In numbers").click()
    tip = page.get_by_role("tooltip").filter(visible=True)
    for where, term in (
        (".skips", "segment"),
        (".rest .term", "rattler"),
        (".tile[data-term=eta3]", "eta3"),
        (".read [data-term=eta3]", "eta3"),
    ):
        page.locator(where).first.hover()
        tip.get_by_text(TERMS[term].sentence).wait_for()
        page.mouse.move(5, 5)
        tip.wait_for(state="hidden")


# 9: colour and width by what was measured


def test_what_is_known_colours_the_chains_and_goes_into_pictures(visit):
    page = visit(AT)
    value = scene(page, "scene.mixed.normal[4]")
    link = f"{AT}&known=4:{value:.6f}~9:{scene(page, 'scene.mixed.normal[9]'):.6f}:0.05"
    page = visit(link + "&colour=known&thickness=known&tab=export")
    until(page, "scene.style.width.some((w) => w > 0)")
    until(page, "scene.style.bin[4] === 32")  # held: all of it
    page.get_by_text("colour: what is known").wait_for()
    picture(page, "newcomer/known")
    text = scene(
        page,
        'scene.picture({ background: "", ink: "", lines: [],'
        ' bar: { low: "", high: "", stops: [] } })',
    )
    colour = scene(page, "scene.palette.known")
    assert text.count(f'stroke="{colour}"') >= 2  # a spot on each contact that is known
    with page.expect_download() as saved:
        page.get_by_role("button", name="SVG", exact=True).click()
    assert "Known: contact " in (saved.value.path()).read_text()
    painted(page)


# 10: the packing alone, in a page of somebody else's


def test_embedded_there_is_the_packing_with_its_player_alone(opening):
    page = opening(f"{AT}&embed=1", 600, 700)
    painted(page)
    page.get_by_text("width: normal force").wait_for()
    assert page.locator(".header, [role=tab]").filter(visible=True).count() == 0
    page.locator("button.step").click()
    until(page, "scene.hand.player.replay.frame === 1")
    picture(page, "newcomer/embedded")


# 11: all contacts as a table, and by keyboard


def test_contacts_are_chosen_by_keyboard_and_found_in_a_table(visit):
    page = visit(f"{AT}&frame=5")
    strongest = "Array.from(scene.mixed.normal).reduce((k, f, c, all) => f > all[k] ? c : k, 0)"
    page.locator(".scene").focus()
    page.keyboard.press("n")
    assert scene(page, "scene.selected") == scene(page, strongest)
    page.get_by_text("All contacts as a table").click()
    rows = page.locator("tr[data-contact]")
    assert rows.first.get_attribute("aria-selected") == "true"
    page.locator(".least").fill("1")
    many = scene(page, "scene.mixed.normal.filter((force) => force >= 1).length")
    page.get_by_text(f"{many} of ").wait_for()
    assert rows.count() == many
    assert scene(page, "scene.hand.player.look.only.reduce((a, b) => a + b, 0)") == many
    rows.first.focus()
    page.keyboard.press("ArrowDown")
    second = int(rows.nth(1).get_attribute("data-contact"))
    until(page, f"scene.selected === {second}")
    page.get_by_text("All contacts as a table").click()
    until(page, "scene.hand.player.look.only === null")


def test_the_difference_of_two_networks_is_spotted(visit):
    page = more(visit(AT))
    page.get_by_role("button", name="Spot the difference").click()
    game, told = "scene.hand.player.difference", page.locator(".quiz")
    told.get_by_text("Click the 5 lines that differ most").wait_for()
    assert scene(page, "new Set(scene.style.bin).size") == 1  # no colour tells
    changes = scene(page, f"Array.from({game}.change, Math.abs)")
    most = sorted(range(len(changes)), key=changes.__getitem__)
    for contact, words in ((most[0], "others differ more. 0 of 5"), (most[-1], "found. 1 of 5")):
        scene(page, f"scene.onSelect({contact})")
        told.get_by_text(words).wait_for()
    for contact in most[-5:-1]:
        scene(page, f"scene.onSelect({contact})")
    told.get_by_text("That was the last one").wait_for()
    assert scene(page, "new Set(scene.style.bin).size") > 3
    page.locator("button.play").click()
    assert told.inner_text() == ""


# 12: at first there is the picture, and little around it


def test_what_compares_and_checks_is_closed_until_it_is_opened_or_a_link_shows_it(visit):
    page = visit(AT)
    tools = page.locator(".extras button, .extras .source, .skips")
    assert tools.count() == 7 and tools.filter(visible=True).count() == 0
    more(page)
    assert tools.filter(visible=True).count() == 7
    page = visit(AT + "&split=1")
    page.locator("button.split").filter(visible=True).wait_for()


def test_the_volume_is_measured_among_the_numbers(visit):
    page = visit(AT)
    measure = page.get_by_role("button", name="Measure the volume")
    page.get_by_text("In numbers").click()
    measure.wait_for()
    page.get_by_text("In numbers").click()
    measure.wait_for(state="hidden")


def test_all_controls_are_there_at_once_for_who_asks(visit):
    page = visit(AT, first=True)
    page.locator("button.all").click()
    page.locator(".scrub").filter(visible=True).wait_for()
    how_it_is_made(page).get_by_role("spinbutton", name="Disks N").wait_for()


def test_who_never_saw_the_curve_over_friction_guesses_first(visit):
    page = visit(AT + "&tab=statistics")
    page.locator(".turn").get_by_text("at which friction do forces vary most?").wait_for()
    scene(page, "scene.hand.player.model.guess = true")
    guess = page.get_by_role("button", name="more, then less")
    guess.wait_for()
    page.locator(".turn").get_by_text(
        "how does friction change how much a force varies?"
    ).wait_for()
    assert not page.locator(".hill").filter(visible=True).count()  # it would give it away
    models = "[...Bokeh.documents[0].all_models]"
    pencil = "model => model.type === 'FreehandDrawTool' && model.active"
    page.wait_for_function(f"() => {models}.some({pencil})")
    plot = page.locator("canvas").filter(visible=True).last.bounding_box()
    at = [
        (plot["x"] + part * plot["width"], plot["y"] + 0.5 * plot["height"]) for part in (0.3, 0.7)
    ]
    page.mouse.move(*at[0])
    page.mouse.down()
    page.mouse.move(*at[1], steps=8)
    page.mouse.up()
    page.wait_for_function(f"() => {MODEL}('guessed').get_column('xs')[0]?.length > 4")
    guess.click()
    page.get_by_text("Well guessed. The grey line is your guess.").wait_for()
    tools = "[...Bokeh.documents[0].all_models].filter(model => model.type === 'TapTool')"
    page.wait_for_function(
        f"() => {tools}.every(tool => tool.active)"
    )  # points can be clicked again
    page.locator(".turn").get_by_text("at which friction do forces vary most?").wait_for()
    assert page.evaluate("localStorage.getItem('granforce.guess')") == "seen"
