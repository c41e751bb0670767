// Numbers in a line that opens tables; buttons in it compute the volume of S, or more networks.

import { ask } from "../browser/send.js"
import { createElement } from "../browser/dom.js"

export function render({ model, view }) {
  const root = createElement("section", { className: "results", ariaLabel: "Results" })
  const show = () => {
    root.innerHTML = model.html
    root.classList.toggle("open", model.open)
    const fold = root.querySelector(".fold")
    if (fold) {
      fold.textContent = model.open ? "fewer ▾" : "tables ▴"
      fold.ariaExpanded = String(model.open)
    }
  }
  root.addEventListener("click", ({ target }) => {
    const pressed = target.closest("button")
    if (pressed?.matches(".fold")) model.open = !model.open
    else if (pressed?.matches(".more")) ask(model, view, { more: true })
    else if (pressed) ask(model, view, { measure: true })
  })
  model.on(["html", "open"], show)
  show()
  return root
}
