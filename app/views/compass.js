// Of a polygon S: the two forces that it is drawn by. One grows to the right, with an axis below; which
// way the other one grows an arrow tells, since the two are seldom at right angles.

import { distance, dot } from "./body.js"

const LEAST = 0.3 // of the largest change: forces that change less are no axis
const LONG = 36 // pixels of the arrow
const ROOM = [150, 90] // pixels that arrow and words take
const CORNER = [90, 60] // pixels from the picture's corner to where the arrow begins

/**
 * Two contacts: the one along whose normal force S is longest, and the one whose normal force grows in
 * the most different way; none where all grow alike.
 */
export function readBy({ count, axes, corners }) {
  const slopes = Array.from({ length: count }, (_, c) => slopeOf({ axes }, c)), sizes = slopes.map((s) => Math.hypot(...s))
  const long = slopes.map((slope, c) => {
    const along = corners.map(({ u }) => dot(slope, u))
    return sizes[c] > LEAST * Math.max(...sizes) ? (Math.max(...along) - Math.min(...along)) / sizes[c] : -1
  })
  const one = long.indexOf(Math.max(...long)), turned = slopes.map(([x, y]) => Math.abs(slopes[one][0] * y - slopes[one][1] * x))
  const other = turned.indexOf(Math.max(...turned))
  return turned[other] > 1e-6 ? [one, other] : []
}

/** Axes of the picture of a polygon that is read by two contacts, in those of S: turned and reflected only. */
export function turnedTo(body, [one, other]) {
  if (one === undefined) return [[1, 0], [0, 1]]
  const slope = slopeOf(body, one), long = Math.hypot(...slope), [x, y] = slope.map((v) => v / long)
  const up = Math.sign(dot([-y, x], slopeOf(body, other)))
  return [[x, y], [-up * y, up * x]]
}

/** How a contact's normal force changes along the axes of S. */
function slopeOf({ axes }, contact) { return axes.map((axis) => axis[2 * contact]) }

/** An arrow and words in a corner of the picture, far from S (its corners: places), if there is room. */
export function drawCompass(space, places) {
  const { context: g, body, look, easel: { wide, high } } = space, [, contact] = space.read
  if (contact === undefined) return
  const [dx, dy] = space.flat(slopeOf(body, contact)), size = Math.hypot(dx, dy), [ux, uy] = [dx / size, -dy / size]
  const low = high - space.floor
  const corners = [[0, 1], [1, 1], [1, 0], [0, 0]].map(([a, b]) => [a ? wide - CORNER[0] : CORNER[0], b ? low - CORNER[1] : CORNER[1]])
  const away = (at) => Math.min(...body.sides.map((side) => distance(places[side.corners[0]], places[side.corners.at(-1)], ...at)))
  const roomy = corners.filter((corner) => away(corner) > 2.5 * LONG).sort((a, b) => away(b) - away(a))
  const [x, y] = roomy.find((corner) => space.free(corner, ...ROOM)) ?? []
  if (x === undefined) return
  const tip = [x + LONG * ux, y + LONG * uy]
  g.globalAlpha = 0.75
  g.strokeStyle = look.ink
  g.lineWidth = 1.5
  g.beginPath()
  g.moveTo(x, y)
  g.lineTo(...tip)
  for (const side of [1, -1]) {
    g.moveTo(tip[0] - 8 * (ux - 0.5 * side * uy), tip[1] - 8 * (uy + 0.5 * side * ux))
    g.lineTo(...tip)
  }
  g.stroke()
  const words = `more ${space.told("name", 2 * contact)}`.replace(/ (?=on |between |at )/, "\n")
  space.write(tip[0], tip[1] - 14, words, look.ink, 11, "center")
  g.globalAlpha = 1
}

/** The name of S within it: halfway from its middle to the corner that is farthest from that. */
export function drawName(space, places, middle) {
  const far = ([x, y]) => Math.hypot(x - middle[0], y - middle[1])
  const corner = places.reduce((one, other) => (far(other) > far(one) ? other : one))
  if (far(corner) > 80) space.write((middle[0] + corner[0]) / 2, (middle[1] + corner[1]) / 2, "S", space.look.cold, 22)
}
