// The replay: the frames of a walk, and the present position among them. Between two states the
// straight line is shown: S is convex, so every point of it is also admissible.

/** Forces at a fraction of the way from network a to network b of `all`, one after the other. */
function between(all, a, b, part, out) {
  const size = out.length, from = a * size, to = b * size
  for (let c = 0; c < size; c++) {
    out[c] = part ? (1 - part) * all[from + c] + part * all[to + c] : all[from + c]
  }
}

/** The network at a value, by linear interpolation on a path (flat) with ascending values. */
export function networkAt({ values, normal, tangential, residual }, value) {
  const size = normal.length / values.length
  let k = 0
  while (k < values.length - 2 && values[k + 1] < value) k++
  const part = (value - values[k]) / (values[k + 1] - values[k] || 1)
  const held = { normal: new Float32Array(size), tangential: new Float32Array(size) }
  between(normal, k, k + 1, part, held.normal)
  between(tangential, k, k + 1, part, held.tangential)
  return { ...held, residual: Math.max(residual[k], residual[k + 1]) }
}

export class Replay {
  constructor(walk) {
    this.walk = walk
    this.mixed = { normal: new Float32Array(walk.contacts), tangential: new Float32Array(walk.contacts) }
    this.held = null // a pulled network, shown instead of the states
    this.position = 0
  }

  get last() { return this.walk.number.length - 1 }

  /** The number of stored networks up to the position; the original one (frame 0) is not a state of the walk. */
  get frame() { return Math.floor(this.position + 1e-9) }

  get atEnd() { return this.position >= this.last }

  /** Frames before and after the position, and the fraction of the way. */
  get spot() {
    const { position, last } = this, k = Math.min(Math.floor(position), last - 1)
    return last < 1 ? [0, 0, 0] : [k, k + 1, position - k]
  }

  /** The stride of the stored networks in the walk. */
  get stride() {
    const { walk } = this, count = walk.room ? walk.room - 1 : walk.number.length - 1
    return Math.max(1, Math.round(walk.states / Math.max(1, count)))
  }

  /** The position of the network with this number, or of the nearest one. */
  positionOf(number) {
    const away = Array.from(this.walk.number, (other) => Math.abs(other - number))
    return away.indexOf(Math.min(...away))
  }

  go(to) {
    this.position = Math.max(0, Math.min(this.last, to))
    this.mix()
  }

  /** The forces at the position. */
  mix() {
    if (this.held) {
      for (const [name, out] of Object.entries(this.mixed)) out.set(this.held[name])
      return
    }
    for (const [name, out] of Object.entries(this.mixed)) between(this.walk[name], ...this.spot, out)
  }

  // Text and numbers

  /** Mean |f_n − original f_n| of the contacts, in ⟨f_n⟩. */
  get apart() {
    const { walk, mixed: { normal } } = this
    return normal.reduce((sum, value, c) => sum + Math.abs(value - walk.normal[c]), 0) / normal.length
  }

  get residual() {
    if (this.held) return this.held.residual
    const [a, b, portion] = this.spot
    return this.walk.residual[portion > 0.5 ? b : a]
  }

  /** The position in words, following the number of the network. */
  get place() {
    const { walk, frame } = this
    if (this.held) return `of ${walk.states}, ${this.held.place ?? "pulled"}`
    return frame ? `of ${walk.states}` : `of ${walk.states}, ${walk.origin}`
  }

  /** The number of the network, and its position. */
  get title() { return `network ${this.walk.number[this.frame]} ${this.place}` }
}
