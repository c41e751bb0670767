// A button that copies a text, or the address of the page, and confirms it briefly.

import { button } from "../browser/dom.js"
import { copy } from "../browser/clipboard.js"

export function render({ model }) {
  const tell = (text) => { root.textContent = text }
  const root = button(model.label, async () => {
    await copy(model.text || window.location.href)
    tell("copied ✓")
    setTimeout(() => tell(model.label), 1500)
  }, { className: "soft" })
  model.on("label", () => tell(model.label))
  return root
}
