// What is known, as chips; what it leaves open, in words; and which contact would be worth measuring.

import { ask } from "./ask.js"

export function render({ model, view }) {
  const root = document.createElement("div")
  root.className = "known"
  root.innerHTML = `
    <div class="chips"></div><div class="words" role="status"></div>
    <button type="button" class="soft next">Which force to measure next?</button><ol class="ranked"></ol>`
  const [chips, words, next, ranked] = root.children
  const tell = (message) => ask(model, view, message)

  function chip([contact, text]) {
    const made = document.createElement("span")
    made.className = "chip"
    const choose = made.appendChild(document.createElement("button"))
    const release = made.appendChild(document.createElement("button"))
    choose.type = release.type = "button"
    choose.textContent = text
    choose.title = "find it in the packing"
    release.textContent = "×"
    release.className = "release"
    release.title = "let it go"
    release.setAttribute("aria-label", `let go: ${text}`)
    choose.addEventListener("click", () => tell({ choose: contact }))
    release.addEventListener("click", () => tell({ release: contact }))
    return made
  }

  function row([contact, text]) {
    const made = document.createElement("li"), choose = made.appendChild(document.createElement("button"))
    choose.type = "button"
    choose.textContent = text
    choose.addEventListener("click", () => tell({ choose: contact }))
    return made
  }

  const shown = {
    chips: () => chips.replaceChildren(...model.chips.map(chip)),
    words: () => { words.innerHTML = model.words },
    ranked: () => ranked.replaceChildren(...model.ranked.map(row)),
    asking: () => { next.disabled = model.asking },
  }
  next.addEventListener("click", () => tell({ next: true }))
  for (const [name, show] of Object.entries(shown)) { model.on(name, show); show() }
  return root
}
