// A push on a disk, by hand or by arrow keys, and how large it may become: the limit load.

import { Body } from "./model/polytope.js"
import { number } from "./model/sentences.js"

export class Push {
  constructor() { this.on = false; this.stop() }

  /** Nothing is pushed: no disk, and no load but the scene's. */
  stop() { this.disk = null; this.force = [0, 0] }

  /** body under this push, besides the scene's own loads. */
  load(body, disk, force) {
    if (this.disk !== disk) Object.assign(this, { disk, own: Float64Array.from(body.scene.load) })
    this.force = force
    loaded(body, this.own, disk, force)
  }

  /** What is pushed, and how much can be, in words. */
  told(body) {
    const size = Math.hypot(...this.force)
    if (size < 1e-6 || !body.whole) return ""
    const most = this.limit(body)
    const end = Number.isFinite(most) ? `at most ${number(most)} can be borne this way (the limit load)` : "no push this way is too large: it only presses the disks against their walls"
    return `You push disk ${this.disk + 1} with ${number(size)}: ${end}.${body.empty ? " Now nothing balances." : ""}`
  }

  /** The largest push this way under which S is not empty, by halving; Infinity without one. */
  limit(body) {
    const trial = new Body(body.scene), size = Math.hypot(...this.force)
    const holds = (F) => {
      loaded(trial, this.own, this.disk, this.force.map((v) => (v * F) / size))
      return !trial.cut(body.mu).empty
    }
    let [low, high] = [0, 64 * trial.scaleOf()]
    if (holds(high)) return Infinity
    for (let k = 0; k < 22; k++) { const F = (low + high) / 2; if (holds(F)) low = F; else high = F }
    return low
  }
}

function loaded(body, own, disk, [x, y]) {
  body.load = Float64Array.from(own)
  body.load[3 * disk] += x
  body.load[3 * disk + 1] += y
  body.reload()
}
