"""What somebody sees who was never here: a page that moves, a tour, words that are explained."""

from functools import partial

import pytest
from serving import MANY, how_it_is_made, painted, picture, scene, searched, until

from app.views.small import FIRST_STEPS
from granforce.glossary import TERMS

STEPS = 6
BEFORE = len(FIRST_STEPS)  # steps on the pages of small scenes


@pytest.fixture
def visit(visit):
    """The same, of a first visit."""
    return partial(visit, first=True)


def card(page):
    return page.get_by_role("dialog")


def press(page, name):
    card(page).get_by_role("button", name=name, exact=True).click()


def plays(page, playing=True):
    """Wait until the player plays, or rests."""
    until(
        page, f"element.closest('.stage').classList.contains('playing') === {str(playing).lower()}"
    )


def at_step(page, number):
    card(page).get_by_text(f"{number + BEFORE} of {STEPS + BEFORE}").wait_for()


def dragged(page):
    """Take the selected contact in hand, and let go: its force stays."""
    contact, x, y = page.locator(".scene").evaluate(
        """(element) => {
            const { scene } = element, { x0, y0, x1, y1, contact } = scene.geometry
            const { left, top } = element.getBoundingClientRect()
            const seen = Array.from(contact.keys()).filter((k) => contact[k] === scene.selected)
                .map((k) => scene.toPixel((x0[k] + x1[k]) / 2, (y0[k] + y1[k]) / 2))
                .filter(([x, y]) => x > 0 && y > 0 && x < scene.size && y < scene.size)
            return [scene.selected, seen[0][0] + left, seen[0][1] + top]
        }"""
    )
    before = scene(page, f"scene.mixed.normal[{contact}]")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 12, steps=3)
    until(page, "scene.hand.rail !== null")
    page.mouse.move(x, y - 60, steps=6)
    until(page, f"Math.abs(scene.mixed.normal[{contact}] - {before}) > 1e-3")
    page.mouse.up()
    page.keyboard.press("z")


# The tour


@pytest.mark.parametrize(
    "width, height, scheme",
    [
        *((1280, 900, "light"), (390, 844, "dark")),
        pytest.param(1920, 1080, "light", marks=pytest.mark.slow),
        pytest.param(1280, 900, "dark", marks=pytest.mark.slow),
        pytest.param(390, 844, "light", marks=pytest.mark.slow),
    ],
)
def test_the_tour_is_walked_through_and_closes_into_the_page(visit, width, height, scheme):
    page = visit("?dark=1&tour=1" if scheme == "dark" else "", width, height)
    for step in range(1, STEPS + 1):
        at_step(page, step)
        assert card(page).bounding_box()["height"] < 0.5 * height
        if step == 2:  # it goes to another network and back
            plays(page)
            searched(page, "between=0-")
        if step == 3:
            until(page, "scene.selected !== null")
            if width > 400:  # what the step asks for can be done at once
                dragged(page)
        if step in (4, 5, 6):
            tab = {4: "plane", 5: "statistics", 6: "perturb"}[step]
            if tab != "plane" or width < 1800:  # on a wide page it is seen anyway
                searched(page, f"tab={tab}")
        page.locator(".ring").filter(visible=True).wait_for()
        if width >= 1200:  # beside what it speaks of: where nothing else is, or over the controls
            box, scene_box = card(page).bounding_box(), page.locator(".scene").bounding_box()
            if step in (1, 2):
                assert scene_box["x"] + scene_box["width"] < box["x"] < width - box["width"]
            else:
                assert box["x"] + box["width"] <= scene_box["x"]
        picture(page, f"tour/{width}-{scheme}-{step}")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        press(page, "Next" if step < STEPS else "Finish")
    card(page).wait_for(state="hidden")
    assert "tab=perturb" in page.evaluate("location.search")  # the page as it is
    page.get_by_role("button", name="Let the push grow").wait_for()


def test_on_a_narrow_page_the_sidebar_waits_until_it_is_asked_for(visit):
    """It lies over the page there: nothing of it is seen while the page comes."""
    page = visit("?tour=1", 390, 844)
    at_step(page, 1)
    page.wait_for_function(
        "() => document.documentElement.style.getPropertyValue('--sidebar') === 'visible'"
    )
    press(page, "Close")
    card(page).wait_for(state="hidden")
    page.get_by_role("button", name="Open drawer").click()
    page.get_by_role("dialog").get_by_text("How this packing is made").first.wait_for()


def test_the_tour_comes_once_by_itself_and_then_by_its_button(visit):
    page = visit()
    at_step(page, 1)
    press(page, "Close")
    card(page).wait_for(state="hidden")
    page.goto(page.url.split("?")[0] + MANY)
    painted(page)
    button = page.get_by_role("button", name="Tour", exact=True)
    button.wait_for()
    assert not card(page).is_visible()
    button.click()
    at_step(page, 1)


@pytest.mark.parametrize("number", [2, 6])
def test_a_link_opens_a_step(visit, number):
    at_step(visit(f"?tour={number}"), number)


def test_the_tour_goes_by_keyboard_and_is_told_to_screen_readers(visit):
    page = visit("?tour=1", reduced_motion="reduce")
    at_step(page, 1)
    # The focus is on the title, which names the dialog.
    title = card(page).get_by_role("heading")
    focused = "e => e.getRootNode().activeElement === e"
    page.wait_for_function(focused, arg=title.element_handle())
    name = card(page).evaluate(
        "e => e.getRootNode().getElementById(e.getAttribute('aria-labelledby')).textContent"
    )
    assert name == title.inner_text()
    page.keyboard.press("Tab")  # Back, to the groove
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    at_step(page, 2)
    page.keyboard.press("Escape")
    card(page).wait_for(state="hidden")


def test_the_tour_offers_all_that_it_speaks_of(visit):
    page = visit("?mu=0.1&n=30&states=30&relax=nearest")
    scrub = page.locator(".scrub")
    page.get_by_role("button", name="Tour").click()
    at_step(page, 1)
    assert not scrub.is_visible()
    card(page).get_by_role("button", name="Next").click()
    at_step(page, 2)
    scrub.filter(visible=True).wait_for()  # that beside Play


# The page opens moving: of a link that shows something of its own, until it is touched

SHOWS = "?mu=0.1&n=30&states=30&relax=nearest&drawn=all"


def test_the_page_plays_slowly_until_it_is_touched(visit):
    page = visit(SHOWS)
    plays(page)
    assert page.locator(".rate").inner_text() == "1.0 /s"
    page.locator(".lead").click()
    plays(page, False)
    assert page.locator(".rate").inner_text() == "1.0 /s"  # nor does the speed jump


@pytest.mark.parametrize("action", ["button", "space"])
def test_what_pauses_does_not_start_again(visit, action):
    page = visit(SHOWS)
    plays(page)
    if action == "button":
        page.locator("button.play").click()
    else:
        page.keyboard.press(" ")
    plays(page, False)
    # A pause goes on to the nearest network, and rests there.
    still = """e => { const before = window.painted; window.painted = e.scene.painted
        return before === window.painted }"""
    page.wait_for_function(still, arg=page.locator(".scene").element_handle(), polling=500)
    count = scene(page, "scene.painted")
    page.wait_for_timeout(1000)  # longer than the page rests at an end
    assert scene(page, "scene.painted") <= count + 2


def test_nothing_moves_by_itself_where_motion_is_reduced_or_one_moment_is_shown(visit):
    for query, options in (
        ("?frame=3&mu=0.1&n=30&states=30&relax=nearest", {}),
        ("?tour=1", {"reduced_motion": "reduce"}),
    ):
        page = visit(query, **options)
        page.wait_for_timeout(1000)
        assert page.locator(".stage.playing").count() == 0


# The glossary where words stand


def hint(page):
    return page.get_by_role("tooltip").filter(visible=True)


def test_words_explain_themselves_on_hover_focus_and_touch(visit):
    page = visit("?mu=0.1&n=30&states=30&relax=nearest", reduced_motion="reduce")
    page.get_by_role("button", name="More controls").click()
    page.get_by_text("In numbers").click()
    tile = page.locator(".tile[data-term=h]")
    tile.hover()
    hint(page).get_by_text(TERMS["h"].sentence).wait_for()
    page.mouse.move(640, 500)
    hint(page).wait_for(state="hidden")
    page.locator(".tile[data-term=h]").focus()
    page.keyboard.press("Tab")
    hint(page).get_by_text(TERMS["eta1"].sentence).wait_for()
    page.keyboard.press("Escape")
    hint(page).wait_for(state="hidden")
    how_it_is_made(page).get_by_role("combobox", name="Relaxation").hover()
    hint(page).get_by_text(TERMS["nearest"].sentence).wait_for()


def test_a_finger_on_a_word_explains_it(visit):
    page = visit(
        "?mu=0.1&n=30&states=30&relax=nearest", 390, 844, has_touch=True, reduced_motion="reduce"
    )
    page.get_by_role("button", name="More controls").tap()
    page.get_by_text("In numbers").tap()
    page.locator(".tile[data-term=eta1]").tap()
    hint(page).get_by_text(TERMS["eta1"].sentence).wait_for()
    box = hint(page).bounding_box()
    assert box["x"] >= 0 and box["x"] + box["width"] <= 390
