// Two disks are pushed apart: the network follows, until disks start to move. Then the same disks are
// pushed again, from other networks of the walk.

import { STILL } from "../../browser/motion.js"
import { networkAt } from "../../packing/replay/replay.js"
import { OPENS } from "../../packing/drawing/first_motion.js"
import { Sway } from "../../packing/drawing/displacement.js"
import { PackingExperiment } from "./packing_experiment.js"

const SHOWN = 0.45 // of the width of the packing

export class Push extends PackingExperiment {
  async load(source) {
    this.packing = await source.get("packing", "0.1")
    Object.assign(this, { source, limits: [], network: this.asPacked(this.packing) })
    this.canvas.show(this.packing, null)
    this.sway = new Sway(this.canvas.scene)
    this.begin(0, await source.get("push", "0"))
    this.answer = this.limit
  }

  /** Push from one of the networks, which its path starts from. */
  begin(start, path) {
    Object.assign(this, { start, path, before: networkAt(path, 0).normal })
    this.canvas.show(this.packing, path.contact)
    this.canvas.zoom(path.contact, SHOWN)
    this.drag(0)
  }

  /** The next network, once disks moved from the present one. */
  get offer() {
    const { start, path: { starts }, pushed } = this
    return pushed && start + 1 < starts ? { words: "Take other forces in S", run: () => this.next() } : null
  }

  async next() {
    const start = this.start + 1
    this.say("Computing how these forces follow …")
    try {
      this.begin(start, await this.source.get("push", String(start)))
      this.say("")
    } catch (error) {
      this.say(error.message)
    }
  }

  /** The largest push that the present forces carry. */
  get limit() { return this.path.values.at(-1) }

  /** Whether the present forces have been pushed until disks moved. */
  get pushed() { return this.limits.length > this.start }

  get moving() { return this.canvas.motion !== null }

  get facts() {
    const { path: { contact, opened, slid, number }, packing, limits, moving, before, pushed } = this, count = (mask) => mask.reduce((sum, v) => sum + v, 0)
    return {
      ...this.counted(packing), number, moving, high: this.limit, carried: before[contact], opened: count(opened), slid: count(slid),
      pushed, limit: this.path.limit, limits: limits.map(({ value }) => value),
    }
  }

  drag(x) {
    const { path, limit, limits, start } = this, moves = x >= limit
    this.value = Math.min(Math.max(0, x), limit)
    const { normal, tangential } = networkAt(path, this.value)
    Object.assign(this, { network: normal, tangential })
    Object.assign(this.canvas, { push: this.value / limit, motion: moves ? path.displacement : null })
    if (moves) {
      this.answered = true
      limits[start] = { value: limit, words: `network ${path.number}: ${limit.toFixed(2)}` }
    }
    if (!STILL.matches && moves !== Boolean(this.canvas.scene.offset)) this.sway.take(this.canvas.motion)
    this.changed()
  }

  takes(contact) { return !this.locked && contact === this.path.contact }

  take() { this.taken = this.value }

  pulled(part) { this.drag(this.taken + 2 * part * this.limit) }

  /** In motion the contacts that open and slip in it, otherwise those of the network. */
  get limited() {
    const { moving, path: { opened, slid } } = this
    return moving ? Uint8Array.from(opened, (open, c) => (open ? OPENS : slid[c])) : super.limited
  }

  /** The force of the line against the push, and what S allows. */
  get picture() {
    const { value, locked, limits, network, path: { values, normal, band, contact, limit }, packing: { contacts } } = this
    const rows = Array.from({ length: band.length / 3 }, (_, k) => band.subarray(3 * k, 3 * k + 3)).filter((row) => row.every(Number.isFinite)) // not certified: next to the limit load
    const edge = (d) => rows.map((row) => [row[0], row[d]])
    const now = [value, network[contact]], bound = { value: limit, words: `limit load ${limit.toFixed(2)}` }
    return {
      now, words: `push ${value.toFixed(2)}`, filled: true, curve: true, exact: locked ? [] : [...edge(1), ...edge(2).reverse()], seen: [...Array.from(values, (push, k) => [push, normal[k * contacts + contact]]).filter(([push]) => push < value), now],
      lines: locked ? [] : [bound, ...limits.slice(1)],
    }
  }

  stop() {
    this.sway?.take(null)
    super.stop()
  }
}
