// Where a body of a built scene can touch another: distances, and the curves of its centre in contact.

import { inside } from "../../browser/canvas_paths.js"
import { distance, dot, solve } from "./polytope.js"

const CORNER = 1e-3 // from the end of an edge, where two corners meet and determine no normal

const less = (a, b) => [a[0] - b[0], a[1] - b[1]]
const plus = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1]]
const length = (a) => Math.hypot(...a)

/** The corners of a row of the scene, anticlockwise, and the radius around them: a disk (x, y, r) has one corner, a wall
 * (x, y, x, y) two, a block (x, y, width, height, degrees) four. */
export function shape([x, y, a, b, degrees]) {
  if (b === undefined) return { corners: [[x, y]], round: a }
  if (degrees === undefined) return { corners: [[x, y], [a, b]], round: 0 }
  const c = Math.cos((degrees * Math.PI) / 180), s = Math.sin((degrees * Math.PI) / 180)
  const corners = [[-a, -b], [a, -b], [a, b], [-a, b]].map(([p, q]) => [x + (p * c - q * s) / 2, y + (p * s + q * c) / 2])
  return { corners, round: 0 }
}

/** The edges of a shape with their outward normals; a wall has one for each side. */
function edges({ corners }) {
  if (corners.length < 2) return []
  return corners.map((a, k) => {
    const b = corners[(k + 1) % corners.length], along = less(b, a).map((v) => v / length(less(b, a)))
    return { ends: [a, b], along, out: [along[1], -along[0]] }
  })
}

/** The distance of two shapes, negative if they overlap. */
export function gap(one, other) {
  if (other.corners.length === 1) return beyond(one, other.corners[0]) - one.round - other.round
  if (one.corners.length === 1) return gap(other, one)
  const apart = (a, b) => edges(a).map(({ ends, out }) => Math.min(...b.corners.map((corner) => dot(less(corner, ends[0]), out))))
  return Math.max(...apart(one, other), ...apart(other, one))
}

/** The distance of a point from a polygon without its radius, negative inside. */
function beyond({ corners }, at) {
  const far = Math.min(...corners.map((a, k) => distance(a, corners[(k + 1) % corners.length], ...at)))
  return corners.length > 2 && inside(corners, at) ? -far : far
}

/** The curves on which the centre of a shape, given around (0, 0), lies if it touches another. */
export function contactCurves(moved, other) {
  const reach = moved.round + other.round, curves = []
  const add = (points, along, out) => {
    const [first, ...more] = points.sort((p, q) => dot(less(p, q), along)), end = reach ? 0 : CORNER
    curves.push({ of: other, from: plus(first, out, reach), along, low: end, high: dot(less(more.at(-1), first), along) - end })
  }
  for (const { ends, along, out } of edges(other)) {
    const near = lowest(moved, out)
    add(ends.flatMap((end) => near.map((corner) => less(end, corner))), along, out)
  }
  for (const { ends, along, out } of edges(moved)) {
    const near = lowest(other, out)
    add(ends.flatMap((end) => near.map((corner) => less(corner, end))), along, out.map((v) => -v))
  }
  if (reach) for (const a of other.corners) for (const b of moved.corners) curves.push({ of: other, centre: less(a, b), reach })
  return curves
}

/** The corners of a shape that lie lowest along a direction. */
function lowest({ corners }, out) {
  const least = Math.min(...corners.map((corner) => dot(corner, out)))
  return corners.filter((corner) => dot(corner, out) < least + 1e-9)
}

/** The point of a curve nearest to a position. */
export function foot(curve, at) {
  const from = less(at, curve.centre ?? curve.from)
  if (curve.centre) return plus(curve.centre, from, curve.reach / (length(from) || 1))
  return plus(curve.from, curve.along, Math.min(curve.high, Math.max(curve.low, dot(from, curve.along))))
}

/** Whether a position lies beside a curve, not beyond its ends. */
export function beside(curve, at) {
  const s = curve.centre ? 0 : dot(less(at, curve.from), curve.along)
  return curve.centre || (s >= curve.low && s <= curve.high)
}

/** The points where curves of contact with two bodies meet. */
export function meet(one, other) {
  return one.of === other.of ? [] : crossings(one, other).filter((at) => beside(one, at) && beside(other, at))
}

function crossings(one, other) {
  if (one.along && other.along) {
    const s = solve([[one.along[0], -other.along[0]], [one.along[1], -other.along[1]]], less(other.from, one.from))
    return s ? [plus(one.from, one.along, s[0])] : []
  }
  if (other.along) return crossings(other, one)
  if (one.along) {
    const s = dot(less(other.centre, one.from), one.along), base = plus(one.from, one.along, s)
    const far = length(less(base, other.centre)), half = Math.sqrt(Math.max(0, other.reach ** 2 - far ** 2))
    return far > other.reach ? [] : [-half, half].map((t) => plus(base, one.along, t))
  }
  const [dx, dy] = less(other.centre, one.centre), far = Math.hypot(dx, dy)
  if (!far || far > one.reach + other.reach || far < Math.abs(one.reach - other.reach)) return []
  const s = (far ** 2 + one.reach ** 2 - other.reach ** 2) / (2 * far), half = Math.sqrt(Math.max(0, one.reach ** 2 - s ** 2))
  return [-half, half].map((t) => [one.centre[0] + (s * dx - t * dy) / far, one.centre[1] + (s * dy + t * dx) / far])
}
