// Numbers as tables; the only button computes the volume of S.

import { ask } from "../browser/send.js"
import { createElement } from "../browser/dom.js"

export function render({ model, view }) {
  const root = createElement("section", { className: "results", ariaLabel: "Results" })
  const show = () => { root.innerHTML = model.html }
  root.addEventListener("click", (event) => { if (event.target.closest("button")) ask(model, view, { measure: true }) })
  model.on("html", show)
  show()
  return root
}
