// S as a line; and axes of forces, below S and next to it.

import { font, line } from "../../browser/canvas_paths.js"
import { forceName, number } from "../model/sentences.js"

const TICKS = 70 // least pixels between two numbers of an axis

/** The line, with marks at its ends. */
export function drawSegment(space) {
  const { context: g, body, look, easel } = space
  const ends = body.corners.map(({ u }) => space.px(space.flat(u))), y0 = ends[0][1]
  const index = axisForce(body, look.contact)
  if (index !== null) drawAxis(space, index, Math.min(easel.high - 46, y0 + 80))
  g.strokeStyle = look.cold
  g.lineWidth = 7
  g.lineCap = "butt"
  line(g, ends[0], ends[1] ?? ends[0])
  const [a, b] = [ends[0], ends.at(-1)]
  if (Math.abs(b[0] - a[0]) > 160) space.write(0.8 * a[0] + 0.2 * b[0], y0 + 24, "S", look.cold, 22)
  for (const side of ends.length > 1 ? body.sides : []) {
    const [x, y] = ends[side.corners[0]]
    if (side.cap) space.drawOn([x, y], 7)
    else { g.fillStyle = space.lit(side) ? look.hand : look.cold; g.fillRect(x - 3, y - 13, 6, 26) }
    space.labels.push({ side, x, y, reach: 30 })
  }
}

/** The axis of a force with its least, present and largest value: across S, at y below it, or up (d = 1), at
 * x next to it. */
export function drawAxis(space, index, at, d = 0) {
  const { context: g, body, look, easel } = space
  const ends = d ? [easel.high - space.floor, 10] : [24 + space.aside, easel.wide - 24]
  const value = (u) => body.axes.reduce((sum, axis, k) => sum + u[k] * axis[index], body.origin[index])
  // A line is drawn with its own length: how much the force changes per step along it.
  const [zero, slope] = space.over ? [0, 1] : [body.origin[index], value(space.moving(body.u, 1, 0)) - value(body.u)]
  const place = (v) => space.px(d ? [0, (v - zero) / slope] : [(v - zero) / slope, 0])[d]
  const pixels = Math.abs(place(1) - place(0)), step = nice((d ? 0.6 : 1) * TICKS / pixels)
  const marked = [...extremes(space, value, d).map((end) => ({ ...end, colour: look.cold })), { v: value(body.u), place: space.px(space.flat(body.u)), colour: look.hand }]
    .map((mark) => ({ ...mark, x: mark.place[d] }))
  const axisColour = look.axes?.get(index) // the colour of its arrows
  const stroke = (x, from, to) => (d ? line(g, [from, x], [to, x]) : line(g, [x, from], [x, to]))
  const write = (x, text, colour, size) => (d ? space.write(at - 7, x, text, colour, size, "right") : space.write(x, at + 14, text, colour, size))
  const beside = (x, text, colour) => (d ? space.write(at + 6, x - 9, text, colour, 12, "left") : space.write(x + 5, at - 10, text, colour, 12, "left"))
  g.strokeStyle = axisColour ?? look.edge
  g.lineWidth = 1
  const least = index % 2 ? ends[0] : (d ? Math.min : Math.max)(ends[0], place(0)) // no normal force is below 0
  line(g, ...[slope > 0 ? least : ends[0], ends[1]].map((x) => (d ? [at, x] : [x, at])))
  const free = (x, k) => marked.slice(0, k).every((other) => Math.abs(other.x - x) > (d ? 16 : 40))
  const ticks = [], [first, last] = ends.map((x) => (x - place(0)) / (place(1) - place(0)) / step).sort((a, b) => a - b)
  for (let k = Math.ceil(index % 2 ? first : Math.max(first, 0)); k <= last; k++) {
    const x = place(k * step)
    stroke(x, at - 4, at + 4)
    ticks.push([x, String(Number((k * step).toPrecision(6)))])
  }
  for (const [x, text] of ticks) write(x, text, look.ink, 11)
  g.lineWidth = 1
  g.setLineDash([2, 4])
  for (const { x, place: position, colour } of marked) {
    g.strokeStyle = colour
    stroke(x, position[1 - d], at)
  }
  g.setLineDash([])
  marked.forEach(({ v, x, colour }, k) => { if (free(x, k)) beside(x, number(v), colour) })
  const { r, load } = body.scene, one = r.length === 1 && Math.abs(Math.hypot(load[0], load[1]) - 1) < 1e-9
  const unit = one ? ` (weight of the ${body.scene.one} = 1)` : ""
  const name = forceName(body.scene, index) + unit, words = slope > 0 ? `${name} →` : `← ${name}`
  nameAxis(space, words, axisColour ?? look.ink, d ? null : at + 33)
}

/** Least and largest value of a force in S, with their positions, except where S is unbounded; none while unknown. */
function extremes(space, value, d) {
  const { body, outline } = space, shadow = outline.stale ? [] : space.corners().map((p) => ({ v: p[d], place: space.px(p) }))
  const all = body.whole ? body.corners.map(({ u, cap }) => ({ v: value(u), place: space.px(space.flat(u)), cap })) : shadow
  all.sort((a, b) => a.v - b.v)
  return all.length ? [all[0], all.at(-1)].filter(({ cap }) => !cap) : []
}

/** The label of an axis: below it, at y, or along the left edge. */
function nameAxis(space, words, colour, y) {
  const { context: g, easel: { wide, high } } = space
  if (y !== null) return space.write((wide + space.aside) / 2, y, words, colour)
  g.save()
  g.translate(14, (high - space.floor) / 2)
  g.rotate(-Math.PI / 2)
  g.font = font("13px")
  const short = g.measureText(words).width > high - space.floor ? words.replace(/\w+ force (on )?/, "") : words
  space.write(0, 0, short, colour, 13, "middle")
  g.restore()
}

/** The direction in which a line is drawn: the force on its axis increases to the right. */
export function signOf(body) { return body.h === 1 ? Math.sign(body.axes[0][axisForce(body, null)]) || 1 : 1 }

/** The force on the axis of a line: that of this contact if it changes, otherwise the one that changes most. */
export function axisForce(body, contact) {
  const axis = body.axes[0], most = (part) => {
    const size = Array.from({ length: body.count }, (_, c) => Math.abs(axis[2 * c + part])), c = size.findIndex((v) => v > 0.999 * Math.max(...size)) // the first of equals
    return size[c] > 1e-9 ? 2 * c + part : null
  }
  return contact !== null && Math.abs(axis[2 * contact]) > 1e-9 ? 2 * contact : most(0) ?? most(1)
}

/** The smallest of 1, 2, 5, 10, … times a power of ten that is not below this. */
function nice(least) {
  const ten = 10 ** Math.floor(Math.log10(least))
  return ten * ([1, 2, 5].find((k) => k * ten >= least) ?? 10)
}
