// S where it is a line: with what stops it at its ends, and below it the axis of a force.

import { forceName, number } from "./saying.js"

const TICKS = 70 // pixels between two numbers of an axis, at least

/** The line, with what stops it at its ends. */
export function drawSegment(space) {
  const { context: g, body, look, easel } = space
  const ends = body.corners.map(({ u }) => space.px(space.flat(u))), y0 = ends[0][1]
  const index = axisForce(body, look.contact)
  if (index !== null) drawAxis(space, index, Math.min(easel.high - 46, y0 + 80))
  g.strokeStyle = look.cold
  g.lineWidth = 7
  g.lineCap = "butt"
  g.beginPath()
  g.moveTo(...ends[0])
  g.lineTo(...(ends[1] ?? ends[0]))
  g.stroke()
  g.font = "13px sans-serif"
  let before = null // words of the other end
  for (const side of ends.length > 1 ? body.sides : []) {
    const [x, y] = ends[side.corners[0]], lit = space.lit(side), words = side.cap ? "no end this way" : space.told("words", side)
    const text = g.measureText(words).width > 0.45 * easel.wide ? words.replace(/, | (?=and (?:at|between) )/, "\n") : words
    const wide = Math.max(...text.split("\n").map((line) => g.measureText(line).width)), high = text.includes("\n") ? 40 : 30
    const close = before && Math.abs(before.x - x) < (before.wide + wide) / 2 + 12
    if (side.cap) space.drawOn([x, y], 7)
    else { g.fillStyle = lit ? look.hand : look.cold; g.fillRect(x - 3, y - 13, 6, 26) }
    space.write(x, y - high - (close ? 34 : 0), text, lit ? look.hand : look.ink)
    space.labels.push({ side, x, y, reach: 30 })
    before = { x, wide }
  }
}

/** Below S, at y: the axis of a force that grows across, with its least, present and largest value. */
export function drawAxis(space, index, y) {
  const { context: g, body, look, easel } = space, rest = body.origin[index], [left, right] = [24, easel.wide - 24]
  const change = (u) => body.axes.reduce((sum, axis, k) => sum + u[k] * axis[index], 0)
  const slope = change(space.moving(body.u, 1, 0)) - change(body.u) // by a step across
  const place = (v) => space.px([(v - rest) / slope, 0])[0]
  const pixels = Math.abs(place(1) - place(0)), step = nice(TICKS / pixels)
  const sorted = [...body.corners].sort((a, b) => change(a.u) - change(b.u)), ends = [sorted[0], sorted.at(-1)]
  const marked = [...ends.filter(({ cap }) => !cap).map(({ u }) => [u, look.cold]), [body.u, look.hand]]
    .map(([u, colour]) => ({ v: change(u) + rest, place: space.px(space.flat(u)), colour }))
    .map((mark) => ({ ...mark, x: mark.place[0] }))
  g.strokeStyle = look.edge
  g.lineWidth = 1
  g.beginPath()
  g.moveTo(left, y)
  g.lineTo(right, y)
  const free = (x, k = marked.length) => marked.slice(0, k).every((other) => Math.abs(other.x - x) > 40)
  const ticks = [], [first, last] = [left, right].map((x) => (x - place(0)) / (place(1) - place(0)) / step).sort((a, b) => a - b)
  for (let k = Math.ceil(index % 2 ? first : Math.max(first, 0)); k <= last; k++) { // no normal force is below 0
    const x = place(k * step)
    g.moveTo(x, y - 4)
    g.lineTo(x, y + 4)
    if (free(x)) ticks.push([x, String(Number((k * step).toPrecision(6)))])
  }
  g.stroke()
  for (const [x, text] of ticks) space.write(x, y + 14, text, look.ink, 11)
  g.lineWidth = 1
  g.setLineDash([2, 4])
  for (const { x, place: [, above], colour } of marked) {
    g.strokeStyle = colour
    g.beginPath()
    g.moveTo(x, above)
    g.lineTo(x, y)
    g.stroke()
  }
  g.setLineDash([])
  marked.forEach(({ v, x, colour }, k) => { if (free(x, k)) space.write(x, y + 14, number(v), colour, 12) })
  const name = forceName(body.scene, index)
  space.write(easel.wide / 2, y + 33, slope > 0 ? `${name} →` : `← ${name}`, look.ink)
}

/** Which way a line is drawn: the force on its axis becomes larger to the right. */
export function signOf(body) { return body.h === 1 ? Math.sign(body.axes[0][axisForce(body, null)]) || 1 : 1 }

/** Of a line, the force on its axis: that of this contact if it changes, else the one that changes most. */
export function axisForce(body, contact) {
  const axis = body.axes[0], most = (part) => {
    const size = Array.from({ length: body.count }, (_, c) => Math.abs(axis[2 * c + part])), c = size.findIndex((v) => v > 0.999 * Math.max(...size)) // the first of equals
    return size[c] > 1e-9 ? 2 * c + part : null
  }
  return contact !== null && Math.abs(axis[2 * contact]) > 1e-9 ? 2 * contact : most(0) ?? most(1)
}

/** The least of 1, 2, 5, 10, … times a power of ten that is not below this. */
function nice(least) {
  const ten = 10 ** Math.floor(Math.log10(least))
  return ten * ([1, 2, 5].find((k) => k * ten >= least) ?? 10)
}
