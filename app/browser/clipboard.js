// The clipboard, which browsers offer only to pages of this machine and of https.

import { button, createElement } from "./dom.js"

const COPIED_MS = 1500 // for which a copy is confirmed

/** A button that copies text() and confirms it briefly. */
export function copyButton(label, text, look) {
  return button(label, async (it) => {
    await copy(text())
    it.textContent = "Copied ✓"
    setTimeout(() => { it.textContent = label }, COPIED_MS)
  }, look)
}

async function copy(text) {
  if (navigator.clipboard) return navigator.clipboard.writeText(text)
  const area = createElement("textarea", { value: text })
  document.body.append(area)
  area.select()
  document.execCommand("copy")
  area.remove()
}
