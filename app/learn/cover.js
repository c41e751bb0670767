// Before the first chapter: one force of 400 disks in the hand, and the question of the lesson.

import { createElement } from "../browser/dom.js"
import { Grab } from "./experiments/grab.js"

const FAR = 0.4 // of the way to an end: once the line has been pulled so far, the lesson's question is asked
const STEPS = 100 // of the slider

export const COVER = {
  name: "", heading: "Pull one force",
  text: ({ all }) => `${all} disks, pressed together from all sides. Each line is the force between two of them: the thicker, the stronger.`,
  ask: "Pull the marked line upwards, or downwards.",
  experiment: Grab, options: { marked: "other", plain: true },
}

export class Cover {
  stage = 0

  /** experiment: loaded; parts: {plot, knob, voice, next}: elements of the page; drawn(): called to repaint. */
  constructor(experiment, { plot, knob, voice, next }, drawn) {
    Object.assign(this, { experiment, voice, next, drawn, far: false })
    plot.remove()
    this.slider = createElement("input", { type: "range", min: 0, max: STEPS, step: 1, ariaLabel: "force of the marked line", oninput: () => this.pull(this.slider.value / STEPS) })
    knob.append(createElement("span", { textContent: "weaker" }), this.slider, createElement("span", { textContent: "stronger" }))
    experiment.ready().then(() => {
      voice.textContent = ""
      experiment.locked = false
      knob.hidden = false
      this.show()
    }, (error) => { voice.textContent = error.message })
  }

  /** Give the marked line a force: this part of the way from the least to the largest. */
  pull(part) {
    const { low, high } = this.experiment.facts
    this.experiment.drag(low + part * (high - low))
  }

  show() {
    const { experiment, voice, next, slider } = this, { value, start, network, facts: { low, high, contacts } } = experiment
    this.far ||= value > start ? value - start > FAR * (high - start) : start - value > FAR * (start - low)
    slider.value = STEPS * (value - low) / (high - low)
    next.className = this.far ? "primary" : ""
    if (value === start) return this.drawn()
    const verdict = createElement("p", { className: "verdict" })
    verdict.append(createElement("b", { textContent: `${experiment.changesTo(network)} other forces follow.` }), createElement("span", { textContent: `of ${contacts - 1}, by more than a tenth of the mean force. No disk moves.` }))
    voice.replaceChildren(verdict)
    if (this.far) voice.append(createElement("p", { textContent: "Pull other lines, too: every disk stays in balance. How can that be? A ladder, one disk, two disks, thirteen: then you will know." }))
    this.drawn()
  }
}
