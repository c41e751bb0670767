// Sentences about a small scene: the events at a side of S, the count, and what is on screen.

import { OPENS } from "./polytope.js"

export const number = (v, places = 3) => (Math.abs(v) < 5e-4 ? "0" : v.toFixed(Math.abs(v) < 10 ? places : 1))
const plural = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`
const listed = (words) => [words.slice(0, -1).join(", "), words.at(-1)].filter(Boolean).join(" and ")

const BOTH = "at the left wall and at the right wall"
// A disk between two walls cannot slide down both, nor a ladder up one: friction is at its limit.
const PUSHED = { "about to slide up": "down\nas hard as it can", "about to slide down": "up\nas hard as it can" }

/** A force in words: 2 c for the normal one of contact c, 2 c + 1 for the tangential one. */
export function forceName(scene, index) {
  return `${index % 2 ? "tangential" : "normal"} force ${placeName(scene, index >> 1)}`
}

/** Where the force of a contact acts, in words. */
export function placeName({ names, one }, contact) { return `${names[contact].startsWith(one) ? "on " : ""}${names[contact]}` }

/** The event at a side of S, in words: which contacts are about to slide or to open there. */
export function stopping({ scene }, side) {
  const kinds = new Map()
  for (const [contact, what] of side.stops) {
    const [, disk, place] = scene.names[contact].match(/^([a-z]+ \d+ )?(.*)$/)
    const verb = `${disk ?? ""}${what === OPENS ? "would lose contact" : `about to slide${way(scene, contact, what)}`}`
    kinds.set(verb, [...(kinds.get(verb) ?? []), place])
  }
  return [...kinds].map(([verb, places]) => {
    const where = places.join(" and "), both = where === BOTH, way = both || scene.one === "ladder" ? PUSHED[verb] : null
    return way ? `friction${both ? "" : " at the wall"} pushes the ${scene.one} ${way}` : `${verb} ${both ? "at both walls" : where}`
  }).join(", ")
}

/** The direction in which a disk is about to slide: against the friction on it; for two disks, the sense of
 * rotation. */
function way(scene, contact, what) {
  if (scene.j[contact] < scene.r.length) return scene.one !== "disk" ? "" : what > 0 ? " clockwise" : " anticlockwise"
  const [x, y] = [-what * scene.normal[2 * contact + 1], what * scene.normal[2 * contact]]
  return Math.abs(y) > 0.3 ? (y > 0 ? " up" : " down") : x > 0 ? " right" : " left"
}

/** The legend of the picture of the disks in this scene. */
export function legend(body) {
  const { scene, h, empty, load } = body
  if (empty && !scene.idle) return "orange: the motion in which they give way; grey: weight and other loads"
  const pulled = load.some((v, k) => k < 3 * scene.r.length && v), pressed = scene.pressing.length > 0
  const weights = Array.from(scene.r, (_, d) => Math.hypot(load[3 * d], load[3 * d + 1]))
  const each = weights.every((w) => Math.abs(w - weights[0]) < 1e-9) ? ` ${Number(weights[0].toPrecision(3))}${weights.length > 1 ? " each" : ""}` : ""
  const loads = [pulled ? `weight${each}` : "", pressed ? "the press" : ""].filter(Boolean).join(", ")
  const parts = scene.r.length < 4 ? "normal parts, " : ""
  const axes = h === 2 || h > 3 ? `; green, violet: ${parts}plotted on the right` : ""
  const heads = scene.r.length > 2 ? " (in opposite pairs)" : ""
  return `blue: contact forces${heads}${axes}${body.crowded ? "" : "; wedge: where a force may point"}${loads ? `; grey: ${loads}` : ""}${slips(body) ? "; grey wedge: friction at its limit" : ""}`
}

/** Whether friction is at its limit at any contact. */
function slips(body) {
  const F = body.forces()
  return Array.from(body.scene.i).some((_, c) => F[2 * c] > 1e-9 && body.slides(F[2 * c], F[2 * c + 1]))
}

/** Forces minus equations, as HTML; if S is empty, that no solution is allowed. */
export function counted({ h, count, scene, empty, consistent, whole, corners }) {
  const equations = scene.equations ?? 0, [sum, why] = equationsOf(scene)
  const forces = plural(count, "contact") + ", each with a normal and a tangential component"
  if (scene.idle) return `<b>${2 * count} unknown force components</b> <span>(${forces}; without a load all of them can be 0)</span>`
  if (empty) {
    const none = consistent ? "none of their solutions is allowed" : "they have no solution"
    const because = consistent ? "; in every solution some contact would have to pull, or its tangential force to exceed μ × its normal force" : ""
    return `<b>${2 * count} unknown force components; ${sum}: ${none}</b> <span>(${forces}${because})</span>`
  }
  const point = h && whole && corners.length === 1 ? `, but the wedges leave ${h > 1 ? "them" : "it"} no room` : ""
  const free = h === 1 ? "number" : "numbers"
  const statement = `<b>${2 * count} unknown force components − ${equations} equations = ${h} free ${free}${point}</b>`
  return scene.box[0] ? `${statement} <details><summary>Why ${equations}?</summary>${sum}: ${why} (${forces}).</details>` : `${statement} <span>(${forces}; ${sum}: ${why})</span>`
}

/** The sum that gives the number of equations, and its parts. */
function equationsOf({ grains, r, pressing, box, equations }) {
  const disks = box[0] ? [...(grains ?? [])].filter((grain) => grain < r.length).length : r.length, walls = 2 * pressing.length // loose disks of a box have no load
  const whole = box[0] ? 3 * disks - 1 : 3 * disks + walls
  const conditions = `no net force sideways, none up or down, and no turning${disks > 1 ? ", for each disk" : ""}`
  if (box[0]) return [`${disks} disks × 3 − 2 + 1 = ${whole} equations`, `three for each disk, less two that follow from the others, plus one for the pressure`]
  const rank = (equations ?? whole) === whole ? "" : `, of which ${equations} are independent`
  return [`${plural(disks, "disk")} × 3${walls ? ` + ${walls}` : ""} = ${whole} equations${rank}`, conditions + (walls ? "; and two of the wall that presses" : "")]
}

/** The meaning of the bars below; empty if there are none. */
export function barred({ empty, h, scene }) {
  return empty || !h || scene.idle ? "" : "The range of each normal force (bar), and its value now (red):"
}

/** Special features of a scene, besides its forces; empty for most. */
export function special({ scene }) {
  if (!scene.box[0]) return ""
  const touched = new Set([...scene.i, ...scene.j])
  const loose = Array.from(scene.r, (_, k) => k).filter((k) => !touched.has(k)).map((k) => k + 1)
  const rattles = loose.length ? ` Disk ${listed(loose)} ${loose.length > 1 ? "are" : "is"} loose: no disk presses on ${loose.length > 1 ? "them" : "it"}, so that ${loose.length > 1 ? "they take" : "it takes"} no part.` : ""
  return `${scene.r.length} disks squeezed from all sides by pressure ${Number(scene.pressure.toPrecision(3))}, without gravity. The dashed square repeats in all directions; faint disks are copies.${rattles}`
}

/** The meaning of the picture of S. */
export function pictured(body, { filled: dotted }) {
  const { h, whole, empty, corners, scene } = body, S = `S: every way to hold the ${scene.r.length > 1 ? "disks" : "disk"} (here:`
  if (scene.idle) return "S: nothing presses yet"
  if (empty) return "S: empty"
  if (!h || (whole && corners.length === 1)) return `${S} a single point)`
  return h > 3 ? `shadow (projection) of S onto two of the forces${body.most ? `; S has no end: drawn where no normal force is above ${number(body.most)}` : ""}${dotted ? "; dots: random points, rarely near its edge" : ""}`
    : `${S} ${["", "a line)", "a polygon); axes: normal parts of the green and the violet force", "a body; drag beside the point to turn it)"][h]}`
}

/** The sentence above a scene. */
export function sentence(body, mu, now) {
  const { h, scene } = body, several = scene.r.length > 1
  if (scene.idle) return "Nothing presses on these disks yet: choose “Make a wall press”, then click a wall."
  if ([...scene.pressing].some((_, k) => !scene.j.includes(scene.r.length + k))) return "A wall presses on no disk, and nothing holds it: put a disk against it."
  if (body.empty) return falling(body, mu, now)
  if (!h) return "Everything is determined: there is one set of forces, and mechanics finds it."
  if (body.whole && body.corners.length === 1) {
    return mu ? "S is one point: of all forces in balance, only these stay in their wedges. Everything is determined."
      : "Without friction S is one point: everything is determined. Open the wedges with the slider."
  }
  if (!body.bounded) {
    const jammed = several ? "the disks have jammed themselves" : "the disk has jammed itself"
    const filled = now.filled ? " As S is infinite, evenly spread random points are impossible." : ""
    return `S has no end${h > 1 ? " in some direction" : ""}: ${jammed}, and the forces may be as large as you like. The wedges are so wide that ${several ? "some disks can be pressed" : "the walls can press it"} from opposite sides, as hard as you like: such forces cancel, and can be added to any that hold.${filled}`
  }
  if (h > 3) return `Every point of S (the set of all solutions) is one set of forces that holds them. S has ${h} dimensions, so the plot shows its shadow: only the green and the violet force. Wherever you drag the red dot in it, the other forces change just enough to keep every disk in balance.`
  const opens = body.sides.some(({ stops }) => stops.some(([, what]) => what === OPENS))
  const limit = `${["", "an end", "a side", "a face"][h]}: there, a contact is about to slip${opens ? " or open" : ""}`
  const every = `Every point of the blue ${["", "line", "polygon", "body"][h]} S (the set of all solutions) is one set of forces that holds the same ${several ? "disks" : "disk"} at rest.`
  return `${every} Drag the point to ${limit}. Or drag an arrow.`
}

/** Why S is empty: the disks and walls that give way in the motion that proves it, and a sufficient friction. */
function falling({ scene: { r, box, pressing, load: weights }, load }, mu, { fall, enough }) {
  const moving = fall ? Array.from({ length: fall.length / 3 }, (_, k) => k).filter((k) => Math.hypot(...fall.slice(3 * k, 3 * k + 3)) > 0.05) : []
  const disks = moving.filter((k) => k < r.length).map((k) => k + 1), pressed = disks.length < moving.length
  const which = [disks.length ? `disk${disks.length > 1 ? "s" : ""} ${listed(disks)}` : "", pressed ? "the wall that presses" : ""].filter(Boolean).join(" and ")
  const pushed = load.some((v, k) => v !== weights[k]) ? " and the push" : ""
  const loads = pressing.length ? "the press does" : box[0] ? `the pressure${pushed} does` : `the weights${pushed} do`
  const why = moving.length ? ` The orange arrows show how ${which} give${moving.length > 1 ? "" : "s"} way. In this motion ${loads} work, and the contacts cannot balance them.` : ""
  const mended = enough ? ` With friction of at least μ = ${enough} it would hold.` : ""
  return `Nothing balances at μ = ${Number(mu.toPrecision(4))}: S is empty.${mended}${why}`
}
