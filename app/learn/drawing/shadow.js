// The projection of S onto two forces, above three dimensions.

import { polygon } from "../../browser/canvas_paths.js"
import { drawName } from "./axis_readings.js"

/** The projection onto the plane of two forces, with its exact outline. */
export function drawShadow(space) {
  const { context: g, look } = space
  const corners = space.corners().map((p) => space.px(p)), { stale } = space.outline
  if (corners.length) {
    polygon(g, corners)
    g.globalAlpha = stale ? 0.35 : 1 // belongs to another friction or load
    g.fillStyle = look.shade
    g.fill()
    polygon(g, corners)
    g.strokeStyle = look.cold
    g.lineWidth = 2.5
    g.setLineDash(stale ? [4, 4] : [])
    g.stroke()
    g.setLineDash([])
    g.globalAlpha = 1
    drawName(space, corners, [0, 1].map((d) => corners.reduce((sum, p) => sum + p[d], 0) / corners.length), 0.8) // where there are few dots
  }
}
