// One force of 400 disks is dragged: all others follow along networks computed by the server.

import { networkAt } from "../../packing/replay/replay.js"
import { PackingExperiment } from "./packing_experiment.js"

const FOUND = 0.01 // of the distance between both ends
const CHANGED = 0.1 // mean forces: contacts that changed by more are counted
const LONG = 1.6 // a drag over the whole picture, relative to the distance between both ends

export class Grab extends PackingExperiment {
  async load(source) {
    this.packing = await source.get("packing", "0.1")
    this.contact = this.packing.grabbed
    this.value = this.start = this.packing.normal[this.contact]
    this.network = this.before = this.asPacked(this.packing)
    this.canvas.show(this.packing, this.contact)
    this.rail = source.get("rail").then((rail) => { this.rail = rail; return rail })
  }

  get answer() { return this.packing.largest[this.contact] }

  get facts() {
    const { packing, contact, network, before, rail } = this, count = packing.contacts
    const last = (marks) => marks.subarray(count).reduce((sum, v) => sum + v, 0)
    return {
      ...this.counted(packing), start: this.start, low: packing.least[contact], high: packing.largest[contact],
      changed: network.reduce((sum, v, c) => sum + (Math.abs(v - before[c]) > CHANGED && c !== contact ? 1 : 0), 0),
      opened: rail.opened ? last(rail.opened) : 0, sliding: rail.sliding ? last(rail.sliding) : 0,
    }
  }

  /** Whether it can be dragged. */
  ready() { return this.rail }

  drag(x) {
    const { rail } = this
    if (!rail.values) return
    const [low, high] = [rail.values[0], rail.values.at(-1)]
    this.value = Math.min(high, Math.max(low, x))
    this.network = networkAt(rail, this.value).normal
    this.seen = [Math.min(this.value, this.seen?.[0] ?? this.start), Math.max(this.value, this.seen?.[1] ?? this.start)]
    if (high - this.value < FOUND * (high - low)) this.found = true
    this.changed()
  }

  pulled(part) {
    if (this.locked || !this.rail.values) return false
    if (part === null) this.taken = this.value
    else this.drag(this.taken + LONG * part * (this.rail.values.at(-1) - this.rail.values[0]))
    return true
  }

  get picture() {
    const { packing, contact, seen, found } = this
    return {
      now: [this.value, 0], seen: seen ? [seen.map((x) => [x, 0])] : [],
      exact: found ? [[[packing.least[contact], 0], [packing.largest[contact], 0]]] : [],
    }
  }
}
