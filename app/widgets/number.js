// A field for a whole number: typed, or changed by arrow keys and the two buttons.

import { ask } from "../browser/send.js"

export function render({ model, view }) {
  const root = document.createElement("div")
  root.className = "number"
  root.innerHTML = `
    <span class="name"></span>
    <span class="row">
      <button type="button" tabindex="-1" aria-hidden="true" class="less">−</button>
      <input role="spinbutton" inputmode="numeric" autocomplete="off" spellcheck="false">
      <button type="button" tabindex="-1" aria-hidden="true" class="more">+</button>
    </span>`
  const part = (name) => root.querySelector(name), field = part("input")

  const show = () => {
    field.value = String(model.value)
    field.ariaValueNow = field.value
  }

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
  part(".less").addEventListener("click", () => add(-model.step))
  part(".more").addEventListener("click", () => add(model.step))

  const dress = () => {
    part(".name").textContent = field.ariaLabel = model.label
    field.ariaValueMin = String(model.start)
    field.ariaValueMax = String(model.end)
    field.disabled = part(".less").disabled = part(".more").disabled = model.disabled
  }
  model.on("value", show)
  for (const name of ["label", "disabled"]) model.on(name, dress)
  dress()
  show()
  return root
}
