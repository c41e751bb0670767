// The random walk, in the plane of two forces, and the part of S there that it reaches. Then the hand goes on.

import { STILL } from "../../browser/motion.js"
import { unflat } from "../../browser/canvas_paths.js"
import { networkAt } from "../../packing/replay/replay.js"
import { PackingExperiment } from "./packing_experiment.js"

const SECONDS = 8 // for the whole walk

export class Chance extends PackingExperiment {
  async load(source) {
    const [packing, { outline, share }] = await Promise.all([source.get("packing", "0.1"), source.get("shadow")])
    const { grabbed: contact, other } = packing, force = (row, c) => packing.normal[row * packing.contacts + c]
    Object.assign(this, { packing, contact, other, share, steered: false, outline: unflat([...outline]), row: 0 })
    source.get("rail", "grabbed").then((rail) => { this.rail = rail; this.stepTo(this.row) }, () => {})
    this.network = this.before = this.asPacked(packing)
    this.canvas.show(packing, null)
    this.canvas.scene.pair = [contact, other]
    this.drawn = [...packing.number].map((number, row) => Object.assign([force(row, contact), force(row, other)], { number }))
  }

  /** Predictions are possible, and not below the force that the walk begins with. */
  get possible() { return [this.before[this.contact], this.packing.largest[this.contact]] }

  get answer() { return this.packing.high[this.contact] }

  get facts() {
    const { packing, contact, share } = this, { least, largest, low, high } = packing
    return {
      ...this.counted(packing), low: least[contact], high: largest[contact], share, states: packing.states,
      step: Math.round((packing.states - this.drawn[1].number) / (this.drawn.length - 2)),
      part: (high[contact] - low[contact]) / (largest[contact] - least[contact]),
    }
  }

  get knob() { return { label: "walk", max: this.drawn.length - 1, step: 1, stage: 1 } }

  get turned() { return { value: this.row, words: `network ${this.drawn[this.row].number}` } }

  turn(row) {
    cancelAnimationFrame(this.frame)
    this.walking = false
    this.stepTo(row)
  }

  stepTo(row) {
    const { normal, contacts } = this.packing
    this.row = row
    this.network = normal.subarray(row * contacts, (row + 1) * contacts)
    this.answered ||= row === this.drawn.length - 1
    this.steered = this.answered && Boolean(this.rail)
    this.changed()
  }

  /** By hand, the force goes to both its ends. */
  drag(x) {
    const { values } = this.rail
    this.network = networkAt(this.rail, Math.min(values.at(-1), Math.max(values[0], x))).normal
    this.changed()
  }

  get offer() {
    return this.walking ? null : { words: this.answered ? "Replay" : "Walk", run: () => this.walk(performance.now()) }
  }

  /** Play the walk, which began at this time. */
  walk(began) {
    const last = this.drawn.length - 1, part = STILL.matches ? 1 : Math.max(0, (performance.now() - began) / 1000 / SECONDS)
    this.walking = part < 1
    this.stepTo(Math.min(last, Math.floor(part * last)))
    if (this.walking) this.frame = requestAnimationFrame(() => this.walk(began))
  }

  finish() { this.stepTo(this.drawn.length - 1) }

  get picture() {
    const { network, contact, other } = this, path = this.drawn.slice(0, this.row + 1)
    return { now: [network[contact], network[other]], words: "", exact: this.outline, seen: path, dots: path, filled: true, walk: true }
  }

  stop() {
    cancelAnimationFrame(this.frame)
    super.stop()
  }
}
