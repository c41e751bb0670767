// Known forces as chips, their effect in words, the sampler, and the contact most worth measuring.

import { ask } from "../../../browser/send.js"
import { button, createElement } from "../../../browser/dom.js"

export function render({ model, view }) {
  const root = document.createElement("div")
  root.className = "known"
  root.innerHTML = `
    <div class="chips"></div><div class="words" role="status"></div>
    <label data-term="s">Networks from <select></select></label>
    <button type="button" class="soft next">Which force to measure next?</button><p class="meaning"></p><ol class="ranked"></ol>`
  const [chips, words, label, next, meaning, ranked] = root.children, select = label.lastElementChild
  const tell = (message) => ask(model, view, message)
  const close = button("×", () => tell({ dismiss: true }), { className: "soft", title: "remove the list and its numbers in the packing" })
  meaning.after(close)

  /** Mark a contact in the packing; null: the selected one. */
  const point = (contact) => view.model.document.get_model_by_name("player")?.player?.mark(contact)

  function chip([contact, text]) {
    const item = createElement("span", { className: "chip" })
    const look = { className: "release", title: "release it", ariaLabel: `release: ${text}` }
    item.append(
      button(text, () => tell({ choose: contact }), { title: "find it in the packing" }),
      button("×", () => tell({ release: contact }), look),
    )
    return item
  }

  function row([contact, text]) {
    const item = document.createElement("li")
    item.append(button(text, () => tell({ choose: contact })))
    return item
  }

  const shown = {
    chips: () => chips.replaceChildren(...model.chips.map(chip)),
    words: () => { words.innerHTML = model.words },
    meaning: () => { meaning.textContent = model.meaning },
    ranked: () => { ranked.replaceChildren(...model.ranked.map(row)); close.hidden = !model.ranked.length },
    asking: () => { next.disabled = model.asking },
    samplers: () => select.replaceChildren(...model.samplers.map(([value, textContent]) => createElement("option", { value, textContent }))),
    sampler: () => { select.value = model.sampler },
  }
  select.addEventListener("change", () => tell({ sampler: select.value }))
  next.addEventListener("click", () => tell({ next: true }))
  words.addEventListener("click", ({ target: { dataset } }) => {
    if (dataset.contact) tell({ choose: Number(dataset.contact) })
    if ("sample" in dataset) tell({ sample: true })
  })
  words.addEventListener("pointerover", ({ target }) => { if (target.dataset.contact) point(Number(target.dataset.contact)) })
  words.addEventListener("pointerout", () => point(null))
  for (const [name, show] of Object.entries(shown)) { model.on(name, show); show() }
  return root
}
