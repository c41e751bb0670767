// The end of the lesson: the last network, with all predictions beside the answers, as a picture to keep.

import { circle, font, line } from "../../browser/canvas_paths.js"
import { createElement, button } from "../../browser/dom.js"
import { save } from "../../browser/download.js"
import { recorded } from "../../browser/movie.js"
import { Scale, told } from "./quantity_plot.js"

const WIDE = 1200, HIGH = 630 // px, as links are previewed
const RAIL = { left: 850, right: 1010, top: 190, step: 50 } // of the predictions
const PUSH_MS = 4000, MOVES_MS = 2500 // of the movie: a growing push, and the motion that ends it
const TITLE = ["How far can forces go", "while nothing moves?"]

/** The answer of a chapter in words: one value, or both ends. */
const answered = ({ x, answer }) => [...new Set(answer.map((value) => told(x, value)))].join(" to ")

export class ClosingPicture {
  /** push(part): called to show the packing under this part of the largest push. */
  constructor(host, push) {
    const canvas = this.canvas = createElement("canvas", { width: WIDE, height: HIGH, role: "img" })
    this.push = (ms) => {
      push(Math.min(1, ms / PUSH_MS))
      return ms > PUSH_MS + MOVES_MS
    }
    const film = async (pressed) => {
      const { textContent: words } = pressed
      Object.assign(pressed, { disabled: true, textContent: "Recording …" })
      const movie = await recorded(canvas, this.push)
      Object.assign(pressed, { disabled: false, textContent: words })
      save(movie, `granforce-lesson.${movie.type.match(/\w+$/)}`)
    }
    host.prepend(canvas, button("Save as a movie", film, { className: "save" }), " ", button("Save as a picture", () => canvas.toBlob((blob) => save(blob, "granforce-lesson.png")), { className: "save" }))
  }

  /** Let the packing be pushed once more, until it moves. */
  play() {
    const begun = performance.now(), frame = (now) => this.canvas.isConnected && !this.push(now - begun) && requestAnimationFrame(frame)
    requestAnimationFrame(frame)
  }

  /** scene: the packing on screen; chapters: [{title, x: axis, prediction, answer: [low, high]}]; look: as from palette. */
  draw(scene, chapters, look) {
    const g = this.canvas.getContext("2d"), { left, right, top, step } = RAIL, place = (x, value) => new Scale(x, left, right).px(Math.min(x.high, Math.max(x.low, value)))
    const write = (text, x, y, colour, size) => { Object.assign(g, { fillStyle: colour, font: font(size) }); g.fillText(text, x, y) }
    g.fillStyle = look.paper
    g.fillRect(0, 0, WIDE, HIGH)
    for (const { canvas } of [scene.disks, scene.chains, scene.marks]) g.drawImage(canvas, 0, 0, HIGH, HIGH)
    TITLE.forEach((words, k) => write(words, HIGH + 40, 66 + 40 * k, look.ink, "bold 32px"))
    write("○ my prediction", HIGH + 40, 150, look.hand, "18px")
    write("● the answer", HIGH + 200, 150, look.cold, "18px")
    chapters.forEach((chapter, k) => {
      const { title, x, prediction = null, answer } = chapter, y = top + step * k
      write(title, HIGH + 40, y + 6, look.ink, "18px")
      if (answer) write(`${prediction === null ? "" : `${told(x, prediction)} → `}${answered(chapter)}`, right + 16, y + 5, look.ink, "16px")
      Object.assign(g, { strokeStyle: look.edge, lineWidth: 1.5 })
      line(g, [left, y], [right, y])
      if (answer) {
        Object.assign(g, { strokeStyle: look.cold, lineWidth: 16, lineCap: "round" })
        line(g, ...answer.map((value) => [place(x, value), y]))
      }
      if (prediction === null) return
      circle(g, [place(x, prediction), y], 8)
      Object.assign(g, { strokeStyle: look.hand, lineWidth: 3 })
      g.stroke()
    })
    const { host: server, hostname, pathname } = window.location
    write(hostname === "localhost" ? "granforce: forces in packings of disks" : `${server}${pathname}?learn`, HIGH + 40, 602, look.weight, "16px")
    const named = chapters.filter(({ prediction, answer }) => answer && prediction !== null).map((chapter) => `${chapter.title}: ${told(chapter.x, chapter.prediction)}, answer ${answered(chapter)}`)
    this.canvas.ariaLabel = `Your predictions. ${named.join("; ")}`
  }
}
