// Computations in progress: a packing under compression, then a growing walk.

import { CARRYING } from "../drawing/chain_style.js"
import { STILL } from "../../browser/motion.js"
import { plain } from "../../browser/to_object.js"

const GLIDE = 250 // ms of the transition from the view of the moving packing to that of the finished one
const STRIP = 1 // width of the strip around the box in which images are drawn, in largest radii
export const CATCH_UP = 0.6 // s by which the player stays behind the newest state
const WIDEST = 0.7 // widest chain in a moving packing, in largest radii: collisions carry most of the force
export const FORCES = ["normal", "tangential"]
const MEASURES = ["residual", "eta1", "eta2", "eta3"]

/** A moving packing for the scene, including its periodic images. */
function moving({ box, tilt, x, radius, i, j, reach }) {
  const drawn = { box, tilt, radius, touching: [], i: [], j: [], contact: [] }
  for (const name of ["x", "y", "r", "grain", "kind", "x0", "y0", "x1", "y1"]) drawn[name] = []
  const margin = STRIP * radius.reduce((most, r) => Math.max(most, r), 0)
  const [wide, high] = box
  // In a tilted cell: distances from its sides b and a; x and y in a straight one.
  const narrow = high / Math.hypot(tilt, high), across = (px, py) => (px - (tilt * py) / high) * narrow
  const visible = (low, up, side) => up > -margin && low < side + margin
  const touching = new Int32Array(radius.length)
  for (let c = 0; c < i.length; c++) { touching[i[c]]++; touching[j[c]]++ }
  for (const s of [0, -1, 1]) for (const t of [0, -1, 1]) {
    const a = s * wide + t * tilt, b = t * high, image = s || t ? 2 : 0
    for (let g = 0; g < radius.length; g++) {
      const px = x[2 * g] + a, py = x[2 * g + 1] + b, r = radius[g], at = across(px, py)
      if (!visible(at - r, at + r, wide * narrow) || !visible(py - r, py + r, high)) continue
      drawn.x.push(px); drawn.y.push(py); drawn.r.push(r); drawn.grain.push(g)
      drawn.touching.push(touching[g]); drawn.kind.push(image + (touching[g] ? 0 : 1))
    }
    for (let c = 0; c < i.length; c++) {
      const x0 = x[2 * i[c]] + a, y0 = x[2 * i[c] + 1] + b
      const x1 = x0 + reach[2 * c], y1 = y0 + reach[2 * c + 1]
      const at = across(x0, y0), to = across(x1, y1)
      if (!visible(Math.min(at, to), Math.max(at, to), wide * narrow)) continue
      if (!visible(Math.min(y0, y1), Math.max(y0, y1), high)) continue
      drawn.x0.push(x0); drawn.y0.push(y0); drawn.x1.push(x1); drawn.y1.push(y1)
      drawn.contact.push(c); drawn.i.push(i[c]); drawn.j.push(j[c])
    }
  }
  const half = Math.max(wide + Math.abs(tilt), high) / 2 + margin
  drawn.window = [(wide + tilt) / 2 - half, (wide + tilt) / 2 + half, high / 2 - half, high / 2 + half]
  return drawn
}

/** Chains of a moving packing: width fₙ, colour mobilisation. */
function flickering({ normal, tangential, radius, mu }, palettes, scales) {
  const colours = mu > 0 ? palettes.mobilised : [palettes.neutral], last = colours.length - 1
  const unit = radius.reduce((most, r) => Math.max(most, r), 0)
  const width = normal.map((value) => unit * Math.min(WIDEST, scales.width * value))
  const bin = Int16Array.from(normal, (value, c) => {
    const part = mu > 0 && value > CARRYING ? tangential[c] / (mu * value) : 0
    return Math.round(last * Math.max(0, Math.min(1, 0.5 + part / 2)))
  })
  return { width, bin, colours }
}

/** A walk of one frame with room for more: `number` counts them. */
export function roomy(walk) {
  const { room } = walk, whole = { ...walk, low: walk.low.slice(), high: walk.high.slice() }
  const wide = (values, count) => {
    const padded = new Float32Array(count).fill(NaN)
    padded.set(values)
    return padded
  }
  for (const name of FORCES) whole[name] = wide(walk[name], room * walk.contacts)
  for (const name of MEASURES) whole[name] = wide(walk[name], room)
  whole.numbers = wide(walk.number, room)
  whole.number = whole.numbers.subarray(0, walk.number.length)
  return whole
}

/** Append states to a walk with room. */
export function extend(walk, states) {
  const { contacts } = walk, from = walk.number.length, count = states.number.length
  if (from + count > walk.numbers.length) return
  for (const name of FORCES) walk[name].set(states[name], from * contacts)
  for (const name of MEASURES) walk[name].set(states[name], from)
  walk.numbers.set(states.number, from)
  walk.number = walk.numbers.subarray(0, from + count)
  for (let k = 0; k < states.normal.length; k++) {
    const c = k % contacts, value = states.normal[k]
    if (value < walk.low[c]) walk.low[c] = value
    if (value > walk.high[c]) walk.high[c] = value
  }
}

export class Live {
  /** tell(message): send to the server, see player.py. */
  constructor(player, tell) {
    this.player = player
    this.tell = tell
    this.window = null // of the first picture of a moving packing, while one is on screen
    this.pictures = 0
    this.onVisibility = () => this.tell({ visible: !document.hidden })
    document.addEventListener("visibilitychange", this.onVisibility)
    this.tell({ drawn: true, visible: !document.hidden })
  }

  remove() { document.removeEventListener("visibilitychange", this.onVisibility) }

  /** Whether a moving packing is on screen. */
  get moves() { return this.window !== null }

  /** Handle messages about a computation. */
  receive(message) {
    const { picture, states, bounds, number } = message, { loaded, model } = this.player
    if (states) this.player.grow(plain(states))
    if (bounds) this.player.arrive(plain(bounds))
    requestAnimationFrame(() => { // never in a hidden tab, which thus receives no more
      // Neither over the finished packing nor, after cancelling, over the old one, which stays
      // then.
      if (picture && model.live && this.player.loaded === loaded) this.show(plain(picture))
      this.tell({ painted: number })
    })
  }

  show(picture) {
    const { scene, buttons, model } = this.player, geometry = moving(picture)
    if (!this.moves) this.player.play(false)
    const [left, right, low, high] = geometry.window
    this.window ??= geometry.window
    this.player.split.show()
    geometry.window = this.window
    scene.palette ??= plain(plain(model.palettes).scene)
    scene.frozen = true
    scene.selected = null
    scene.pair = [] // of the previous packing
    scene.show(geometry)
    // Keep the initial size while it shrinks, and enlarge it if the tilt exceeds it.
    const half = Math.max(this.window[1] - this.window[0], right - left) / 2
    scene.view = { x: (left + right) / 2, y: (low + high) / 2, half }
    scene.style = flickering(picture, plain(model.palettes), plain(model.scales))
    scene.resize()
    if (scene.size) scene.repaint()
    this.pictures++
    this.player.showRequested()
    const unbalance = picture.unbalance > 0 ? `, unbalance ${picture.unbalance.toPrecision(1)} ⟨fₙ⟩` : ""
    buttons.say(`Compressing ${picture.radius.length} disks at μ = ` +
      `${Number(picture.mu.toPrecision(4))}: packing fraction φ = ${picture.fraction.toFixed(4)}${unbalance}`)
  }

  /** The moving packing is finished or abandoned; returns its view, or null. */
  leave() {
    const { scene } = this.player, view = this.moves ? scene.view : null
    this.window = null
    scene.frozen = false
    return view
  }

  /** Move from a view to the one that is set. */
  glide(from) {
    const { scene } = this.player, to = scene.view, begin = performance.now()
    if (!from || STILL.matches) return
    const step = (now) => {
      const part = Math.min(1, Math.max(0, (now - begin) / GLIDE)), mix = (a, b) => a + part * (b - a)
      if (scene.frozen || (scene.view !== to && scene.view !== this.between)) return // moved by the user
      this.between = { x: mix(from.x, to.x), y: mix(from.y, to.y), half: mix(from.half, to.half) }
      scene.view = part < 1 ? this.between : to
      scene.repaint()
      if (part < 1) requestAnimationFrame(step)
    }
    scene.view = this.between = { ...from }
    requestAnimationFrame(step)
  }
}
