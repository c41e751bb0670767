// Dragging of the point in force space: it follows the pointer inside the outline, and the network
// follows it. The server sends networks at corners all around (a fan); shown is a point of the
// triangle between two of them and the initial network, which is admissible, since S is convex.

import { FORCES } from "../replay/live.js"

export class PointHand {
  constructor(hand) {
    this.hand = hand
    this.drop()
  }

  get active() { return this.target !== null }

  drop() {
    this.target = this.fan = this.from = null
    this.released = false // whether it was released before its networks arrived
  }

  // Dragging

  take(x, y) {
    if (!this.hand.begin()) return
    this.target = [x, y]
    this.hand.tell({ grab_point: true })
  }

  move(x, y) {
    if (!this.active) return
    this.target = [x, y]
    if (this.fan) this.set()
  }

  leave() {
    const { fan, at } = this
    if (!this.active) return
    if (!fan) return void (this.released = true)
    this.drop()
    if (at) this.hand.tell({ pull_point: at })
    this.hand.still()
  }

  // Messages from the server

  spread(fan) {
    const { hand } = this, { mixed, walk } = hand.replay ?? {}
    if (!fan || !this.active || fan.normal.length !== fan.x.length * walk.contacts) {
      if (this.active) { this.drop(); hand.still() }
      return
    }
    const start = hand.player.plots.projected(mixed)
    if (!start) return
    this.fan = fan
    this.at = null
    this.from = { start, normal: mixed.normal.slice(), tangential: mixed.tangential.slice() }
    this.from.residual = hand.replay.residual
    hand.remember()
    this.set()
    if (this.released) this.leave()
  }

  /** The network at the target, or at the nearest point of the polygon. */
  set() {
    const { fan, from, hand } = this, { contacts } = hand.replay.walk
    const point = inside(fan, this.target), { k, next, a, b } = triangle(fan, from.start, point)
    const held = { normal: new Float32Array(contacts), tangential: new Float32Array(contacts) }
    for (const name of FORCES) {
      const out = held[name], all = fan[name], initial = from[name], i = k * contacts, j = next * contacts
      for (let c = 0; c < contacts; c++) out[c] = (1 - a - b) * initial[c] + a * all[i + c] + b * all[j + c]
    }
    held.residual = Math.max(from.residual || 0, fan.residual[k], fan.residual[next])
    this.at = point
    this.describe(...point)
    hand.show(held)
  }

  describe(x, y) {
    this.hand.player.say(`The point in force space pulled to ` +
      `(${x.toFixed(2)}, ${y.toFixed(2)}), in mean forces`)
  }
}

/** A point, or the nearest point of the polygon's edge if it is outside (corners are anticlockwise). */
function inside({ x, y }, [px, py]) {
  let out = false, best = null, least = Infinity
  for (let k = 0; k < x.length; k++) {
    const next = (k + 1) % x.length, ex = x[next] - x[k], ey = y[next] - y[k]
    const ax = px - x[k], ay = py - y[k]
    if (ex * ay < ey * ax) out = true
    const along = Math.max(0, Math.min(1, (ex * ax + ey * ay) / (ex * ex + ey * ey)))
    const near = [x[k] + along * ex, y[k] + along * ey], away = Math.hypot(near[0] - px, near[1] - py)
    if (away < least) { least = away; best = near }
  }
  return out ? best : [px, py]
}

/** The triangle of `here` and corners k, next that contains a point, and the point's weights in it. */
function triangle({ x, y }, [hx, hy], [px, py]) {
  let best = { k: 0, next: 0, a: 0, b: 0 }, most = -Infinity
  const dx = px - hx, dy = py - hy
  for (let k = 0; k < x.length; k++) {
    const next = (k + 1) % x.length, ax = x[k] - hx, ay = y[k] - hy, bx = x[next] - hx, by = y[next] - hy
    const area = ax * by - ay * bx, a = (dx * by - dy * bx) / area, b = (ax * dy - ay * dx) / area
    const short = Math.min(a, b, 1 - a - b)
    if (short > most) { most = short; best = { k, next, a, b } }
  }
  const clip = (value) => Math.max(0, Math.min(1, value)), [a, b] = [clip(best.a), clip(best.b)]
  const sum = Math.max(1, a + b)
  return { ...best, a: a / sum, b: b / sum }
}
