// What a question is to be answered by, in a picture of S over two forces: the part of it that counts.

import { polygon } from "../browser/canvas_paths.js"

/** Shade what of S is beyond the goal; places: the corners of S, around it, in pixels. */
export function shadeGoal(space, places) {
  const { context: g, look } = space, half = beyond(space)
  if (!half) return
  g.save()
  polygon(g, places)
  g.clip()
  polygon(g, half)
  g.globalAlpha = 0.13
  g.fillStyle = look.hand
  g.fill()
  g.restore()
}

/** Corners in pixels of the part of the picture beyond the goal; null without one. */
function beyond(space) {
  const { easel: { wide, high }, ray, goal } = space
  if (ray) {
    const [a, b] = [0, 1].map((across) => space.px([across, across * ray])), slope = (b[0] - a[0]) / (b[1] - a[1])
    return [[0, 0], ...[0, high].map((y) => [a[0] + slope * (y - a[1]), y]), [0, high]]
  }
  if (goal === undefined) return null
  const [, y] = space.px([0, goal])
  return [[0, y], [wide, y], [wide, high], [0, high]]
}
