// A place to drop files, or to choose them by clicking. They are sent in pieces, which keeps each
// message below the server's limit; the server counts the bytes itself.

import { ask } from "../browser/send.js"
import { createElement } from "../browser/dom.js"

const PIECE = 4 * 1024 * 1024

export function render({ model, view }) {
  const root = createElement("label", { className: "drop", tabIndex: 0, innerHTML: `
    <svg viewBox="0 0 24 24" aria-hidden="true"><path d="M12 3l5 5h-3v6h-4V8H7zM4 17h16v4H4z"/></svg>
    <span></span><small role="status"></small><input type="file" multiple hidden>` })
  const [, what, status, input] = root.children
  const tell = (text) => { status.textContent = text }

  async function send(files) {
    const chosen = [...files], size = chosen.reduce((sum, file) => sum + file.size, 0)
    if (!chosen.length) return
    if (size > model.most) return tell(`these files have ${(size / 1e6).toFixed(1)} MB; at most ${model.most / 1e6} MB`)
    let sent = 0
    ask(model, view, { begin: true })
    for (const file of chosen) {
      for (let at = 0; at < file.size || at === 0; at += PIECE) {
        const data = await file.slice(at, at + PIECE).arrayBuffer()
        ask(model, view, { name: file.name, data })
        sent += data.byteLength
        tell(`sending … ${Math.round((100 * sent) / Math.max(1, size))} %`)
        await new Promise((resolve) => setTimeout(resolve))
      }
    }
    ask(model, view, { end: true })
    tell("")
  }

  input.addEventListener("change", () => { send(input.files); input.value = "" })
  root.addEventListener("keydown", (event) => {
    if (event.key === "Enter" || event.key === " ") { event.preventDefault(); event.stopPropagation(); input.click() }
  })
  for (const [name, over] of [["dragenter", true], ["dragover", true], ["dragleave", false], ["drop", false]]) {
    root.addEventListener(name, (event) => {
      event.preventDefault()
      root.classList.toggle("over", over)
      if (name === "drop") send(event.dataTransfer.files)
    })
  }
  what.textContent = model.label
  return root
}
