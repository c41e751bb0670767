"""The keyboard focus on the app's pages after a button that has it disappears."""

from serving import how_it_is_made, until

# The element with the focus, inside any shadow root.
FOCUSED = """() => {
    let node = document.activeElement
    while (node.shadowRoot?.activeElement) node = node.shadowRoot.activeElement
    return node"""


def press(page, name):
    """Press a button by keyboard."""
    button = page.get_by_role("button", name=name).filter(visible=True).first
    button.focus()
    page.keyboard.press("Enter")


def focus_is_at(page, condition):
    page.wait_for_function(f"{FOCUSED}{condition} }}")


def test_buttons_of_a_chapter_pass_the_focus_on(opening):
    page = opening("?learn=groove", 1280, 900)
    page.get_by_role("slider", name="your prediction").focus()
    page.keyboard.press("ArrowRight")
    press(page, "That is my prediction")
    focus_is_at(page, ".role === 'slider'")
    for _ in range(60):
        page.keyboard.press("ArrowRight")
    press(page, "Again")
    focus_is_at(page, ".tagName === 'H1'")
    press(page, "Next")
    focus_is_at(page, ".textContent === 'How much can the floor carry?'")


def test_undo_of_the_builder_passes_the_focus_on(opening):
    page = opening("?scene=own", 1280, 900)
    page.locator(".count b").filter(has_text="free number").wait_for()
    page.get_by_role("radio", name="Pressure").click()
    page.locator(".count").filter(has_text="+ 2").wait_for()
    press(page, "Undo")
    page.get_by_role("button", name="Undo").and_(page.locator(":disabled")).wait_for()
    focus_is_at(page, ".textContent === 'Test push'")


def test_cancel_passes_the_focus_on(visit):
    page = visit()
    how_it_is_made(page).get_by_label("Disks N").first.fill("8100")
    page.get_by_label("Disks N").first.press("Enter")
    press(page, "Cancel")
    until(page, "!scene.hand.player.model.requested")
    focus_is_at(page, " !== document.body && node.textContent !== 'Cancel'")
