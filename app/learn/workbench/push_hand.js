// A push on a disk, by dragging or by arrow keys, and its largest value, the limit load.

import { number } from "../model/sentences.js"

const HOW = "Drag a disk, or choose one with N and push with the arrow keys: S shrinks until nothing balances. Press the button again to let go."
const STEP = 0.02 // per key press, of the largest load

export class PushHand {
  constructor() { this.stop() }

  /** Remove the push: no disk, and only the scene's loads. */
  stop() { Object.assign(this, { on: false, disk: null, force: [0, 0], note: "", grip: null }) }

  start() {
    this.stop()
    Object.assign(this, { on: true, note: HOW })
  }

  /** A disk is taken at a position of the picture; unit: drawn length of a force of 1. */
  take(disk, at, unit) {
    const before = this.disk === disk ? this.force : [0, 0]
    this.grip = { disk, unit, from: at.map((v, k) => v - before[k] * unit) }
  }

  /** It is dragged to a position. */
  carry(hand, at) {
    const { disk, unit, from } = this.grip
    this.push(hand, disk, at.map((v, k) => (v - from[k]) / unit))
  }

  /** Handle an arrow key; returns whether it pushed. */
  key(hand, key) {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[key]
    if (!step || !this.on) return false
    const disk = hand.disk ?? this.disk ?? 0, force = this.disk === disk ? this.force : [0, 0]
    hand.disk = disk
    this.push(hand, disk, force.map((v, k) => v + STEP * step[k] * hand.body.scaleOf()))
    return true
  }

  get size() { return Math.hypot(...this.force) }

  push(hand, disk, force) {
    Object.assign(this, { disk, force })
    hand.load(this.loads(hand.scene, force))
    this.tell(hand, hand.scene.box[0] ? 0 : null) // nothing balances a push in a periodic box
  }

  /** Say the push and the largest one; null: not known yet. */
  tell(hand, most) {
    this.note = this.words(hand.body, most) || this.note
    hand.changed()
  }

  /** Loads of the scene with a push of this force. */
  loads(scene, [x, y]) {
    const loads = Float64Array.from(scene.load)
    loads[3 * this.disk] += x
    loads[3 * this.disk + 1] += y
    return loads
  }

  /** The push and its largest value, in words. */
  words(body, most) {
    const { size } = this
    if (size < 1e-6) return ""
    if (most === null) return `You push disk ${this.disk + 1} with ${number(size)}. Finding the largest push …`
    const end = Number.isFinite(most) ? `at most ${number(most)} can be borne this way (the limit load)` : "no push this way is too large: it only presses the disks against their walls"
    return `You push disk ${this.disk + 1} with ${number(size)}: ${end}.${body.empty || size > most ? " Now nothing balances." : ""}`
  }
}
