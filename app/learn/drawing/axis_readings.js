// The two forces used as axes of a polygon S, one across and one up.

import { dot } from "../model/polytope.js"

const LEAST = 0.3 // of the largest change: forces that change less are not used as axes

/**
 * Two contacts: the one along whose normal force S is longest, and the one whose normal force grows in
 * the most different way; none if all grow alike.
 */
export function readBy({ count, axes, corners }) {
  const slopes = Array.from({ length: count }, (_, c) => axes.map((axis) => axis[2 * c])), sizes = slopes.map((s) => Math.hypot(...s))
  const long = slopes.map((slope, c) => {
    const along = corners.map(({ u }) => dot(slope, u))
    return sizes[c] > LEAST * Math.max(...sizes) ? (Math.max(...along) - Math.min(...along)) / sizes[c] : -1
  })
  const one = long.indexOf(Math.max(...long)), turned = slopes.map(([x, y]) => Math.abs(slopes[one][0] * y - slopes[one][1] * x))
  const other = turned.indexOf(Math.max(...turned))
  return turned[other] > 1e-6 ? [one, other] : []
}

/** The name of S inside it: at a fraction of the way from its centre to the farthest corner. */
export function drawName(space, places, middle, part = 0.5) {
  const far = ([x, y]) => Math.hypot(x - middle[0], y - middle[1])
  const corner = places.reduce((one, other) => (far(other) > far(one) ? other : one))
  if (far(corner) > 80) space.write(...middle.map((v, d) => v + part * (corner[d] - v)), "S", space.look.cold, 22)
}
