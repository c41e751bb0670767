// The common course of every chapter: predict with a marker, do by dragging, see the answer next to
// the prediction.

import { button, createElement } from "../browser/dom.js"
import { STILL } from "../browser/motion.js"
import { QuantityPlot, isRight, told } from "./drawing/quantity_plot.js"

const PREDICT = "Drag the marker to your prediction.", WAIT = "Computing the networks … The first time on a server, this can take a minute."
const STAGES = ["1 Predict", "2 Do"]

export class PredictDoSee {
  /**
   * chapter: of chapters.js; experiment: loaded; parts: {plot, extra, knob, voice, row, foot, after, next}: their elements; progress: {prediction,
   * done} of an earlier visit; save({prediction, done}): called to store progress; drawn(): called to repaint;
   * again(): called to start the chapter anew.
   */
  constructor(chapter, experiment, { plot, extra, knob, voice, row, foot, after, next }, { prediction, done }, { save, drawn, again }) {
    Object.assign(this, { chapter, experiment, host: plot, extra, knob, voice, row, foot, after, next, save, drawn, prediction, predicted: false, ready: true, announced: done })
    plot.classList.toggle("plane", Boolean(chapter.y))
    this.plot = new QuantityPlot(plot, chapter, { marker: (value) => this.mark(value), dot: (x, y) => experiment.drag(x, y), release: () => experiment.release?.() })
    this.button = button("That is my prediction", () => this.begin(), { className: "primary" })
    this.again = button("Again", again)
    this.offer = button("", () => experiment.offer.run())
    row.prepend(this.button, this.offer, this.again)
    if (experiment.knob) this.turnable()
    if (done) this.finish()
    else this.show()
  }

  /** A value of the quantity in question, in words. */
  named(value) { return `${this.chapter.x.symbol ?? ""}${told(this.chapter.x, value)}` }

  /** The slider of the experiment, with its name and a sentence about its value. */
  turnable() {
    const { knob, experiment } = this, { label, max, step } = experiment.knob
    this.slider = createElement("input", { type: "range", min: 0, max, step, ariaLabel: label, oninput: () => experiment.turn(Number(this.slider.value)) })
    this.said = createElement("output", {})
    knob.append(createElement("span", { textContent: label }), this.slider, this.said)
  }

  get stage() { return !this.predicted ? 0 : this.experiment.answered ? 2 : 1 }

  /** The least and the largest prediction. */
  get possible() { return this.experiment.possible ?? [this.chapter.x.low, this.chapter.x.high] }

  /** The initial position of the marker: the low end. */
  get waiting() { return this.possible[0] }

  mark(value) {
    const [low, high] = this.possible
    this.prediction = Math.min(high, Math.max(low, Number(told(this.chapter.x, value))))
    this.show()
  }

  /** The prediction is made; dragging is enabled. */
  async begin() {
    this.save({ prediction: this.prediction, done: false })
    const unlocked = this.unlock()
    ;(this.experiment.steered ? this.plot.dot : this.slider ?? this.offer).focus({ preventScroll: true })
    await unlocked
    const last = this.knob.hidden ? this.chapter.live ? this.extra : this.host : this.knob
    last.style.scrollMarginBottom = `${this.foot.offsetHeight}px` // which covers what lies below
    last.scrollIntoView({ block: "nearest" })
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

  /** Show a finished chapter again with its answer. */
  async finish() {
    await this.unlock()
    if (this.ready && this.row.isConnected) this.experiment.finish(this.chapter)
  }

  /** Update everything from the experiment. */
  show() {
    const { experiment, stage, prediction } = this, { picture } = experiment
    const news = stage === 2 && !this.announced
    if (news) this.save({ prediction, answer: experiment.range, done: (this.announced = true) })
    const words = picture.words ?? `now ${this.named(experiment.value)}`
    const guess = { value: prediction ?? this.waiting, words: prediction === null ? "your prediction: ?" : `your prediction: ${this.named(prediction)}` }
    const answer = stage === 2 && !picture.unanswered ? { value: experiment.answer, words: this.named(experiment.answer) } : null
    const friend = stage === 2 && this.chapter.said ? [{ value: this.chapter.said, words: "your friend" }] : []
    this.plot.draw({ ...picture, words, marker: guess, answer, lines: [...picture.lines ?? [], ...friend] })
    this.plot.allow(!stage ? "marker" : this.ready && experiment.steered ? "dot" : null)
    this.button.hidden = stage > 0
    this.button.disabled = prediction === null
    this.again.hidden = this.after.hidden = stage < 2
    const offer = stage && this.ready ? experiment.offer : null
    Object.assign(this.offer, { hidden: !offer, textContent: offer?.words ?? "", className: stage < 2 ? "primary" : "" })
    this.next.className = stage < 2 ? "" : "primary" // one at a time
    this.host.classList.toggle("found", stage === 2)
    this.knob.hidden = stage < (experiment.knob?.stage ?? 3) || !this.ready
    if (this.slider) Object.assign(this.slider, { value: experiment.turned.value, ariaValueText: (this.said.textContent = experiment.turned.words) })
    this.speak(stage)
    this.drawn()
    if (news) this.reveal()
  }

  /** Scroll to the answer, unless it is in view, once the hand lets go. */
  reveal() {
    const once = new AbortController(), behavior = STILL.matches ? "auto" : "smooth"
    for (const end of ["pointerup", "keyup"]) window.addEventListener(end, () => {
      once.abort()
      this.voice.querySelector(".verdict")?.scrollIntoView({ block: "nearest", behavior })
    }, { signal: once.signal })
  }

  /** The only line of text: the instruction, or the result; and what belongs to it: a count, a picture. */
  speak(stage) {
    const { chapter, experiment, voice, extra } = this, { facts } = experiment
    if (stage < 2) {
      const words = stage === 0 ? chapter.first ?? PREDICT : this.ready ? chapter.doing(facts) : WAIT
      this.say(voice, [words], () => [createElement("p", { className: "todo", innerHTML: `<b>${STAGES[stage]}</b> ${words}` })])
    } else {
      const { headline = "" } = experiment, sentences = facts.empty ? [] : chapter.see(facts).slice(headline ? -1 : 0) // the others are of the friction asked for
      this.say(voice, [headline, ...sentences], () => this.answer(headline, sentences))
    }
    const count = (stage === 2 || (stage && chapter.live)) && chapter.count?.(facts)
    this.say(extra, [JSON.stringify(count)], () => (count ? [sumOf(count)] : []))
  }

  /** Replace the contents of an element by parts(), if its words change. */
  say(element, words, parts) {
    const text = words.join(" ")
    if (element.dataset.text === text) return
    element.dataset.text = text
    element.replaceChildren(...parts())
  }

  /** How far the prediction is off, in the numbers shown; on a logarithmic axis, in which direction. */
  get judged() {
    const { chapter: { x }, experiment: { answer }, prediction } = this, off = told(x, answer) - told(x, prediction)
    if (isRight(x, prediction, [answer, answer])) return ": well done"
    return `, ${x.log ? "" : `${told(x, Math.abs(off))} `}too ${off > 0 ? "low" : "high"}`
  }

  /** Who of two was closer to the answer. */
  get closer() {
    const { chapter: { said }, prediction, experiment: { answer } } = this, by = Math.abs(said - answer) - Math.abs(prediction - answer)
    return Math.abs(by) < 0.005 ? "a draw" : by > 0 ? "you were closer" : "your friend was closer"
  }

  /** The answer next to the prediction, or, once something else has been varied, what then holds; with its reason, the surprise and more. */
  answer(headline, sentences) {
    const { chapter, experiment, prediction } = this
    const verdict = createElement("p", { className: "verdict" })
    const is = chapter.verdict?.(experiment.facts, prediction) ?? { answer: `It is ${this.named(experiment.answer)}.` }
    const friend = chapter.said ? ` Your friend: ${this.named(chapter.said)}; ${this.closer}.` : ""
    const said = headline ? [headline, ` ${experiment.before}`] : [is.answer, ` You predicted ${this.named(prediction)}${is.so ?? this.judged}.${friend}`]
    verdict.append(...["b", "span"].map((tag, k) => createElement(tag, { textContent: said[k] })))
    return [verdict, ...sentences.map((innerHTML) => createElement("p", { innerHTML }))]
  }
}

/** A table of a sum, which is its last row. */
function sumOf(rows) {
  const table = createElement("table", {})
  for (const cells of rows) {
    const row = table.insertRow()
    for (const text of cells) row.insertCell().textContent = text
  }
  return table
}
