// Slider for the push on a contact. As it moves, arrows in the packing grow and the network follows
// (push_animation.js); it stops where the packing starts to move, at the critical force.

import { ask } from "../../../browser/send.js"

const STEPS = 400 // of the slider
const RISE_S = 5 // from zero to the end, by the button
const ROOM = 1.25 // of the scale beyond the limit load, for its label
const TICKS = 8 // approximate number of ticks
const THUMB = 8 // px from the slider's ends to the centre of its thumb there

export function render({ model, view }) {
  const root = document.createElement("div")
  root.className = "load"
  root.innerHTML = `<label>push <span class="rail"><input type="range" min="0" value="0" aria-label="push, in mean forces">
      <span class="scale"></span></span></label>
    <span class="status"><output></output> × mean force<b></b></span>
    <button type="button" class="soft">Find F<sub>crit</sub>: increase the push</button>`
  const part = (name) => root.querySelector(name), range = part("input"), output = part("output"), run = part("button"), line = part(".scale")
  const player = () => view.model.document.get_model_by_name("player")?.player
  const known = () => model.path.values?.length > 0, end = () => (known() ? model.path.values.at(-1) : Infinity)
  let load = 0, requested = false, reached = false, rises = 0, rising = 0, owner = null, shows = false // owner: of the shown load

  function find() {
    if (known() || requested) return
    requested = true
    ask(model, view, { push: true })
  }

  function set(value) {
    const top = end()
    load = value > top - Number(range.step) / 2 ? top : value // the last step may be rounded away
    if (load > 0) find()
    show()
    if (load < end() || reached) return
    reached = true
    ask(model, view, { reached: true })
  }

  /** If a network other than the pushed one is shown, end the push. */
  function look() {
    if (shows || !(load > 0 && known()) || (owner.held && player().replay?.held === owner.held)) return
    owner.end()
    load = rising = 0
    show()
  }

  function show() {
    const note = load >= end() ? ": the packing starts to move" : ""
    range.value = load
    output.textContent = load.toFixed(2)
    part("b").textContent = note
    range.setAttribute("aria-valuetext", `${output.textContent} mean forces${note}`)
    run.hidden = known() && !rising
    run.disabled = model.contact === null || rising > 0
    player()?.listeners.add(look)
    owner = player()?.pushed
    shows = true
    owner?.take(model.path, load, load / most(), model.limit)
    shows = false
  }

  /** Another contact, or other networks. */
  function anew() {
    load = rising = 0
    requested = reached = false
    scale()
  }

  /** End of the scale; the slider ends where the packing starts to move. */
  const most = () => (known() ? ROOM * Math.max(end(), model.limit) : model.most)

  function scale() {
    range.max = known() ? end() : model.most
    range.step = range.max / STEPS
    range.style.width = `calc(${2 * THUMB}px + (100% - ${2 * THUMB}px) * ${range.max / most()})`
    range.disabled = model.contact === null
    drawScale()
    set(load)
  }

  const along = (value) => `calc(${THUMB}px + (100% - ${2 * THUMB}px) * ${value / most()})`
  const mark = (kind, value, words) => `<span class="${kind}" style="left:${along(value)}">${words}</span>`

  /** Numbers, and the critical force once it is known. */
  function drawScale() {
    const top = most(), step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100].find((size) => top / size <= TICKS) ?? top
    let drawn = ""
    for (let k = 0; k * step <= top * (1 + 1e-9); k++) drawn += mark("tick", k * step, Number((k * step).toPrecision(3)))
    if (known()) drawn += mark("critical", end(), "▲ F<sub>crit</sub>") + mark("limit", model.limit, "▲ limit load")
    line.innerHTML = drawn
  }

  /** Rise automatically once the end is known. */
  function rise() {
    load = 0
    const way = ++rises
    rising = way
    find()
    let before = null
    const step = (now) => {
      if (way !== rising) return
      if (!root.isConnected || !player()?.pushable) return void (rising = 0)
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
  run.addEventListener("click", rise)
  model.on("remove", () => player()?.listeners.delete(look))
  model.on("contact", anew)
  model.on("most", scale)
  /** Show the end of a push that was not requested here: a link named it. */
  function reopen() {
    if (!root.isConnected || requested || !known()) return
    if (!player()?.pushed.possible) return void requestAnimationFrame(reopen)
    requested = true
    set(end())
  }

  model.on(["path", "limit"], () => {
    if (!known()) return anew() // of another packing
    scale()
    reopen()
  })
  model.on("running", () => { if (!model.running && !known()) { requested = false; rising = 0; show() } })
  scale()
  requestAnimationFrame(reopen)
  return root
}
