"""The keyboard focus after its element is removed, hidden or disabled: by the script alone."""

import pytest

FOCUS = """async ({ keepFocus }, { loss, html }) => {
    const host = document.createElement("div")
    host.innerHTML = '<h1 tabindex="-1">Heading</h1><div class="component"></div>'
    document.body.replaceChildren(host)
    const root = host.querySelector(".component").attachShadow({ mode: "open" })
    root.innerHTML = html
    const leave = keepFocus(), lost = root.querySelector(".lost")
    const frame = () => new Promise((done) => requestAnimationFrame(done))
    lost.focus()
    lost.dispatchEvent(new KeyboardEvent("keydown", { bubbles: true, composed: true }))
    if (loss === "removed") lost.remove()
    else lost[loss] = true
    const place = () => root.activeElement?.className ?? document.activeElement.tagName
    for (let k = 0; k < 600 && ["BODY", "lost"].includes(place()); k++) await frame()
    leave()
    return place()
}"""
BUTTONS = "<p><button class='first'></button><button class='lost'></button>{}</p>"


@pytest.mark.parametrize("loss", ["removed", "hidden", "disabled"])
@pytest.mark.parametrize(
    "html, place",
    [
        ("<p><button class='lost'></button><button class='next'></button></p>", "next"),
        (BUTTONS.format("<button disabled></button><input type='text'>"), "first"),
        ("<p><button class='lost'></button></p>", "H1"),
    ],
)
def test_the_focus_moves_to_a_neighbour_or_the_heading(run, loss, html, place):
    assert run("browser/kept_focus", FOCUS, loss=loss, html=html) == place


def test_a_click_elsewhere_removes_the_focus(run):
    script = FOCUS.replace("lost[loss] = true", "lost.blur()").replace("k < 600", "k < 30")
    html = BUTTONS.format("<button class='next'></button>")
    assert run("browser/kept_focus", script, loss="blur", html=html) == "BODY"
