// The shadow that S casts on two forces above three dimensions.

import { shadeGoal } from "../../obsolete/goal.js"
import { line, polygon } from "../../browser/canvas_paths.js"
import { drawName } from "./axis_readings.js"

/** The shadow on the plane of two forces, with its exact outline. */
export function drawShadow(space) {
  const { context: g, look } = space
  const corners = space.corners().map((p) => space.px(p)), { stale } = space.outline
  if (corners.length && !space.fog) {
    polygon(g, corners)
    g.globalAlpha = stale ? 0.35 : 1 // of another friction or load
    g.fillStyle = look.shade
    g.fill()
    shadeGoal(space, corners)
    polygon(g, corners)
    g.strokeStyle = look.cold
    g.lineWidth = 2.5
    g.setLineDash(stale ? [4, 4] : [])
    g.stroke()
    g.setLineDash([])
    g.globalAlpha = 1
    drawName(space, corners, [0, 1].map((d) => corners.reduce((sum, p) => sum + p[d], 0) / corners.length), 0.8) // where few dots are
  }
  if (space.ray && corners.length) drawRay(space, space.ray)
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
  space.write(a[0] - 6, a[1], `goal: left of this line\n(violet = ${times} × green)`, look.hand, 12, "right")
}
