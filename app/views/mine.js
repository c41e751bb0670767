// What was computed here: a name to be typed, what it is, when, how large; to be opened or deleted.

import { ask } from "./ask.js"
import { plain } from "./plain.js"

export function render({ model, view }) {
  const root = document.createElement("details")
  root.innerHTML = `<summary>My computations</summary><p class="told"></p><table><tbody></tbody></table>`
  const told = root.querySelector(".told"), body = root.querySelector("tbody")
  const size = (megabytes) => `${megabytes < 10 ? megabytes.toFixed(1) : Math.round(megabytes)} MB`

  function button(words, act) {
    const made = Object.assign(document.createElement("button"), { type: "button", className: "soft", textContent: words })
    made.addEventListener("click", () => act(made))
    return made
  }

  /** Only a second click deletes. */
  function remove(entry, made) {
    if (made.dataset.sure) return ask(model, view, { delete: entry })
    made.dataset.sure = "yes"
    made.textContent = "Delete for good?"
  }

  function line({ entry, name, what, when, megabytes, here }) {
    const row = document.createElement("tr"), field = document.createElement("input")
    Object.assign(field, { value: name, placeholder: "name it", ariaLabel: `name of ${what}`, maxLength: 80 })
    field.addEventListener("change", () => ask(model, view, { call: [entry, field.value] }))
    const words = document.createElement("span")
    words.textContent = what
    const last = here ? ["on screen"] : [button("Open", () => ask(model, view, { open: entry }))]
    last.push(" ", button("Delete", (made) => remove(entry, made)))
    const parts = [[field, words], [new Date(when).toLocaleString([], { dateStyle: "medium", timeStyle: "short" })],
      [size(megabytes)], last]
    for (const part of parts) row.insertCell().append(...part)
    return row
  }

  function show() {
    const rows = model.rows.map(plain), all = rows.reduce((sum, { megabytes }) => sum + megabytes, 0)
    told.textContent = rows.length
      ? `${rows.length} computed here, ${size(all)} with their packings. They stay until you delete them.`
      : "Nothing yet: another friction, number of disks or seed is computed and kept here."
    body.replaceChildren(...rows.map(line))
  }

  model.on("rows", show)
  show()
  return root
}
