// The part of the possible range that 1000 random networks reach.

import { PackingExperiment } from "./packing_experiment.js"

export class Chance extends PackingExperiment {
  async load(source) {
    const packing = this.packing = await source.get("packing", "0.1")
    this.contact = packing.grabbed
    this.count = 0 // random networks so far
    this.network = this.before = this.asPacked(packing)
    this.canvas.show(packing, this.contact)
    this.drawn = [...packing.number].map((number, row) => ({ number, value: packing.normal[row * packing.contacts + this.contact], row }))
    this.now = this.drawn[0]
  }

  /** Predictions cannot be outside the range that the text gives. */
  get possible() { return [this.packing.least[this.contact], this.packing.largest[this.contact]] }

  get value() { return Math.max(...this.drawn.filter(({ number }) => number && number <= this.count).map(({ value }) => value)) }
  get answer() { return this.packing.high[this.contact] }

  get facts() {
    const { packing, contact } = this, { least, largest, low, high } = packing, part = (c) => (high[c] - low[c]) / Math.max(largest[c] - least[c], 1e-9)
    const widths = (a, b) => a.reduce((sum, v, c) => sum + v - b[c], 0)
    return {
      ...this.counted(packing), low: least[contact], high: largest[contact], part: part(contact),
      all: packing.all_disks, mean: widths(high, low) / widths(largest, least), states: packing.states,
    }
  }

  drag(x, y) {
    this.count = Math.round(Math.min(y, this.packing.states))
    this.now = this.drawn.filter(({ number }) => number <= this.count).at(-1)
    const { row } = this.now, { normal, contacts, states } = this.packing
    this.network = normal.subarray(row * contacts, (row + 1) * contacts)
    if (this.count > 0.99 * states) this.answered = true
    this.changed()
  }

  get picture() {
    const { packing: { least, largest, low, high, states }, contact, answered, count } = this
    const rows = this.drawn.filter(({ number }) => number <= count)
    return {
      now: [this.now.value, count], words: `network ${count}`,
      exact: [rectangle(least[contact], largest[contact], states)], filled: true,
      seen: answered ? [[[low[contact], states], [high[contact], states]]] : [], brush: 8,
      dots: rows.map(({ value, number }) => [value, number]),
    }
  }
}

const rectangle = (low, high, top) => [[low, 0], [high, 0], [high, top], [low, top]]
