// Slider for μ on a logarithmic scale, with a position for 0 and a tick for every stored value.

import { button } from "../browser/dom.js"
import { ask } from "../browser/send.js"

const SNAP = 0.07 // decades within which the thumb jumps to a stored value

const HILL = 22 // px, height of the curve

const place = (mu, least) => (mu > 0 ? Math.max(least, Math.log10(mu)) : least)
const rounded = (mu) => Number(mu.toPrecision(2))

export function render({ model, view }) {
  const root = document.createElement("div")
  root.className = "friction"
  root.innerHTML = `
    <label for="mu" data-term="mu"><b>Friction μ</b><small></small></label>
    <div class="track">
      <div class="hill"></div>
      <div class="rail"><div class="ticks"></div>
        <input type="range" step="0.01" aria-label="logarithm of μ"></div>
      <div class="scale"></div>
    </div>
    <input id="mu" class="typed" inputmode="decimal" aria-label="μ">`
  const part = (name) => root.querySelector(`.${name}`)
  const range = root.querySelector("[type=range]"), typed = part("typed")

  const along = (at) => `calc(8px + (100% - 16px) * ${(at - model.least) / (model.most - model.least)})`
  /** Request a μ; without a server, the page that reloads later does, see connection_lost.js. */
  function wish(mu) {
    view.model.data.wish = mu
    model.mu = mu
  }
  const value = (at) => (at <= model.least + SNAP ? 0 : rounded(10 ** at))

  function snapped(at) {
    let best = null
    for (const mu of model.stored) {
      const away = Math.abs(place(mu, model.least) - at)
      if (away < SNAP && (best === null || away < Math.abs(place(best, model.least) - at))) best = mu
    }
    return best
  }

  function draw() {
    root.querySelector("small").textContent = model.fixed ? "the same packing at every μ" : "each μ has its own packing"
    part("hill").hidden = model.fixed // the curve is of other packings
    range.min = model.least
    range.max = model.most
    part("ticks").innerHTML = model.stored
      .map((mu) => `<i style="left:${along(place(mu, model.least))}"></i>`).join("")
    const marks = [[0, model.least]]
    for (let k = Math.ceil(model.least + 0.4); k <= model.most; k++) marks.push([Number((10 ** k).toPrecision(1)), k])
    part("scale").replaceChildren(...marks.map(([mu, at]) => button(String(mu), () => wish(mu), { style: `left: ${along(at)}`, tabIndex: -1 })))
    follow()
  }

  /** η against μ as a curve above the rail: how undetermined forces are at this friction. */
  function drawHill() {
    const most = Math.max(...model.hill.map(([, eta]) => eta))
    if (!(most > 0)) return
    const points = model.hill.map(([mu, eta]) =>
      `${100 * (place(mu, model.least) - model.least) / (model.most - model.least)},${HILL * (1 - eta / most)}`)
    part("hill").innerHTML = `<span>η₂(μ)</span>
      <svg viewBox="0 0 100 ${HILL}" preserveAspectRatio="none" aria-hidden="true">
      <polygon points="0,${HILL} ${points.join(" ")} 100,${HILL}"/></svg>`
  }

  function follow() {
    range.value = place(model.mu, model.least)
    typed.value = String(Number(model.mu.toPrecision(4)))
    range.setAttribute("aria-valuetext", `μ = ${typed.value}`)
  }

  // A stored value is shown while the thumb is moving; others are requested on release.
  range.addEventListener("input", () => {
    const at = Number(range.value), stored = snapped(at)
    typed.value = String(stored ?? value(at))
    if (stored !== null && stored !== model.mu) wish(stored)
  })
  range.addEventListener("change", () => {
    const at = Number(range.value)
    wish(snapped(at) ?? value(at))
    follow()
  })
  range.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key]
    if (!step || !model.stored.length) return
    const sorted = [...model.stored].sort((a, b) => a - b)
    const next = step > 0 ? sorted.find((mu) => mu > model.mu) : sorted.findLast((mu) => mu < model.mu)
    if (next !== undefined) wish(next)
    event.preventDefault()
    event.stopPropagation()
  })
  typed.addEventListener("change", () => {
    const mu = Number(typed.value.replace(",", "."))
    if (Number.isFinite(mu)) view.model.data.wish = mu
    ask(model, view, { typed: typed.value })
  })

  for (const name of ["least", "most", "stored", "fixed"]) model.on(name, draw)
  model.on("mu", follow)
  model.on("msg:custom", follow) // the typed value was accepted or refused
  model.on("hill", drawHill)
  draw()
  drawHill()

  return root
}
