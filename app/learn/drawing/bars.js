// The exact intervals of all normal forces in a small scene, with the present force in each. Only
// changes are applied and nothing moving is laid out again, so that a frame is cheap.

import { number, placeName } from "../model/sentences.js"

const SEEN = 0.03 // fraction of the rail: least width of a bar, to be visible next to the mark of the force

export class Bars {
  constructor(host) { this.host = host; this.rows = [] }

  /** ends: [least, largest] of each contact, from another source if S is not drawn whole. */
  draw(body, lit, ends) {
    this.host.hidden = body.empty
    if (body.empty) return
    if (this.rows.length !== body.count) this.begin(body.count)
    const F = body.forces(), both = this.rows.map((_, c) => (body.whole ? this.exact(body)[c] : ends?.[c] ?? [NaN, NaN]))
    const finite = [...both.flat().filter(Number.isFinite), ...F.filter((_, k) => k % 2 === 0)]
    const most = Math.max(...finite, 1e-9) * 1.1, at = (v) => Number(((100 * Math.min(v, most)) / most).toFixed(2))
    this.rows.forEach((row, c) => {
      const [low, high] = both[c], value = F[2 * c]
      row.update("class", lit.has(c) ? "lit" : "")
      row.update("label", placeName(body.scene, c))
      const wide = high - low < 1e-9 * body.scaleOf() ? 0 : Math.max(SEEN, (at(high) - at(low)) / 100)
      row.update("span", Number.isNaN(low) ? "scaleX(0)" : `translateX(${at(low)}%) scaleX(${wide})`)
      row.update("dot", `translateX(${at(value)}%)`)
      row.update("value", `${number(value)}${range(low, high, body.scaleOf())}`)
    })
  }

  /** Intervals of a body that is drawn whole, until it is cut again. */
  exact(body) {
    if (this.corners !== body.corners) {
      this.corners = body.corners
      this.known = Array.from({ length: body.count }, (_, c) => body.interval(2 * c))
    }
    return this.known
  }

  begin(count) {
    this.host.innerHTML = Array.from({ length: count }, (_, c) => `
      <div role="listitem" data-contact="${c}"><span class="label"></span><span class="rail"><i class="span"></i><i class="dot"></i></span><span class="value"></span></div>`).join("")
    this.rows = [...this.host.children].map((row) => {
      const shown = {}, part = (name) => row.querySelector(`.${name}`)
      const write = {
        class: (text) => { row.className = text },
        label: (text) => { part("label").textContent = part("label").title = text },
        value: (text) => { part("value").textContent = text },
        span: (text) => { part("span").style.transform = text },
        dot: (text) => { part("dot").style.transform = text },
      }
      return { update: (what, text) => { if (shown[what] !== text) write[what]((shown[what] = text)) } }
    })
  }
}

/** The range of a force, in words. */
function range(low, high, scale) {
  if (Number.isNaN(low)) return ""
  if (high - low < 1e-9 * scale) return " (fixed)"
  return Number.isFinite(high) ? ` (possible ${number(low)} to ${number(high)})` : ` (${number(low)} or more)`
}
