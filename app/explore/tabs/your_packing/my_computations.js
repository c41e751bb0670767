// Stored computations: name, kind, time, size; to open or delete.

import { ask, plain } from "../../../browser/send.js"
import { button, createElement } from "../../../browser/dom.js"

export function render({ model, view }) {
  const root = document.createElement("details")
  root.innerHTML = `<summary>My computations</summary><p class="status"></p><table><tbody></tbody></table>`
  const statusLine = root.querySelector(".status"), body = root.querySelector("tbody")
  const size = (megabytes) => `${megabytes < 10 ? megabytes.toFixed(1) : Math.round(megabytes)} MB`

  /** Delete only at a second click. */
  function remove(entry, element) {
    if (element.dataset.sure) return ask(model, view, { delete: entry })
    element.dataset.sure = "yes"
    element.textContent = "Delete permanently?"
  }

  function line({ entry, name, what, when, megabytes, shown }) {
    const row = document.createElement("tr"), look = { className: "soft" }
    const field = createElement("input", { value: name, placeholder: "name it", ariaLabel: `name of ${what}`, maxLength: 80 })
    field.addEventListener("change", () => ask(model, view, { entry, name: field.value }))
    const words = createElement("span", { textContent: what })
    const last = shown ? ["on screen"] : [button("Open", () => ask(model, view, { open: entry }), look)]
    last.push(" ", button("Delete", (element) => remove(entry, element), look))
    const parts = [[field, words], [new Date(when).toLocaleString([], { dateStyle: "medium", timeStyle: "short" })],
      [size(megabytes)], last]
    for (const part of parts) row.insertCell().append(...part)
    return row
  }

  function show() {
    const rows = model.rows.map(plain), all = rows.reduce((sum, { megabytes }) => sum + megabytes, 0)
    statusLine.textContent = rows.length
      ? `${rows.length} computed here, ${size(all)} with their packings. They stay until you delete them.`
      : "Nothing yet. Results for another friction, number of disks or seed are computed and kept here."
    body.replaceChildren(...rows.map(line))
  }

  model.on("rows", show)
  show()
  return root
}
