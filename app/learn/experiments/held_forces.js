// A small scene of many dimensions: two of its forces are held, the others are dragged or change at random.

import { unflat } from "../../browser/canvas_paths.js"
import { fixed } from "../model/middle.js"
import { SceneExperiment } from "./scene_experiment.js"

const STEPS = 20 // of a walk to other forces
const CHANGED = 0.01 // of the mean force
const MOST = 50 // walks, after which every force that can change has

export class HeldForces extends SceneExperiment {
  others = new Set() // that have changed

  async load(source) {
    await super.load(source)
    Object.assign(this, { steered: false, random: fixed(), packed: this.body.forces() })
    this.ends = source.get("outline", this.options.scene).then(({ outline }) => { this.outline = unflat([...outline]) })
  }

  get knob() { return null }

  get headline() { return "" }

  /** Forces on the axes of the shadow, which are held. */
  get held() { return [this.options.x, this.options.y] }

  get at() { return [this.others.size, 0] }

  /** Number of other normal forces that depend on the numbers that are still free. */
  get answer() { return this.body.loose(this.held).filter((index) => index % 2 === 0).length }

  get offer() { return { words: "Change the others", run: () => this.change() } }

  /** Walk to another point of S with the same held forces. */
  change() {
    const { body, random, held } = this
    for (let k = 0; k < STEPS; k++) body.u = body.step(body.u, random, held)
    this.moved()
  }

  pulled({ contact, normal, tangential }) {
    this.body.pull(contact, normal, tangential, this.held)
    this.moved()
  }

  moved() {
    const { body, packed, held, others, mean } = this
    body.forces().forEach((v, index) => {
      if (index % 2 === 0 && !held.includes(index) && Math.abs(v - packed[index]) > CHANGED * mean) others.add(index)
    })
    this.answered ||= others.size >= this.answer
    this.changed()
  }

  finish() { for (let k = 0; k < MOST && !this.answered; k++) this.change() }

  get picture() { return { now: this.at, words: `changed: ${this.others.size}` } }

  /** The shadow of S, with the dot that stayed. */
  get aside() {
    const { options: { axes }, outline, body, held } = this, F = body.forces()
    return { axes, exact: outline, filled: true, now: held.map((index) => F[index]) }
  }
}
