// Numbers in a line that opens tables; one of its buttons computes the volume of S.

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
    if (target.closest(".fold")) model.open = !model.open
    else if (target.closest("button")) ask(model, view, { measure: true })
  })
  model.on(["html", "open"], show)
  show()
  return root
}
