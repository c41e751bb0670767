// S as a body in its true shape, and the interval of a force as its projection onto one axis.

import { dot } from "../model/polytope.js"
import { line, polygon } from "../../browser/canvas_paths.js"

/** The body: sides that face the viewer are shaded, those behind are dashed. */
export function drawSolid(space) {
  const { context: g, body, look } = space
  const places = body.corners.map(({ u }) => space.px(space.flat(u)))
  const towards = (side) => -dot(space.view[2], side.slope) // slopes of sides point inwards
  const sides = [...body.sides].sort((a, b) => towards(a) - towards(b)), words = []
  for (const side of sides) {
    const front = towards(side) > 0, lit = space.lit(side)
    polygon(g, side.corners.map((k) => places[k]))
    if (front) {
      g.globalAlpha = lit ? 0.5 : 0.15 + 0.35 * towards(side)
      g.fillStyle = lit ? look.hand : look.cold
      g.fill()
      g.globalAlpha = 1
      space.labels.push({ side, inside: side.corners.map((k) => places[k]) })
    }
    g.strokeStyle = lit ? look.hand : look.cold
    g.lineWidth = front ? 2 : 1
    g.globalAlpha = front ? 1 : 0.4
    g.setLineDash(side.cap || !front ? [4, 4] : [])
    g.stroke()
    g.setLineDash([])
    g.globalAlpha = 1
    if (side.cap) for (const k of side.corners) space.drawOn(places[k], 2)
    if (front && lit) words.push(side.cap ? "no end this way" : space.handler("words", side))
  }
  words.forEach((text, k) => space.write(space.easel.wide / 2, 18 + 17 * k, text, look.ink)) // clear of the body
}

/** The exact interval of a contact's f_n: the projection of S onto that axis. */
export function drawInterval(space, contact) {
  const { context: g, body, look } = space, slope = body.axes.map((axis) => axis[2 * contact])
  const size = Math.hypot(...slope)
  if (size < 1e-9) return
  const along = slope.map((v) => v / size), m = body.middle
  const [dx, dy] = space.flat(along), flat = Math.hypot(dx, dy)
  if (flat < 0.2) return
  const from = space.flat(m), side = [dy / flat, -dx / flat]
  const below = side[1] > 0 ? side.map((v) => -v) : side
  const reach = Math.max(...body.corners.map(({ u }) => { const p = space.flat(u); return dot([p[0] - from[0], p[1] - from[1]], below) }))
  const off = reach + 0.14 * space.half
  const foot = (u) => {
    const s = dot(along, u.map((v, k) => v - m[k]))
    return [from[0] + s * dx + off * below[0], from[1] + s * dy + off * below[1]]
  }
  const order = [...body.corners].sort((a, b) => dot(along, a.u) - dot(along, b.u)), ends = [order[0], order.at(-1)]
  g.strokeStyle = look.hand
  g.lineWidth = 1
  g.setLineDash([2, 4])
  for (const { u } of [...ends, { u: body.u }]) line(g, space.px(space.flat(u)), space.px(foot(u)))
  g.setLineDash([])
  g.lineWidth = 4
  line(g, ...ends.map(({ u }) => space.px(foot(u))))
  const interval = body.interval(2 * contact)
  ends.forEach(({ u }, k) => {
    const [x, y] = space.px(foot(u))
    space.write(x, y + 12, Number.isFinite(interval[k]) ? interval[k].toFixed(2) : "∞", look.hand, 11)
  })
}
