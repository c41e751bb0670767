// Sentences under a line that opens them: told anew as they change, and what was opened stays open.

import { made } from "../browser/dom.js"

export function render({ model }) {
  const more = document.createElement("details"), inside = document.createElement("div")
  more.append(made("summary", { textContent: model.line }), inside)
  const tell = () => {
    inside.innerHTML = model.inside
    more.hidden = !model.inside
  }
  more.addEventListener("toggle", () => { model.open = more.open })
  model.on("inside", tell)
  tell()
  return more
}
