// Two disks are pushed apart: the network follows, until disks start to move.

import { networkAt } from "../../packing/replay/replay.js"
import { Sway } from "../../packing/drawing/displacement.js"
import { PackingExperiment } from "./packing_experiment.js"

export class Push extends PackingExperiment {
  async load(source) {
    this.packing = await source.get("packing", "0.1")
    this.value = 0
    this.network = this.before = this.asPacked(this.packing)
    this.canvas.show(this.packing, null)
    this.still = window.matchMedia("(prefers-reduced-motion: reduce)").matches
    this.sway = new Sway(this.canvas.scene)
    this.path = await source.get("push")
    this.canvas.show(this.packing, this.path.contact)
    this.changed()
  }

  get answer() { return this.path.values.at(-1) }

  get facts() {
    const { limit, opened, slid, contact } = this.path
    return { ...this.counted(this.packing), limit, opened, slid, carried: this.before[contact], high: this.answer }
  }

  drag(x) {
    this.value = Math.min(Math.max(0, x), this.answer)
    this.most = Math.max(this.most ?? 0, this.value)
    this.network = networkAt(this.path, this.value).normal
    this.canvas.push = this.value / this.answer
    const moves = x >= this.answer
    if (moves) this.found = true
    if (!this.still && moves !== Boolean(this.canvas.scene.offset)) this.sway.take(moves ? this.path.displacement : null)
    this.changed()
  }

  takes(contact) { return !this.locked && contact === this.path.contact }

  take() { this.taken = this.value }

  pulled(part) { this.drag(this.taken + 2 * part * this.answer) }

  get picture() {
    return { now: [this.value, 0], seen: this.most ? [[[0, 0], [this.most, 0]]] : [], exact: [] }
  }

  stop() {
    this.sway?.take(null)
    super.stop()
  }
}
