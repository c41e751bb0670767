"""The page judged by axe, the usual automatic check of accessibility: nothing serious is found."""

import pytest
from serving import MANY, how_it_is_made, looks, painted

axe = pytest.importorskip("axe_playwright_python.sync_playwright")

PATIENCE = 60_000  # ms, on a busy machine
GRAVE = ("serious", "critical")
TABS = {
    "intervals": "How far?",
    "statistics": "Friction",
    "plane": "Force space",
    "perturb": "Push",
    "upload": "Your packing",
    "export": "Export",
}

pytestmark = pytest.mark.browser


def findings(page):
    """Serious and critical violations, one line for each element."""
    found = axe.Axe().run(page).response["violations"]
    return [
        f"{rule['id']} ({rule['impact']}): {node['target']} {node['html'][:120]}"
        for rule in found
        if rule["impact"] in GRAVE
        for node in rule["nodes"]
    ]


def opened(chromium, address, query, width):
    page = chromium.new_page(viewport={"width": width, "height": 1000})
    page.set_default_timeout(PATIENCE)
    page.goto(address + (query or MANY))
    painted(page, PATIENCE)
    page.locator("[role=tab]").first.wait_for(state="attached")
    page.wait_for_function("() => !document.querySelector('.pn-loading')")
    if width > 900:  # else the sidebar is closed
        page.get_by_text("Copy link").wait_for(state="attached")
    return page


@pytest.mark.parametrize("dark", [0, 1])
def test_no_tab_has_a_serious_finding(chromium, address, dark):
    page = opened(chromium, address, f"?dark={dark}", 1280)
    for tab, title in TABS.items():
        page.get_by_role("tab", name=title).click()
        page.locator(f".in-{tab} *").filter(visible=True).first.wait_for()
        if tab == "statistics":
            page.get_by_text("How undetermined the forces are").wait_for()
        page.wait_for_function("() => !document.querySelector('.pn-loading')")
        assert findings(page) == [], title
    page.context.close()


def test_nothing_serious_while_something_is_computed_and_lists_are_open(chromium, address):
    page = opened(chromium, address, "", 1280)
    looks(page).get_by_role("combobox", name="Colour").click()
    how_it_is_made(page).get_by_label("Disks N").first.fill("9000")
    page.get_by_label("Disks N").first.press("Enter")
    page.get_by_text("Pale: still of").wait_for()
    assert findings(page) == []
    page.get_by_role("button", name="Cancel").filter(visible=True).first.click()
    page.get_by_text("Pale: still of").wait_for(state="hidden")
    page.context.close()


def test_the_tour_and_a_narrow_page_have_no_serious_finding(chromium, address):
    page = opened(chromium, address, "?tour=2", 390)
    page.get_by_role("dialog").wait_for()
    assert findings(page) == []
    page.context.close()


@pytest.mark.parametrize("query", ["?scene=groove&tour=1", "?scene=box", "?scene=own"])
@pytest.mark.parametrize("width", [390, 1280])
def test_no_scene_has_a_serious_finding(chromium, address, query, width):
    page = chromium.new_page(viewport={"width": width, "height": 900})
    page.set_default_timeout(PATIENCE)
    page.goto(address + query)
    desk = page.locator(".desk")
    desk.wait_for()
    page.wait_for_function("e => e.painted > 0", arg=desk.element_handle())
    assert findings(page) == []
    page.context.close()
