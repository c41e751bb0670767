// Pictures side by side, one of which is clicked.

import { ask } from "./ask.js"
import { made } from "./made.js"

export function render({ model, view }) {
  const root = made("div", { className: "glimpses" })

  function show() {
    root.replaceChildren(...model.items.map(([picture, words], k) => {
      const button = made("button", { type: "button", className: "soft", innerHTML: `${picture}<span>${words}</span>` })
      button.addEventListener("click", () => ask(model, view, { pick: k }))
      return button
    }))
  }

  model.on("items", show)
  show()
  return root
}
