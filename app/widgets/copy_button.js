// A button that copies a text, or the address of the page, and says so for a moment.

import { button, made } from "../browser/dom.js"

export function render({ model }) {
  const tell = (text) => { root.textContent = text }
  // Browsers offer a clipboard to pages of this machine and of https only.
  async function copy(text) {
    if (navigator.clipboard) return navigator.clipboard.writeText(text)
    const area = made("textarea", { value: text })
    document.body.append(area)
    area.select()
    document.execCommand("copy")
    area.remove()
  }
  const root = button(model.label, async () => {
    await copy(model.text || window.location.href)
    tell("copied ✓")
    setTimeout(() => tell(model.label), 1500)
  }, { className: "soft" })
  model.on("label", () => tell(model.label))
  return root
}
