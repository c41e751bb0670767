// A button that opens and closes the content below it.

import { button } from "../browser/dom.js"

export function render({ model }) {
  const root = button("", () => { model.open = !model.open })
  const show = () => {
    root.textContent = `${model.line} ${model.open ? "▾" : "▸"}`
    root.ariaExpanded = String(model.open)
  }
  model.on(["line", "open"], show)
  show()
  return root
}
