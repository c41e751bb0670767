"""What somebody sees who was never here: a page that moves, a tour, words that are explained."""

from functools import partial

import pytest
from serving import how_it_is_made, scene, until

from app.learn.small_scene import FIRST_STEPS
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


# The tour


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
