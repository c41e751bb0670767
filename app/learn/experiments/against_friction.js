// A force of a small scene with friction as the second axis: S at each μ is a vertical line, and the question is from
// which μ on it has no end.

import { Body } from "../model/polytope.js"
import { SceneExperiment } from "./scene_experiment.js"

const STEP = 0.01 // of μ

export class AgainstFriction extends SceneExperiment {
  async load(source) {
    await super.load(source)
    const trial = new Body(this.scene), { x } = this.options
    this.band = Array.from({ length: Math.round(this.options.most / STEP) + 1 }, (_, k) => {
      const mu = k * STEP, [low, high] = trial.cut(mu).interval(x)
      return { mu, low, high, bounded: trial.bounded }
    })
    this.visited = [this.mu, this.mu]
  }

  get knob() { return null }

  get headline() { return "" }

  get mu() { return this.body.mu }

  get at() { return [this.mu, this.body.forces()[this.options.x]] }

  /** The least friction for which S has no end. */
  get answer() { return this.band.find(({ bounded }) => !bounded).mu }

  get facts() { return { ...super.facts, answer: this.answer } }

  drag(mu, force) {
    const { hand, body, options: { x, most } } = this
    hand.cut(Math.min(most, Math.max(0, STEP * Math.round(mu / STEP))))
    body.steer([x], [force])
    this.past = this.beyond(x, force)
    this.moved()
  }

  moved() {
    const [low, high] = this.visited
    this.visited = [Math.min(low, this.mu), Math.max(high, this.mu)]
    this.answered ||= this.mu >= this.answer
    this.changed()
  }

  finish() { for (const mu of [0, this.options.most]) this.drag(mu, this.at[1]) }

  /** S at all frictions in between, as an area. */
  between(from, to) {
    const rows = this.band.filter(({ mu }) => mu >= from - STEP / 2 && mu <= to + STEP / 2)
    return [...rows.map(({ mu, low }) => [mu, low]), ...rows.map(({ mu, high, bounded }) => [mu, bounded ? high : this.far]).reverse()]
  }

  get picture() {
    const { answered, band, visited, at: [mu, force] } = this
    return { now: [mu, force], words: answered ? "" : `μ = ${mu.toFixed(2)}`, seen: this.between(...visited), exact: answered ? this.between(0, band.at(-1).mu) : [], endless: true, filled: true }
  }
}
