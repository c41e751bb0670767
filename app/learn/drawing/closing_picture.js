// The end of the lesson: all predictions beside the answers, as a picture to keep, and a movie of a force that is pulled.

import { circle, font, line } from "../../browser/canvas_paths.js"
import { createElement, button } from "../../browser/dom.js"
import { save } from "../../browser/download.js"
import { recorded } from "../../browser/movie.js"
import { Scale, isRight, told } from "./quantity_plot.js"

const WIDE = 800, HIGH = 1120 // px, to be read on a phone
const PACKING = { top: 112, high: 370 } // its visible part
const RAIL = { left: 40, right: 540, top: 584, step: 64 } // of the predictions
const MOVIE = { wide: 720, high: 900, edge: 72 } // px; edge: above the packing
const UP_MS = 4000, DOWN_MS = 4000, ASKS_MS = 3000 // of the movie: the force grows, falls, and a question ends it
export const DARED = "four-hundred" // the chapter of the force in the movie, and of the challenge

/** The answer of a chapter in words: one value, or both ends. */
const answered = ({ x, answer }) => [...new Set(answer.map((value) => told(x, value)))].join(" to ")

/** Where the lesson is, for others. */
const address = ({ host, hostname, pathname }) => (hostname === "localhost" ? "granforce: forces in packings of disks" : `${host}${pathname}?learn`)

export class ClosingPicture {
  /** pulled(host): a promise of the experiment of DARED, drawn in this element. */
  constructor(host, pulled) {
    const canvas = this.canvas = createElement("canvas", { width: WIDE, height: HIGH, role: "img" })
    const keep = () => canvas.toBlob((blob) => save(blob, "granforce-lesson.png"))
    const hidden = createElement("div", { className: "hidden", inert: true, style: `width: ${WIDE}px; height: ${WIDE}px` })
    host.prepend(canvas, button("Save as a movie", (pressed) => this.film(pressed)), " ", button("Save as a picture", keep), hidden)
    pulled(hidden).then((grab) => {
      this.grab = grab
      if (this.given) this.draw(...this.given)
    }, () => {}) // its chapter says why
  }

  stop() { this.grab?.stop() }

  /** chapters: [{name, card, x: axis, prediction, answer: [low, high]}]; look: as from palette; palettes: of packings. */
  draw(chapters, look, palettes) {
    this.given = [chapters, look, palettes]
    const { grab } = this, key = JSON.stringify([chapters, look])
    if (!grab || key === this.key) return
    this.key = key
    const g = this.canvas.getContext("2d"), { left, right, top, step } = RAIL, write = writer(g), place = (x, value) => new Scale(x, left, right).px(Math.min(x.high, Math.max(x.low, value)))
    const answers = chapters.filter(({ prediction = null, answer }) => answer && prediction !== null), hits = answers.filter(({ x, prediction, answer }) => isRight(x, prediction, answer))
    const bottom = PACKING.top + PACKING.high
    this.pull(grab.facts.high)
    this.packing(g, PACKING.top + (PACKING.high - WIDE) / 2, WIDE)
    g.fillStyle = look.paper
    g.fillRect(0, 0, WIDE, PACKING.top)
    g.fillRect(0, bottom, WIDE, HIGH)
    write("How far can one force go?", left, 52, look.ink, "bold 38px")
    write(`Pulled to its end: ${grab.changesTo(grab.network)} others follow, and no disk moves.`, left, 90, look.ink, "23px")
    write("○ I said", left, bottom + 40, look.hand, "21px")
    write("● the answer", left + 130, bottom + 40, look.cold, "21px")
    write(`${hits.length} of ${answers.length} close`, right + 20, bottom + 40, look.ink, "bold 21px")
    chapters.forEach((chapter, k) => {
      const { card, x, prediction = null, answer } = chapter, y = top + step * k
      write(card, left, y - 14, look.ink, "21px")
      if (answer) write(`${prediction === null ? "" : `${told(x, prediction)} → `}${answered(chapter)}`, right + 20, y + 10, look.ink, "21px")
      Object.assign(g, { strokeStyle: look.edge, lineWidth: 1.5 })
      line(g, [left, y + 3], [right, y + 3])
      if (answer) {
        Object.assign(g, { strokeStyle: look.cold, lineWidth: 14, lineCap: "round" })
        line(g, ...answer.map((value) => [place(x, value), y + 3]))
      }
      if (prediction === null) return
      circle(g, [place(x, prediction), y + 3], 7)
      Object.assign(g, { strokeStyle: look.hand, lineWidth: 3 })
      g.stroke()
    })
    write(address(window.location), left, HIGH - 24, look.weight, "20px")
    const named = answers.map((chapter) => `${chapter.card}: ${told(chapter.x, chapter.prediction)}, answer ${answered(chapter)}`)
    this.canvas.ariaLabel = `Your predictions. ${named.join("; ")}`
  }

  /** Give the force a value, at once. */
  pull(value) {
    const { grab, given: [,, palettes] } = this
    grab.drag(value)
    grab.shown = null
    grab.draw(null, palettes)
  }

  /** The packing on an empty picture: this far below its upper edge, and this wide. */
  packing(g, edge, side) {
    g.fillStyle = this.given[1].paper
    g.fillRect(0, 0, g.canvas.width, g.canvas.height)
    const { disks, chains, marks } = this.grab.canvas.scene
    for (const { canvas } of [disks, chains, marks]) g.drawImage(canvas, 0, edge, side, side)
  }

  /** Record a force that is pulled to both its ends, and save it. */
  async film(pressed) {
    const { textContent: words } = pressed, { wide, high } = MOVIE, canvas = createElement("canvas", { width: wide, height: high }), g = canvas.getContext("2d")
    Object.assign(pressed, { disabled: true, textContent: "Recording …" })
    const movie = await recorded(canvas, (ms) => this.frame(g, ms))
    Object.assign(pressed, { disabled: false, textContent: words })
    save(movie, `granforce-lesson.${movie.type.match(/\w+$/)}`)
  }

  /** A frame of the movie; returns whether it is the last one. */
  frame(g, ms) {
    const { grab, given: [chapters, look] } = this, { x, prediction } = chapters.find(({ name }) => name === DARED), { wide, high, edge } = MOVIE, write = writer(g)
    const { start, facts: { low, high: most, contacts } } = grab, up = ms < UP_MS
    const part = gently(Math.min(1, up ? ms / UP_MS : (ms - UP_MS) / DOWN_MS))
    this.pull(up ? start + part * (most - start) : most + part * (low - most))
    this.packing(g, edge, wide)
    write(`One of ${contacts} forces is pulled. No disk moves.`, 24, 46, look.ink, "bold 28px")
    write(`${grab.changesTo(grab.network)} other forces follow.`, 24, high - 62, look.cold, "bold 32px")
    if (ms > UP_MS + DOWN_MS) write(`How far can it go${prediction === null ? "" : `? I said ${told(x, prediction)} times the mean. And you`}? ${address(window.location)}`, 24, high - 24, look.ink, "20px")
    return ms > UP_MS + DOWN_MS + ASKS_MS
  }
}

/** Slow at both ends. */
const gently = (part) => (1 - Math.cos(Math.PI * part)) / 2

/** write(text, x, y, colour, size): on a canvas, in the font of the page. */
const writer = (g) => (text, x, y, colour, size) => {
  Object.assign(g, { fillStyle: colour, font: font(size) })
  g.fillText(text, x, y)
}
