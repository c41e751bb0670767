// Shadows of S: on one axis, the exact interval of a force, and on two above three dimensions.

import { dot } from "./body.js"
import { nameAxis } from "./line.js"
import { line, polygon } from "./pen.js"

/** The exact interval of a contact's f_n: the shadow of S on that axis. */
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

/** The shadow on the plane of two forces, with its exact outline. */
export function drawShadow(space) {
  const { context: g, look } = space, { wide: w, high: h } = space.easel
  g.strokeStyle = look.edge
  g.lineWidth = 1
  g.strokeRect(30, 8, w - 40, h - 40)
  const corners = space.corners().map((p) => space.px(p)), { stale } = space.outline
  if (corners.length) {
    polygon(g, corners)
    g.globalAlpha = stale ? 0.35 : 1 // of another friction or load
    g.fillStyle = look.shade
    g.fill()
    g.strokeStyle = look.cold
    g.lineWidth = 2.5
    g.setLineDash(stale ? [4, 4] : [])
    g.stroke()
    g.setLineDash([])
    g.globalAlpha = 1
    const [x, y] = corners.reduce((one, other) => (other[0] - other[1] > one[0] - one[1] ? other : one)) // where no dots are
    space.write(x + 18, y - 8, "S", look.cold, 22)
  }
  if (space.ray && corners.length) drawRay(space, space.ray)
  const ends = [0, 1].map((k) => { const all = space.corners().map((p) => p[k]); return all.length && !stale ? [Math.min(...all), Math.max(...all)] : [] })
  for (const v of ends[0]) space.write(space.px([v, 0])[0], h - 42, v.toFixed(2), look.cold, 11)
  for (const v of ends[1]) space.write(52, space.px([0, v])[1], v.toFixed(2), look.cold, 11)
  space.shadow.forEach((force, d) => nameAxis(space, `${space.told("name", force)} →`, look.axes?.get(force) ?? look.ink, d ? null : h - 16))
}

/** Where the force up is so many times that across: through S, with words at its lower end. */
function drawRay(space, times) {
  const { context: g, look } = space, all = space.corners(), top = Math.max(...all.map(([, y]) => y)), low = Math.min(...all.map(([, y]) => y))
  const [a, b] = [low, top].map((y) => space.px([y / times, y]))
  g.strokeStyle = look.hand
  g.lineWidth = 1.2
  g.setLineDash([6, 5])
  line(g, a, b)
  g.setLineDash([])
  space.write(a[0] - 6, a[1], `violet = ${times} × green`, look.hand, 12, "right")
}
