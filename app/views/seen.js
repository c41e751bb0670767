// What the states passed so far say: the range of every component, and η1, η2, η3 (see measures.py).

class Seen {
  constructor(walk) {
    this.walk = walk
    const frames = walk.number.length
    this.eta1 = new Float32Array(frames)
    this.eta2 = new Float32Array(frames)
    this.eta3 = new Float32Array(frames)
    this.acceptance = new Float32Array(frames)
    this.restart()
  }

  restart() {
    const size = this.walk.contacts
    const filled = (value) => new Float32Array(size).fill(value)
    this.last = 0 // the original network (frame 0) is no state of the walk
    this.low = [filled(Infinity), filled(Infinity)]
    this.high = [filled(-Infinity), filled(-Infinity)]
    this.sum = [new Float64Array(size), new Float64Array(size)]
    this.square = new Float64Array(size)
    this.attempts = 0
  }

  /** Going on costs one frame; going back begins anew. */
  until(frame) {
    if (frame < this.last) this.restart()
    while (this.last < frame) this.add(++this.last)
  }

  add(frame) {
    const { contacts, normal, tangential, attempts } = this.walk
    const { square } = this
    let extent = 0, middle = 0
    for (const [k, values] of [normal, tangential].entries()) {
      const low = this.low[k], high = this.high[k], sum = this.sum[k], begin = frame * contacts
      for (let c = 0; c < contacts; c++) {
        const value = values[begin + c]
        if (value < low[c]) low[c] = value
        if (value > high[c]) high[c] = value
        extent += high[c] - low[c]
        middle += (high[c] + low[c]) / 2
        sum[c] += value
        square[c] += value * value
      }
    }
    this.eta3[frame] = extent / middle
    this.measure(frame)
    this.attempts += attempts[frame]
    this.acceptance[frame] = frame / this.attempts
  }

  /** η1 = ⟨δF⟩/⟨|G|⟩ and η2, all pairs of states by the variance, of frames 1 … count. */
  measure(count) {
    const [x, y] = this.sum, { square } = this
    let spread = 0, size = 0, variance = 0, mean = 0
    for (let c = 0; c < square.length; c++) {
      const g2 = (x[c] * x[c] + y[c] * y[c]) / (count * count)
      const v = Math.max(0, square[c] / count - g2)
      spread += Math.sqrt(v)
      size += Math.sqrt(g2)
      variance += v
      mean += g2
    }
    this.eta1[count] = spread / size
    this.eta2[count] = count > 1 ? Math.sqrt((2 * count / (count - 1)) * variance / mean) : 0
  }
}
