// Lines of thrust in bodies: on each joint a bar where the resultant can pass over S, exact, and a dot where it
// passes now. Both dots of a body that has two joints, as in an arch, are connected.

import { circle, line } from "../../browser/canvas_paths.js"

const BAR = 0.35, LINE = 0.12, DOT = 0.14 // widths and radius, in units of the packing
const PALE = 0.4 // opacity of the bars

/** joints: contacts `a`, `b` at their ends, and bounds `low`, `high` of the part of the way from a to b. */
export function drawThrust(context, scene, { a = [], b, low, high }, { normal }) {
  const { geometry: { unit, i, j }, palette, scale } = scene, rows = [], dots = new Map()
  for (const row of a.length ? scene.segments(() => true) : []) rows[row.contact] = row
  context.lineCap = "round"
  for (let n = 0; n < a.length; n++) {
    const from = rows[a[n]], to = rows[b[n]].middle, force = normal[a[n]] + normal[b[n]]
    const at = (part) => from.middle.map((v, d) => v + part * (to[d] - v))
    context.lineWidth = Math.max(BAR * unit, 5 / scale)
    context.strokeStyle = palette.known
    context.globalAlpha = PALE
    if (low[n] <= high[n]) line(context, at(low[n]), at(high[n])) // certified
    context.globalAlpha = 1
    for (const body of [i[from.k], j[from.k]]) {
      if (!dots.has(body)) dots.set(body, [])
      dots.get(body).push(force > 0 ? at(normal[b[n]] / force) : null)
    }
  }
  context.strokeStyle = context.fillStyle = palette.strong
  context.lineWidth = Math.max(LINE * unit, 2 / scale)
  for (const [one, other, more] of dots.values()) {
    if (one && other && more === undefined) line(context, one, other)
    for (const dot of [one, other, more]) {
      if (!dot) continue
      circle(context, dot, Math.max(DOT * unit, 3 / scale))
      context.fill()
    }
  }
}
