// Slider for the push on a contact. Where it is moved, arrows in the packing grow and the network follows
// (pushed.js); it stops where the disks set off, which is not told before.

import { ask } from "./ask.js"

const STEPS = 400 // of the slider
const RISE_S = 5 // from nothing to the end, by the button
const ROOM = 1.25 // of the scale beyond its end, where it ends beyond the scale

export function render({ model, view }) {
  const root = document.createElement("div")
  root.className = "load"
  root.innerHTML = `<label>push <input type="range" min="0" value="0" aria-label="push, in mean forces"></label>
    <span><output></output> × mean force<b>: something moves</b></span>
    <button type="button" class="soft">Push until something moves</button>`
  const range = root.querySelector("input"), told = root.querySelector("output"), run = root.querySelector("button")
  const player = () => view.model.document.get_model_by_name("player")?.player
  const known = () => model.path.loads?.length > 0, end = () => (known() ? model.path.loads.at(-1) : Infinity)
  let load = 0, asked = false, gave = false, rising = 0, by = null // by: whom the load is shown by

  function set(value) {
    load = Math.min(value, end())
    if (load > 0 && !known() && !asked) {
      asked = true
      ask(model, view, { push: true })
    }
    show()
    if (load < end() || gave) return
    gave = true
    ask(model, view, { gave: true })
  }

  function show() {
    const there = load >= end()
    range.value = load
    told.textContent = load.toFixed(2)
    root.classList.toggle("there", there)
    range.setAttribute("aria-valuetext", `${told.textContent} mean forces${there ? ": something moves" : ""}`)
    run.disabled = model.contact === null || rising > 0
    by = player()?.pushed
    by?.take(model.contact, model.path, load, load / Number(range.max))
  }

  /** Another contact, or other networks. */
  function anew() {
    load = rising = 0
    asked = gave = false
    scale()
  }

  function scale() {
    range.max = known() ? Math.max(model.most, ROOM * end()) : model.most
    range.step = range.max / STEPS
    range.disabled = model.contact === null
    set(load)
  }

  /** By itself, as soon as it is known how far. */
  function rise() {
    anew()
    const way = rising = Math.random()
    if (!known()) { asked = true; ask(model, view, { push: true }) }
    let before = null
    const step = (now) => {
      if (way !== rising || !root.isConnected) return
      if (known()) {
        set(load + ((before === null ? 0 : now - before) / 1000 / RISE_S) * end())
        before = now
        if (load >= end()) { rising = 0; return show() }
      }
      requestAnimationFrame(step)
    }
    requestAnimationFrame(step)
    show()
  }

  range.addEventListener("input", () => { rising = 0; set(Number(range.value)) })
  range.addEventListener("change", () => by?.leave())
  run.addEventListener("click", rise)
  model.on("contact", anew)
  model.on("most", scale)
  model.on("path", () => { asked = known(); scale() })
  model.on("running", () => { if (!model.running && !known()) { asked = false; rising = 0; show() } })
  scale()
  return root
}
