// A field for a whole number: typed, or changed by arrow keys and the two buttons.

import { ask } from "../browser/send.js"
import { button, createElement } from "../browser/dom.js"

export function render({ model, view }) {
  const name = createElement("span", { className: "name" }), row = createElement("span", { className: "row" })
  const root = createElement("div", { className: "number" })
  const field = createElement("input", { role: "spinbutton", inputMode: "numeric", autocomplete: "off", spellcheck: false })
  const [less, more] = [["−", -1], ["+", 1]].map(([sign, way]) => button(sign, () => add(way * model.step), { tabIndex: -1, ariaHidden: "true" }))
  row.append(less, field, more)
  root.append(name, row)

  const show = () => { field.value = field.ariaValueNow = String(model.value) }

  function take() {
    const text = field.value.trim(), number = Number(text)
    const fits = text !== "" && Number.isInteger(number) && number >= model.start && number <= model.end
    if (!fits) {
      ask(model, view, { typed: text })
      show()
    } else if (number !== model.value) model.value = number
  }

  function add(step) {
    field.value = String(Math.min(model.end, Math.max(model.start, model.value + step)))
    take()
  }

  field.addEventListener("change", take)
  field.addEventListener("keydown", (event) => {
    const way = { ArrowUp: 1, ArrowDown: -1 }[event.key]
    if (!way) return
    event.preventDefault()
    take()
    add(way * model.step)
  })

  const dress = () => {
    name.textContent = field.ariaLabel = model.label
    field.ariaValueMin = String(model.start)
    field.ariaValueMax = String(model.end)
    field.disabled = less.disabled = more.disabled = model.disabled
  }
  model.on("value", show)
  model.on("disabled", dress)
  dress()
  show()
  return root
}
