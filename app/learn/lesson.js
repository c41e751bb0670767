// Learn: eight chapters, one on screen; the chapter and the reader's progress are in the address
// and in the browser.

import { copyButton } from "../browser/clipboard.js"
import { button, createElement } from "../browser/dom.js"
import { keepChapter } from "../browser/local_storage.js"
import { STILL } from "../browser/motion.js"
import { ONWARDS, sceneQuery } from "../browser/scene_options.js"
import { plain } from "../browser/send.js"
import { CHAPTERS, SUMMARY } from "./chapters.js"
import { palette } from "./drawing/palette.js"
import { ClosingPicture, DARED } from "./drawing/closing_picture.js"
import { Grab } from "./experiments/grab.js"
import { PredictDoSee } from "./predict_do_see.js"
import { Progress } from "./progress.js"
import { Source } from "./source.js"

// The data of later chapters, requested one after the other while the first is read, as some take
// time.
const AHEAD = [["packing", "0.1"], ["rail", "grabbed"], ["scene", "ladder"], ["scene", "groove"], ["scene", "box"], ["scene", "thirteen"], ["shadow"], ["push", "0"], ["curve"], ["push", "1"]]

class Lesson {
  constructor(model, view) {
    Object.assign(this, { model, source: new Source(model, view), progress: new Progress(), openings: 0 })
    this.root = createElement("div", { className: model.alone ? "course alone" : "course" })
    this.list = createElement("ol", {})
    const nav = createElement("nav", { ariaLabel: "Chapters" })
    nav.append(this.list, createElement("a", { href: "?scene=own", textContent: "Build your own" }))
    this.main = createElement("article", {})
    this.root.append(nav, this.main)
    this.returned = () => this.open(this.named)
    window.addEventListener("popstate", this.returned)
    model.on("dark", () => this.paint())
    model.on("palettes", () => this.paint())
    model.on("remove", () => this.leave())
    this.sized = new ResizeObserver(() => this.paint())
    window.history.replaceState(null, "", this.address(CHAPTERS[this.named].name)) // for the way back
    this.open(this.named)
  }

  leave() {
    window.removeEventListener("popstate", this.returned)
    this.close()
  }

  close() {
    this.experiment?.stop()
    this.closing?.stop()
    this.sized.disconnect()
    this.experiment = this.mechanism = null
  }

  /** The number of the chapter in the address, otherwise of the first unfinished one. */
  get named() {
    const name = new URLSearchParams(window.location.search).get("learn"), named = CHAPTERS.findIndex((one) => one.name === name)
    return named < 0 ? Math.max(0, CHAPTERS.findIndex((one) => !this.progress.of(one.name).done)) : named
  }

  /** The address of a chapter, with all other parameters of this page. */
  address(name) {
    const query = new URLSearchParams(window.location.search)
    query.set("learn", name)
    return `?${query}`
  }

  /** A chapter, with a friend's prediction if the address has one. */
  dared(chapter) {
    const said = new URLSearchParams(window.location.search).get("said"), value = Number(said)
    return chapter.name === DARED && said && value >= chapter.x.low && value <= chapter.x.high ? { ...chapter, said: value } : chapter
  }

  /** A link that asks a friend the same, and tells the prediction after the friend's own. */
  get challenge() {
    const { origin, pathname } = window.location
    return `${origin}${pathname}?learn=${DARED}&said=${this.progress.of(DARED).prediction?.toFixed(2) ?? ""}`
  }

  go(number) {
    window.history.pushState(null, "", this.address(CHAPTERS[number].name))
    this.open(number)
    window.scrollTo({ top: 0 })
    this.root.querySelector("h1").focus({ preventScroll: true })
  }

  async open(number) {
    this.close()
    const chapter = this.dared(CHAPTERS[number]), turn = ++this.openings
    this.number = number
    keepChapter(chapter.name)
    const parts = this.lay(chapter)
    this.show()
    const { model, source } = this, palettes = () => plain(model.palettes)
    const experiment = new chapter.experiment(parts.picture, chapter.options, () => this.mechanism?.show(), palettes())
    this.experiment = experiment
    try {
      await experiment.load(source)
    } catch (error) {
      if (!number && turn === 1) return this.open(1) // which needs no stored packing
      parts.voice.textContent = error.message
      return
    }
    if (turn !== this.openings) return experiment.stop()
    this.main.classList.remove("waiting")
    const { stops } = experiment, x = stops ? { ...chapter.x, stops, ticks: stops.filter(isDecade) } : chapter.x
    parts.text.innerHTML = chapter.text(experiment.facts)
    parts.text.append(" ", createElement("strong", { textContent: chapter.ask }))
    if (chapter.said) parts.text.append(createElement("em", { textContent: "A friend’s prediction is shown after yours." }))
    const save = (more) => { this.progress.set(chapter.name, more); this.show() }
    const again = () => { save({ prediction: null, done: false }); this.open(number) }
    this.mechanism = new PredictDoSee({ ...chapter, x }, experiment, parts, this.progress.of(chapter.name), { save, again, drawn: () => this.paint() })
    this.sized.observe(parts.picture)
    if (!this.model.alone && turn === 1) this.root.querySelector("h1").focus({ preventScroll: true }) // the next stop of the Tab key is the marker
    this.ahead ??= this.fetch()
  }

  /** The experiment of the first chapter, for pictures and a movie. */
  async pulled(host) {
    const grab = new Grab(host, { marked: "grabbed", plain: true }, () => {}, plain(this.model.palettes))
    await grab.load(this.source)
    await grab.ready()
    grab.locked = false
    return grab
  }

  async fetch() {
    for (const [want, name] of AHEAD) await this.source.get(want, name).catch(() => {}) // the caller that needs it reports errors
  }

  /** The parts of a chapter's page. */
  lay(chapter) {
    const { number } = this, last = number === CHAPTERS.length - 1
    const [heading, left, extra] = [["h1", { textContent: chapter.heading, tabIndex: -1 }], ["div", { className: "left" }], ["div", { className: "extra" }]].map((one) => createElement(...one)), text = createElement("p", { className: "text" })
    const voice = createElement("div", { className: "voice", ariaLive: "polite" })
    voice.textContent = "Loading … The first time on a server, this can take a minute."
    const [picture, plot] = ["picture", "plot"].map((className) => createElement("figure", { className }))
    const knob = createElement("label", { className: "knob", hidden: true }), row = createElement("div", { className: "row" }), turn = createElement("span", { className: "turn" })
    const next = last ? button("", () => after.scrollIntoView({ behavior: STILL.matches ? "auto" : "smooth" }))
      : button("", () => this.go(number + 1), { innerHTML: `Next<span>: ${CHAPTERS[number + 1].title}</span> ▸` })
    if (number) turn.append(button("◂", () => this.go(number - 1), { ariaLabel: "Back" }))
    turn.append(next)
    row.append(turn)
    const { pathname } = window.location, { scene } = chapter.options
    const links = Object.entries(ONWARDS).map(([name, [query, title, question]]) => `<a href="${pathname}?${query}&asked=${name}"><b>${title} ▸</b> ${question}</a>`).join("")
    const onwards = last ? `${SUMMARY}<div class="onwards">${links}</div>` : scene ? `<a href="?scene=${scene}">More with this scene</a>` : ""
    const after = createElement("div", { className: "after", innerHTML: onwards })
    if (last || chapter.name === DARED) after.append(copyButton("Challenge a friend: copy the link", () => this.challenge))
    if (scene) after.firstChild.addEventListener("click", ({ currentTarget }) => { currentTarget.href = sceneQuery(scene, this.experiment.body.mu) })
    Object.assign(this, { next, closing: last ? new ClosingPicture(after, (host) => this.pulled(host)) : null })
    const foot = createElement("div", { className: "foot" }) // always in view, as it says what to do next
    foot.append(voice, row)
    this.main.className = chapter.count && !chapter.live ? "waiting counted" : "waiting"
    left.append(picture, extra)
    this.main.replaceChildren(heading, text, left, plot, knob, foot, after)
    if (chapter.live) plot.after(extra) // next to what is dragged
    return { text, picture, plot, extra, knob, voice, row, foot, after, next }
  }

  /** The list of chapters, with finished ones marked, and whether the lesson is finished. */
  show() {
    const missing = CHAPTERS.filter(({ name }) => !this.progress.of(name).done).length
    if (this.closing) Object.assign(this.next, { disabled: missing > 0, innerHTML: missing ? `<span>Your predictions: </span>${missing} ${missing > 1 ? "chapters" : "chapter"} to go` : "Your eight predictions ▾" })
    this.list.replaceChildren(...CHAPTERS.map(({ name, title }, k) => {
      const item = createElement("li", { className: this.progress.of(name).done ? "done" : "" }), link = item.appendChild(createElement("a", { textContent: title, href: this.address(name) }))
      if (k === this.number) {
        link.ariaCurrent = "step"
        requestAnimationFrame(() => this.list.parentNode.scrollTo({ left: item.offsetLeft - 40 })) // if the list is horizontal
      }
      if (item.className) link.title = "done"
      link.addEventListener("click", (event) => {
        if (event.metaKey || event.ctrlKey || event.shiftKey) return
        event.preventDefault()
        this.go(k)
      })
      return item
    }))
  }

  paint() {
    if (this.asks) return
    this.asks = requestAnimationFrame(() => {
      this.asks = 0
      const { mechanism, experiment, model: { dark, palettes }, closing, progress } = this
      if (!mechanism) return
      const colours = plain(palettes)
      if (experiment.draw(dark, colours)) this.paint()
      if (mechanism.stage === 2) closing?.draw(CHAPTERS.map(({ name, card, x }) => ({ name, card, x, ...progress.of(name) })), palette(dark), colours)
    })
  }
}

/** Whether a friction is a power of ten: other ticks would reveal an answer. */
const isDecade = (mu) => Math.abs(Math.log10(mu) - Math.round(Math.log10(mu))) < 1e-9

export function render({ model, view }) { return new Lesson(model, view).root }
