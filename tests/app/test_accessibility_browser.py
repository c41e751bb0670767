"""The page judged by axe, the usual automatic check of accessibility: nothing serious is found."""

import pytest
from serving import at_rest, expect, how_it_is_made, scales, until

axe = pytest.importorskip("axe_playwright_python.sync_playwright")

GRAVE = ("serious", "critical")
NAMED = {"rules": {"label-content-name-mismatch": {"enabled": True}}}  # not among the usual rules
TABS = {
    "intervals": "Intervals",
    "statistics": "Friction",
    "plane": "Force space",
    "perturb": "Push",
    "upload": "Your packing",
    "export": "Export",
}


def findings(page):
    """Serious and critical violations, one line for each element."""
    found = axe.Axe().run(page, options=NAMED).response["violations"]
    return [
        f"{rule['id']} ({rule['impact']}): {node['target']} {node['html'][:120]}"
        for rule in found
        if rule["impact"] in GRAVE
        for node in rule["nodes"]
    ]


@pytest.fixture
def visit(visit):
    """The same once all of it has come."""

    def whole(query="", width=1280, height=1000):
        page = visit(query, width, height)
        page.wait_for_function("() => !document.querySelector('.pn-loading')")
        page.get_by_text("bounds").first.wait_for()
        return page

    return whole


@pytest.mark.parametrize("dark", [0, 1])
def test_no_tab_has_a_serious_finding(visit, dark):
    page = visit(f"?dark={dark}")
    for tab, title in TABS.items():
        page.get_by_role("tab", name=title).click()
        page.locator(f".in-{tab} *").filter(visible=True).first.wait_for()
        if tab == "statistics":
            page.get_by_text("Maxima, the paper’s walk").wait_for()
        page.wait_for_function("() => !document.querySelector('.pn-loading')")
        assert findings(page) == [], title


def test_nothing_serious_while_something_is_computed_and_lists_are_open(visit):
    page = visit()
    scales(page).get_by_role("combobox", name="Colour").click()
    how_it_is_made(page).get_by_label("Disks N").first.fill("9000")
    page.get_by_label("Disks N").first.press("Enter")
    page.get_by_role("button", name="Cancel").filter(visible=True).first.wait_for()
    assert findings(page) == []
    page.get_by_role("button", name="Cancel").filter(visible=True).first.click()
    until(page, "!scene.hand.player.model.requested")
    expect(page.get_by_label("Disks N").first).to_have_value("30")


def test_a_narrow_page_and_its_help_have_no_serious_finding(visit):
    page = visit("", 390)
    assert findings(page) == []
    page.get_by_role("button", name="Help and keys").click()
    help = page.get_by_role("dialog")
    help.get_by_text("play; pause at the nearest network").wait_for()
    page.wait_for_function("e => e.scrollHeight > e.clientHeight", arg=help.element_handle())
    assert help.evaluate("e => e.scrollTop") == 0
    expect(help.get_by_role("button", name="Close")).to_be_in_viewport(ratio=1)
    assert findings(page) == []


@pytest.mark.parametrize(
    "query", ["?learn", "?learn=thirteen", "?learn=box", "?scene=box", "?scene=own"]
)
def test_no_chapter_or_scene_has_a_serious_finding(opening, query):
    page = opening(query, 390, 900)
    whole = page.locator(".course, .bench")
    page.locator("article strong, .count b").first.wait_for()
    assert findings(page) == []
    page.set_viewport_size({"width": 1280, "height": 900})
    at_rest(whole)
    assert findings(page) == []
