// What a visitor has found of S who is to find out how far it goes: on a line from where to where the point
// has been, elsewhere its way and the sides that it has touched.

import { distance } from "../learn/model/polytope.js"

const FOUND = 4 // pixels: so near to a side or an end the point is at it
const LONGEST = 600 // places of the way

export class Fog {
  /** The point is here, in this S. */
  visit(space) {
    const { body } = space, at = space.flat(body.u)
    if (this.of !== body.axes || this.mu !== body.mu) Object.assign(this, { of: body.axes, mu: body.mu, ends: [at[0], at[0]], way: [], sides: new Set() })
    this.ends = [Math.min(this.ends[0], at[0]), Math.max(this.ends[1], at[0])]
    const before = this.way.at(-1)
    if (!before || at.some((v, k) => v !== before[k])) this.way.push(at)
    if (this.way.length > LONGEST) this.way.shift()
    this.at = space.px(at)
  }

  /** Of both ends of a line, in pixels, those that were reached; each with whether it is the end itself. */
  reached(space, whole) {
    const seen = this.ends.map((x) => space.px([x, 0]))
    return whole.map(([x, y]) => {
      const [near] = seen.reduce((one, other) => (Math.abs(other[0] - x) < Math.abs(one[0] - x) ? other : one))
      return { at: [near, y], found: Math.abs(near - x) < FOUND }
    })
  }

  /** Whether the point has been at this side, from a to b in pixels. */
  touched(side, a, b) {
    const name = side.corners.join()
    if (distance(a, b, ...this.at) < FOUND) this.sides.add(name)
    return this.sides.has(name)
  }

  /** Its way; and, where it has not gone yet, that there is more to be found. */
  draw(space) {
    const { context: g, look } = space, [x, y] = this.at
    g.strokeStyle = look.cold
    g.globalAlpha = 0.5
    g.lineWidth = 2
    g.beginPath()
    for (const place of this.way) g.lineTo(...space.px(place))
    g.stroke()
    g.globalAlpha = 1
    const ways = [[-40, 0], [40, 0], [0, -40], [0, 40]].slice(space.ray ? 1 : 0) // none on the goal's line
    if (look.fresh) for (const [dx, dy] of ways) space.write(x + dx, y + dy, "?", look.edge, 22)
  }
}
