// Beside a polygon S: which way in it two of the forces grow, as arrows, since no axis of it is one.

import { distance } from "./body.js"

const LONG = 36 // pixels of an arrow
const ROOM = [270, 120] // pixels that arrows and words take
const CORNER = [150, 80] // pixels from the picture's corner to where the arrows begin

/** Two contacts whose normal forces grow in the most different ways, with these: [[contact, way], …]. */
function waysOf({ count, axes }, sign) {
  const slopes = Array.from({ length: count }, (_, c) => [sign * axes[0][2 * c], -axes[1][2 * c]])
  let best = null, most = 1e-6
  for (let a = 0; a < count; a++) for (let b = 0; b < a; b++) {
    const turned = Math.abs(slopes[a][0] * slopes[b][1] - slopes[a][1] * slopes[b][0])
    if (turned > most) { most = turned; best = [a, b] }
  }
  return (best ?? []).map((c) => [c, slopes[c].map((v) => v / Math.hypot(...slopes[c]))])
}

/** Arrows and words in a corner of the picture, far from S (its corners: places), if there is room. */
export function drawCompass(space, places) {
  const { context: g, body, look, easel: { wide, high } } = space, ways = waysOf(body, space.sign)
  const corners = [[0, 1], [1, 1], [1, 0], [0, 0]].map(([a, b]) => [a ? wide - CORNER[0] : CORNER[0], b ? high - CORNER[1] : CORNER[1]])
  const away = (at) => Math.min(...body.sides.map((side) => distance(places[side.corners[0]], places[side.corners.at(-1)], ...at)))
  const roomy = corners.filter((corner) => away(corner) > 3 * LONG).sort((a, b) => away(b) - away(a))
  const [x, y] = roomy.find((corner) => space.free(corner, ...ROOM)) ?? []
  if (x === undefined) return
  g.globalAlpha = 0.75
  for (const [contact, [ux, uy]] of ways) {
    const tip = [x + LONG * ux, y + LONG * uy]
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
    g.font = "11px sans-serif"
    const half = Math.max(...words.split("\n").map((line) => g.measureText(line).width)) / 2
    space.write(tip[0] + (half + 6) * ux, tip[1] + 20 * uy, words, look.ink, 11, "middle")
  }
  g.globalAlpha = 1
}

/** The name of S within it: halfway from its middle to the corner that is farthest from that. */
export function drawName(space, places, middle) {
  const far = ([x, y]) => Math.hypot(x - middle[0], y - middle[1])
  const corner = places.reduce((one, other) => (far(other) > far(one) ? other : one))
  if (far(corner) > 80) space.write((middle[0] + corner[0]) / 2, (middle[1] + corner[1]) / 2, "S", space.look.cold, 22)
}
