// How the bodies of a small scene move once no forces hold them: past the ends of S, and where S is empty.
// A pose is how far a body is from its place: [to the right, upwards, turned].

import { dot, solve } from "./polytope.js"

const FIXED = 1e-9 // keeps a turn at rest that no contact prevents; forces below are none
const SMALL = 1e-6 // speeds, if that of the wall is 1
const STEPS = 200, TURN = 0.01 // of a slide: most steps, and the turn of each
const FLAT = 0.1 // angle with the floor at which a slide ends

/** A pose for every body, from a motion [v_x, v_y, spin × r] for each. */
const posed = ({ r }, motion) => Array.from(r, (size, d) => [motion[3 * d], motion[3 * d + 1], motion[3 * d + 2] / size])

/**
 * The motion at an end of the interval of a normal force, sign 1 or −1: the wall moves by 1 towards or away from the
 * body, contacts at their limit slip or open, all others stay closed and do not slip. Null unless bodies can move so, against all
 * friction.
 */
export function givesWay(body, contact, sign) {
  const { scene, count } = body, F = body.forces(), width = 2 * count, equations = scene.b.length
  const rates = Array.from({ length: width }, (_, k) => Array.from({ length: equations }, (_, e) => scene.A[e * width + k]))
  const slips = Array.from({ length: count }, (_, c) => body.slides(F[2 * c], F[2 * c + 1]))
  const kept = rates.map((_, k) => F[k - (k % 2)] > FIXED && !(k % 2 && slips[k >> 1]))
  const rows = rates.filter((_, k) => kept[k]), goal = rates.map((_, k) => (k === 2 * contact ? sign : 0)), wanted = goal.filter((_, k) => kept[k])
  const columns = Array.from({ length: equations }, (_, e) => rows.map((row) => row[e]))
  const motion = solve(columns.map((a, e) => columns.map((b, f) => dot(a, b) + (e === f ? FIXED : 0))), columns.map((column) => dot(column, wanted)))
  const allowed = rates.every((rate, k) => {
    const speed = dot(rate, motion)
    return kept[k] ? Math.abs(speed - goal[k]) < SMALL : k % 2 ? F[k] * speed < SMALL : speed > -SMALL // slips against its friction, or opens
  })
  if (!allowed) return null
  const all = new Float64Array(3 * scene.r.length)
  ;[...scene.grains].forEach((grain, k) => all.set(motion.slice(3 * k, 3 * k + 3), 3 * grain))
  return posed(scene, all)
}

/** The part of these poses, 0 to 1 or more. */
export const part = (poses, share) => poses.map((pose) => pose.map((v) => share * v))

/** Poses, one after the other, of a single body whose two contacts, points of it, slide along their walls until it lies flat. */
export function slide({ scene, load }, ends) {
  const centre = [scene.x[0], scene.x[1]], arms = ends.map(({ at }) => at.map((v, k) => v - centre[k])), poses = []
  let [x, y, turn] = [0, 0, 0]
  for (let step = 0; step < STEPS; step++) {
    poses.push([[x, y, turn]])
    const [c, s] = [Math.cos(turn), Math.sin(turn)], now = arms.map(([a, b]) => [c * a - s * b, s * a + c * b])
    const along = now[1].map((v, k) => v - now[0][k])
    if (Math.abs(along[1]) < FLAT * Math.hypot(...along)) break
    const [p, q] = ends.map(({ inward: [n, m] }, k) => [n, m, n * -now[k][1] + m * now[k][0]])
    const way = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
    const size = (TURN * Math.sign(dot(way, load))) / Math.abs(way[2])
    ;[x, y, turn] = [x + size * way[0], y + size * way[1], turn + size * way[2]]
  }
  return poses
}
