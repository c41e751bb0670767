// The tour's card at the lower edge of the page that it speaks of, beside or below that; large beside
// the packing while there is nothing else.

import { ask } from "../browser/send.js"
import { knows, remember } from "../browser/local_storage.js"

const LOOK_MS = 100 // between two looks for what a step is about, which may still be on its way
// Where each step points: other parts of the page than these come and go with their tab.
const TARGETS = { scene: ".scene", friction: ".friction", plane: ".in-plane", perturb: ".in-perturb" }
const ALONE = [1, 2] // steps of the packing alone

export function render({ model, view }) {
  const page = view.model.document
  const root = document.createElement("div")
  root.className = "tour"
  root.innerHTML = `
    <button type="button" class="begin">Tour</button>
    <section class="card" role="dialog" aria-labelledby="tour-title" aria-describedby="tour-text" hidden>
      <h2 id="tour-title" tabindex="-1"></h2>
      <p id="tour-text"></p>
      <div class="row">
        <span class="count"></span>
        <button type="button" class="earlier">Back</button>
        <button type="button" class="on">Next</button>
        <button type="button" class="close">Close</button>
      </div>
    </section>
    <div class="ring" hidden></div>`
  const part = (name) => root.querySelector(name), card = part(".card"), ring = part(".ring")
  let shown = 0, pointed = null // the step, and what it is about

  const target = () => model.steps[model.step - 1][2]
  const go = (step) => ask(model, view, { step })

  /** What a step does not speak of is not seen meanwhile, see parts.py. */
  function clear(step) {
    const { style } = document.documentElement
    if (step) style.setProperty("--extra", "none")
    else style.removeProperty("--extra")
    style.setProperty("--beside", ALONE.includes(step) ? "hidden" : "visible")
  }

  function show() {
    const { step } = model, steps = model.steps
    clear(step)
    card.hidden = !step
    card.classList.toggle("alone", ALONE.includes(step))
    part(".begin").hidden = Boolean(step)
    if (step !== shown) { ring.hidden = true; pointed = null }
    if (!step) { shown = 0; return }
    const [title, text] = steps[step - 1]
    part("h2").textContent = title
    part("p").textContent = text
    part(".count").textContent = `${step + model.before} of ${steps.length + model.before}`
    part(".on").textContent = step === steps.length ? "Finish" : "Next"
    if (step === shown) return
    shown = step
    remember("tour")
    play(step)
    requestAnimationFrame(() => part("h2").focus({ preventScroll: true })) // once the card is there
    point(target(), step)
  }

  /** The second step moves: that is what it says; from it on, the tour speaks of all that there is. */
  function play(step) {
    const player = page.get_model_by_name("player")?.player
    if (!player?.replay) return
    if (step > 1) player.later.offer()
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches
    if (step === 2 && !still) setTimeout(() => { if (model.step === 2) player.play(true) }, 400)
    else if (step !== 1) player.play(false)
  }

  const every = (root) => [...root.querySelectorAll("*")].flatMap(
    (e) => [e, ...(e.shadowRoot ? every(e.shadowRoot) : [])])

  /** What lies under the card can be scrolled to, see page.py. */
  function leaveRoom() {
    document.documentElement.style.setProperty("--card", `${card.offsetHeight}px`)
    if (shown) bringIntoView(pointed)
  }

  /** Bring what a step is about into view, as soon as it is there, and ring it while the step is on. */
  function point(name, step) {
    if (shown !== step) return
    const all = every(document), found = all.find((e) => e.matches(TARGETS[name]) &&
      e.offsetHeight && e.checkVisibility({ visibilityProperty: true }))
    if (!found) return void setTimeout(() => point(name, step), LOOK_MS)
    pointed = found
    encircle(found, all.find((e) => e.matches(".header")), step)
  }

  function bringIntoView(found) {
    if (!found?.isConnected) return
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches
    const block = { friction: "center", scene: "nearest" }[target()] ?? "start"
    found.scrollIntoView({ block, behavior: still ? "auto" : "smooth" })
  }

  /** The ring follows what it is around, over all that lies there, below the title. */
  function encircle(found, title, step, seen = 0) {
    if (shown !== step) return
    const tall = Math.max(seen, found.offsetHeight)
    if (tall > seen) bringIntoView(found) // again, where more of it has come
    if (!found.isConnected) { ring.hidden = true; return point(target(), step) }
    const box = found.getBoundingClientRect(), top = Math.max(box.top, title.getBoundingClientRect().bottom)
    const left = Math.max(box.left, 0), right = Math.min(box.right, window.innerWidth)
    const bottom = Math.min(box.bottom, window.innerHeight)
    ring.hidden = bottom <= top || right <= left
    card.style.setProperty("--beside-it", `${right}px`)
    Object.assign(ring.style, {
      left: `${left}px`, top: `${top}px`, width: `${right - left}px`, height: `${bottom - top}px`,
    })
    requestAnimationFrame(() => encircle(found, title, step, tall))
  }

  /** Before the first step are those of small scenes, on a page of their own. */
  function earlier() {
    if (model.step > 1) go(model.step - 1)
    else window.location.assign(`?scene=${model.scene}&tour=${model.before}`)
  }

  part(".begin").addEventListener("click", () => go(1))
  part(".earlier").addEventListener("click", earlier)
  part(".on").addEventListener("click", () => go(model.step === model.steps.length ? 0 : model.step + 1))
  part(".close").addEventListener("click", () => go(0))
  card.addEventListener("keydown", (event) => {
    if (event.key === "Escape") go(0)
    if (event.key === " " || event.key.startsWith("Arrow")) event.stopPropagation()
  })
  model.on("step", show)
  model.on("steps", show)
  const room = new ResizeObserver(leaveRoom) // also once a card that a link opens is on the page
  room.observe(card)
  model.on("remove", () => { shown = 0; clear(0); room.disconnect() })
  show()
  if (model.first && !model.step && !knows("tour")) go(1)
  return root
}
