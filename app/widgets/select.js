// A choice from the browser's own list, which every keyboard and screen reader supports.

import { createElement } from "../browser/dom.js"

export function render({ model }) {
  const root = createElement("fieldset", { className: "choice", role: "presentation" })
  const legend = createElement("legend", { className: "name", ariaHidden: "true" }), list = document.createElement("select")
  root.append(legend, list)

  function show() {
    const options = model.options instanceof Map ? [...model.options] : Object.entries(model.options)
    legend.textContent = list.ariaLabel = model.label
    list.replaceChildren(...options.map(([words, value]) => new Option(words, value)))
    list.value = model.value
  }

  let clicked = false // not reached by keyboard, whose user continues there
  list.addEventListener("pointerdown", () => { clicked = true })
  list.addEventListener("keydown", () => { clicked = false })
  list.addEventListener("change", () => {
    model.value = list.value
    if (clicked) list.blur() // Space and arrows control the player again, see buttons.js
  })
  model.on(["label", "options", "value"], show)
  show()
  return root
}
