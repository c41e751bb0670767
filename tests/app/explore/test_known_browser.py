"""In a browser: forces are held, intervals shrink, stresses."""

import pytest
from serving import MODEL, column, expect, painted, picture, scene, until


def select(page, contact):
    """Select a contact as a click on its chain does."""
    page.locator(".scene").evaluate("(e, c) => e.scene.onSelect(c)", contact)
    page.locator(".stage.chosen").wait_for()


def chips(page, count):
    """Wait for so many chips, and for what they leave open."""
    if not count:
        page.get_by_text("other intervals shrink").wait_for()
        return
    page.locator(".known .chip").nth(count - 1).wait_for()
    page.locator(".known .chip").nth(count).wait_for(state="detached")
    page.locator(".known .words", has_text="on average").wait_for()


def span(page, name):
    """Sum of the intervals that the plot shows: exact, or whole, without what is known."""
    low, high = (column(page, "bars", f"{name}_{side}") for side in ("low", "high"))
    return sum(high) - sum(low)


def test_held_forces_are_pinned_narrow_the_rest_and_survive_a_reload(visit):
    page = visit()
    select(page, 4)
    page.keyboard.press("Space")
    until(page, "scene.hand.player.playing")
    page.keyboard.press("h")
    chips(page, 1)
    assert not scene(page, "scene.hand.player.playing")  # it rests at a network with this force
    held = scene(page, "scene.hand.player.pins.heldAt(4)")
    assert float(page.locator("input.force").input_value()) == pytest.approx(held, abs=6e-4)
    assert scene(page, "scene.mixed.normal[4]") == pytest.approx(held, abs=1e-6)
    whole = f"{MODEL}('bars')?.get_column('whole_low')"
    page.wait_for_function(f"() => {whole}?.every(Number.isFinite)")
    assert span(page, "exact") < 0.99 * span(page, "whole")
    page.get_by_text("All contacts as a table").click()
    page.locator("tr[data-contact]").nth(3).wait_for()
    groups, headings = page.locator(".frame thead tr").all()
    expect(groups).to_contain_text("exact")
    expect(groups).to_contain_text("seen")
    cut = "e => [...e.querySelectorAll('button')].some((b) => b.scrollWidth > b.clientWidth)"
    assert headings.inner_text().split().count("ΔFₙ") == 2 and not headings.evaluate(cut)
    cells = page.locator("tr[data-contact='4'] td").all_inner_texts()
    assert cells[4] == cells[5] == cells[2] and cells[6] == "0.000"  # held: no interval is left
    assert float(cells[9]) > 0 and cells[0].endswith(" held") and len(cells) == 10
    select(page, 9)
    page.locator("input.uncertainty").fill("0.2")
    page.locator("button.hold").click()
    chips(page, 2)
    picture(page, "known/held")
    page.wait_for_url("**hold=4*~9*")
    page.reload()
    painted(page)
    chips(page, 2)
    assert scene(page, "scene.hand.player.pins.has(9)")
    page.locator(".chip .release").first.click()
    chips(page, 1)
    select(page, 9)
    page.keyboard.press("h")
    chips(page, 0)
    whole = f"{MODEL}('bars')?.get_column('whole_low')"
    page.wait_for_function(f"() => {whole}?.every(Number.isNaN)")


def test_contacts_worth_measuring_are_numbered(visit):
    page = visit()
    asking = page.get_by_role("button", name="Which force to measure next?")
    asking.click()
    page.locator(".ranked li").first.wait_for()
    page.get_by_text("mean interval").first.wait_for()
    assert scene(page, "scene.hand.player.pins.pins.ranked.length") == 10
    page.locator(".ranked button").first.click()
    page.locator(".stage.chosen").wait_for()
    picture(page, "known/next")
