// What the page of a small scene says: what stops S at a side, what is counted, what is on screen, in a sentence.

const number = (v) => (Math.abs(v) < 5e-4 ? "0" : v.toFixed(Math.abs(v) < 10 ? 3 : 1))
const plural = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`

/** What happens at a side of S, in words: which contacts slide or open there. */
function stopping({ scene }, side) {
  const kinds = new Map()
  for (const [contact, what] of side.stops) {
    const [, disk, place] = scene.names[contact].match(/^(disk \d+ )?(.*)$/)
    const verb = `${disk ?? ""}${what === OPENS ? "opens" : `slides${way(scene, contact, what)}`}`
    kinds.set(verb, [...(kinds.get(verb) ?? []), place])
  }
  return [...kinds].map(([verb, places]) => `${verb} ${places.join(" and ")}`).join(", ").replace("at the left wall and at the right wall", "at both walls")
}

/** Where a disk is about to slide at a wall: against the friction on it. */
function way(scene, contact, what) {
  if (scene.j[contact] < scene.r.length) return ""
  const [x, y] = [-what * scene.normal[2 * contact + 1], what * scene.normal[2 * contact]]
  return Math.abs(y) > 0.3 ? (y > 0 ? " up" : " down") : x > 0 ? " right" : " left"
}

/** Forces less equations, as HTML. */
function counted({ h, count, scene }) {
  const walls = scene.pressing.length ? "every disk's forces and torque must balance, and the forces on every wall that presses"
    : `every disk's forces and torque must balance${scene.box[0] ? ", and the pressure is given" : ""}`
  return `<b>${2 * count} forces − ${scene.equations ?? 0} equations = ${h} free</b> ` +
    `<span>(${plural(count, "contact")} with a normal and a tangential force each; ${walls})</span>`
}

/** What the picture of S is. */
function pictured(body) {
  const { h, whole, empty, corners, scene } = body, S = `S, all sets of forces that hold the ${scene.r.length > 1 ? "disks" : "disk"}:`
  if (scene.idle) return "S: not before something presses"
  if (empty) return "S: empty"
  if (!h || (whole && corners.length === 1)) return `${S} a single point`
  return h > 3 ? `one shadow of S, which has ${h} dimensions; its outline is exact`
    : `${S} ${["", "a line", "a polygon, in its true shape", "a body; drag beside the point to turn it"][h]}`
}

/** The sentence over a scene. */
function sentence(body, mu, now) {
  const { h, scene } = body, several = scene.r.length > 1
  if (scene.idle) return "Nothing presses on these disks yet: choose “Let a wall press”, then click a wall."
  if ([...scene.pressing].some((_, k) => !scene.j.includes(scene.r.length + k))) return "A wall presses on no disk, and nothing holds it: put a disk against it."
  if (body.empty) return falling(scene, mu, now.fall)
  if (!h) return "Everything is determined: there is one network of forces, and mechanics finds it."
  if (body.whole && body.corners.length === 1) {
    return mu ? "S is one point: of all forces in balance, only these stay in their cones. Everything is determined."
      : "Without friction S is one point: everything is determined. Open the cones with the slider."
  }
  if (!body.bounded) {
    const wedged = several ? "the disks have wedged themselves" : "the disk has wedged itself"
    const full = now.filled ? " Nothing can fill it evenly: what has no end has no volume to draw from." : ""
    return `S has no end in some direction: ${wedged}, and the forces may be as large as you like. (Proof: a change of forces that is in balance by itself and stays in every cone.)${full}`
  }
  if (h > 3) return `${h} free numbers: infinitely many networks of forces hold these disks. What is drawn is one shadow of S, on two of the forces: each of its points stands for many networks. Drag the point or an arrow: all forces follow, and everything stays in balance.`
  const fixed = scene.names.filter((_, c) => { const [low, high] = body.interval(2 * c); return high - low < 1e-9 * body.scaleOf() }).length
  const determined = fixed ? ` ${fixed} of ${body.count} normal forces are determined all the same.` : ""
  return `Every point of this ${["", "line", "polygon", "body"][h]} is one way to hold the same ${several ? "disks" : "disk"}, in balance, within friction. Drag the point, or an arrow.${determined}`
}

/** Why S is empty: which disks and walls give way in the motion that proves it. */
function falling({ r }, mu, motion) {
  const moving = motion ? Array.from({ length: motion.length / 3 }, (_, k) => k).filter((k) => Math.hypot(...motion.slice(3 * k, 3 * k + 3)) > 0.05) : []
  const disks = moving.filter((k) => k < r.length).map((k) => k + 1), pressed = disks.length < moving.length
  const which = [disks.length ? `disk${disks.length > 1 ? "s" : ""} ${disks.join(", ")}` : "", pressed ? "the wall that presses" : ""].filter(Boolean).join(" and ")
  const why = moving.length ? ` The orange arrows show how ${which} give${moving.length > 1 ? "" : "s"} way: along that motion the loads do work, and no force allowed at any contact takes it up. That proves it.` : ""
  return `Nothing balances at μ = ${Number(mu.toPrecision(4))}: S is empty.${why}`
}
