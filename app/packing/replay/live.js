// Computations in progress: a packing under compression, then a growing walk.

import { CARRYING } from "../drawing/chain_style.js"
import { STILL } from "../../browser/motion.js"
import { plain } from "../../browser/send.js"

const GLIDE = 250 // ms of the transition from the view of the moving packing to that of the finished one
export const CATCH_UP = 0.6 // s by which the player stays behind the newest state
const WIDEST = 0.7 // widest chain in a moving packing, in largest radii: collisions carry most of the force
export const FORCES = ["normal", "tangential"]
const MEASURES = ["residual", "eta1", "eta2", "eta3"]

/** A moving packing for the scene: in its own unit and window, with lines from centre to centre. */
function moving(picture) {
  const { box: [wide, high], tilt, radius, i, centres } = picture
  const unit = radius.reduce((most, r) => Math.max(most, r), 0), half = Math.max(wide + Math.abs(tilt), high) / 2 + unit
  const window = [(wide + tilt) / 2 - half, (wide + tilt) / 2 + half, high / 2 - half, high / 2 + half]
  const starts = Array.from(i).flatMap((grain) => [centres[2 * grain], centres[2 * grain + 1]])
  return { ...picture, unit, window, starts }
}

/** Chains of a moving packing: width fₙ, colour mobilisation. */
function flickering({ normal, tangential, unit, mu }, palettes, scales) {
  const colours = mu > 0 ? palettes.mobilised : [palettes.neutral], last = colours.length - 1
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
    const { picture, states, number } = message, { loaded, model } = this.player
    if (states) this.player.grow(plain(states))
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
    geometry.window = this.window
    scene.palette ??= plain(plain(model.palettes).scene)
    scene.frozen = true
    scene.selected = null
    scene.pair = [] // of the previous packing
    scene.show(geometry)
    // Keep the initial size while it shrinks, and enlarge it if the tilt exceeds it.
    const half = Math.max(this.window[1] - this.window[0], right - left) / 2
    scene.view = { x: (left + right) / 2, y: (low + high) / 2, half }
    scene.style = flickering(geometry, plain(model.palettes), plain(model.scales))
    scene.resize()
    if (scene.size) scene.repaint()
    this.pictures++
    this.player.showRequested()
    const unbalance = picture.unbalance > 0 ? `, unbalance ${Number(picture.unbalance.toPrecision(1))} ⟨fₙ⟩` : ""
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
