// S as a body in its true shape.

import { dot } from "../model/polytope.js"
import { polygon } from "../../browser/canvas_paths.js"

/** The body: sides that face the viewer are shaded, those behind are dashed. */
export function drawSolid(space) {
  const { context: g, body, look } = space
  const places = body.corners.map(({ u }) => space.px(space.flat(u)))
  const towards = (side) => -dot(space.view[2], side.slope) // slopes of sides point inwards
  const sides = [...body.sides].sort((a, b) => towards(a) - towards(b))
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
  }
}
