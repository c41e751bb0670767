// A small scene of many dimensions: its normal forces are held, one after the other, until none can change.

import { fixed } from "../model/middle.js"
import { SceneExperiment } from "./scene_experiment.js"

const STEPS = 20 // of a walk to other forces

export class HeldForces extends SceneExperiment {
  steered = false
  held = [] // forces, as in Body.interval
  note = ""
  random = fixed()

  get knob() { return null }

  get headline() { return "" }

  get edge() { return this.note }

  get at() { return [this.held.length, 0] }

  /** Each held force fixes one free number. */
  get answer() { return this.body.h }

  /** Normal forces that can still change. */
  get loose() { return this.body.loose(this.held).filter((index) => index % 2 === 0) }

  get offer() {
    const [next] = this.loose
    return next === undefined ? null : { words: "Hold another force", run: () => this.hold(next) }
  }

  respond(what, given) {
    if (what !== "press") return super.respond(what, given)
    const { target } = given
    if (target && !target.loose && !this.locked) this.hold(2 * target.contact)
    return true // nothing is dragged
  }

  /** Hold a force at its value if it can still change; all that can change do. */
  hold(index) {
    const { body, random, loose } = this
    this.note = this.held.includes(index) ? "this force is held" : loose.includes(index) ? "" : "the held forces fix this one"
    if (!this.note) {
      this.held = [...this.held, index]
      for (let k = 0; k < STEPS; k++) body.u = body.step(body.u, random, this.held)
      this.answered ||= !this.loose.length
    }
    this.changed()
  }

  finish() { while (this.loose.length) this.hold(this.loose[0]) }

  coloured({ hand, weight }) {
    const { loose, held, body: { count } } = this, normal = Array.from({ length: count }, (_, c) => 2 * c)
    return new Map([...normal.filter((index) => !loose.includes(index)).map((index) => [index, weight]), ...held.map((index) => [index, hand])])
  }

  get picture() { return { now: this.at, words: `held: ${this.held.length}, can change: ${this.loose.length}` } }
}
