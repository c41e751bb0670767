// The common course of every chapter: predict with a marker, do by dragging, see the answer next to
// the prediction.

import { button, createElement } from "../browser/dom.js"
import { QuantityPlot } from "./drawing/quantity_plot.js"

const PREDICT = "Drag the marker to your prediction.", WAIT = "Computing the networks … The first time on a server, this can take a minute."
const STAGES = ["Predict", "Do", "See"]

export class PredictDoSee {
  /**
   * chapter: of chapters.js; experiment: loaded; parts: {plot, voice, row, foot, after}: their elements; progress: {prediction,
   * done} of an earlier visit; save({prediction, done}): called to store progress; drawn(): called to repaint;
   * again(): called to start the chapter anew.
   */
  constructor(chapter, experiment, { plot, voice, row, foot, after }, { prediction, done }, { save, drawn, again }) {
    Object.assign(this, { chapter, experiment, host: plot, voice, row, foot, after, save, drawn, prediction, predicted: false, ready: true, announced: done })
    this.plot = new QuantityPlot(plot, chapter, { marker: (value) => this.mark(value), dot: (x, y) => experiment.drag(x, y) })
    this.button = button("That is my prediction", () => this.begin(), { className: "primary" })
    this.stages = createElement("span", { className: "stages" })
    this.again = button("Predict again", again)
    this.offer = button("", () => experiment.offer.run(), { className: "primary" })
    row.prepend(this.button, this.stages, this.offer, this.again)
    this.sized = new ResizeObserver(() => this.plot.fit())
    this.sized.observe(plot)
    if (done) this.finish()
    else this.show()
  }

  /** A value of the quantity in question, in words. */
  named(value) { return this.chapter.x.log ? `μ = ${Number(value.toPrecision(2))}` : value.toFixed(2) }

  stop() { this.sized.disconnect() }

  get stage() { return !this.predicted ? 0 : this.experiment.answered ? 2 : 1 }

  /** The least and the largest prediction. */
  get possible() { return this.experiment.possible ?? [this.chapter.x.low, this.chapter.x.high] }

  /** The initial position of the marker: the low end. */
  get waiting() { return this.possible[0] }

  mark(value) {
    const [low, high] = this.possible
    this.prediction = Math.min(high, Math.max(low, value))
    this.show()
  }

  /** The prediction is made; dragging is enabled. */
  async begin() {
    this.save({ prediction: this.prediction, done: false })
    const unlocked = this.unlock()
    this.plot.dot.focus({ preventScroll: true })
    await unlocked
    this.host.style.scrollMarginBottom = `${this.foot.offsetHeight}px` // which covers what lies below
    this.host.scrollIntoView({ block: "nearest" })
  }

  /** Enable dragging, once the data for it are there. */
  async unlock() {
    this.predicted = true
    this.experiment.locked = false
    const ready = this.experiment.ready?.()
    this.ready = !ready?.then
    this.show()
    try {
      await ready
    } catch (error) {
      this.voice.textContent = error.message
      return
    }
    this.ready = true
    this.show()
  }

  /** Show a finished chapter again with its answer: the dot is dragged to both ends, and to the answer. */
  async finish() {
    const { chapter: { x, y }, experiment } = this
    await this.unlock()
    if (!this.ready || !this.row.isConnected) return
    for (const to of [x.low, x.high, experiment.answer]) experiment.drag(to, y?.high ?? 0)
  }

  /** Update everything from the experiment. */
  show() {
    const { experiment, stage, prediction } = this, { picture } = experiment
    const news = stage === 2 && !this.announced
    if (news) this.save({ prediction, done: (this.announced = true) })
    const words = picture.words ?? `now ${this.named(experiment.value)}`
    const guess = { value: prediction ?? this.waiting, words: prediction === null ? "your prediction: ?" : `your prediction: ${this.named(prediction)}` }
    const answer = stage === 2 ? { value: experiment.answer, words: this.named(experiment.answer) } : null
    this.plot.draw({ ...picture, words, marker: guess, answer })
    this.plot.allow(stage ? (this.ready ? "dot" : null) : "marker")
    this.button.hidden = stage > 0
    this.button.disabled = prediction === null
    this.again.hidden = this.after.hidden = stage < 2
    const offer = stage === 2 ? experiment.offer : null
    Object.assign(this.offer, { hidden: !offer, textContent: offer?.words ?? "" })
    this.stages.replaceChildren(...STAGES.map((name, k) => createElement("span", { textContent: `${k + 1} ${name}${stage > k || stage === 2 ? " ✓" : ""}`, className: k === stage ? "on" : "" })))
    this.speak(stage)
    this.drawn()
    if (news) this.reveal()
  }

  /** Scroll to the answer, unless it is in view, once the hand lets go. */
  reveal() {
    const once = new AbortController(), behavior = window.matchMedia("(prefers-reduced-motion: reduce)").matches ? "auto" : "smooth"
    for (const end of ["pointerup", "keyup"]) window.addEventListener(end, () => {
      once.abort()
      this.voice.querySelector(".verdict")?.scrollIntoView({ block: "nearest", behavior })
    }, { signal: once.signal })
  }

  /** The only line of text: the instruction, or the result. */
  speak(stage) {
    const { chapter, experiment } = this
    if (stage < 2) {
      const words = stage === 0 ? PREDICT : this.ready ? chapter.doing : WAIT
      this.say([words], () => [createElement("p", { textContent: words })])
    } else {
      const sentences = chapter.see(experiment.facts)
      this.say(sentences, () => this.answer(sentences, chapter.count?.(experiment.facts)))
    }
  }

  /** Replace the text by parts(), if its words change. */
  say(words, parts) {
    const { voice } = this, text = words.join(" ")
    if (voice.dataset.text === text) return
    voice.dataset.text = text
    voice.replaceChildren(...parts())
  }

  /** The answer next to the prediction, with its reason, the surprise, and the count. */
  answer([reason, surprise], count) {
    const { experiment: { answer }, prediction } = this
    const verdict = createElement("p", { className: "verdict" })
    verdict.append(createElement("b", { textContent: `It is ${this.named(answer)}.` }), ` You predicted ${this.named(prediction)}.`)
    const words = createElement("div", { className: "words" })
    words.append(verdict, createElement("p", { textContent: reason }), createElement("p", { textContent: surprise }))
    if (!count) return [words]
    return [words, tableOf(count)]
  }
}

/** A table, {head, rows}; without a head its last row is a sum. */
function tableOf({ head, rows }) {
  const table = createElement("table", { className: head ? "" : "sum" })
  const add = (section, cells, tag) => {
    const row = section.insertRow()
    row.append(...cells.map((textContent) => createElement(tag, { textContent })))
  }
  if (head) add(table.createTHead(), head, "th")
  const body = table.createTBody()
  for (const cells of rows) add(body, cells, "td")
  return table
}
