// Labels of the forces in a small scene: their values and, for a single disk, their names.

import { font } from "../../browser/canvas_paths.js"
import { distance } from "../model/polytope.js"
import { number } from "../model/sentences.js"

const NAMED = 12 // px: least distance of a foot from the weight
const SMALL = 300 // px: height of a drawing in which values have no names
export const ASIDE = 9 // px between friction and the wall that would cover it

/** Values next to the forces used as axes of S, two at most, on the side of each with more room. */
export function drawValues(arrows, F) {
  const { context: g, body, look } = arrows
  if (look.axes?.size > 2) return
  g.font = font("bold 12px")
  g.textAlign = "center"
  g.textBaseline = "middle"
  for (const [force, colour] of look.axes ?? []) {
    const text = `${arrows.easel.high < SMALL ? "" : force % 2 ? "tangential " : "normal "}${number(F[force], look.places)}`, wide = g.measureText(text).width / 2 + 3
    const ends = arrows.ends().filter(({ contact }) => contact === force >> 1), { at, across } = ends[0]
    const inward = ends.reduce((sum, end) => sum.map((v, k) => v + end.inward[k]), [0, 0]) // 0 between two disks
    const out = wide * Math.abs(across[0]) + 13, along = Math.max(0.3 * body.scene.r[ends[0].disk] * arrows.unit, wide + 4) // clear of a wall
    const [x, y] = arrows.px(...at).map((v, k) => v + along * [inward[0], -inward[1]][k])
    const places = [1, -1].map((side) => [x + side * out * across[0], y - side * out * across[1]])
    const room = places.map((place) => Math.min(...arrows.shafts.map(([a, b]) => distance(a, b, ...place))))
    const [px, py] = places[room[1] > room[0] + 4 ? 1 : 0]
    g.lineWidth = 3
    g.strokeStyle = look.fill
    g.strokeText(text, px, py)
    g.fillStyle = colour
    g.fillText(text, px, py)
    arrows.shafts.push([[px - wide, py], [px + wide, py]]) // keeps numbers of disks away
  }
}

/** Next to the only disk: the force of each wall, in numbers, and the weight. */
export function drawNames(arrows, F) {
  const { context: g, body, look } = arrows, { scene } = body
  g.font = font("13px")
  g.textBaseline = "middle"
  const [cx, cy] = arrows.centre(0)
  const write = (x, y, lines, align) => {
    g.textAlign = align
    const middle = Math.min(y, arrows.easel.high - 8.5 * lines.length - 2) // in the picture
    lines.forEach((line, k) => {
      g.fillStyle = k ? look.cold : look.ink
      g.fillText(line, x, middle + 17 * (k - (lines.length - 1) / 2))
    })
  }
  for (const { contact, at, inward, across } of arrows.ends()) {
    const [px, py] = arrows.px(...at), [n, t] = [F[2 * contact], F[2 * contact + 1]], [ux, uy] = [-inward[0], inward[1]]
    const along = [t * across[0], t * across[1]], way = Math.abs(t) < 5e-4 ? "" : Math.abs(along[1]) > Math.abs(along[0]) - 1e-9 ? `, ${along[1] > 0 ? "up" : "down"}` : along[0] > 0 ? ", right" : ", left"
    const rubs = ["friction", `${number(Math.abs(t), look.places)}${way}`], x = px + 22 * ux, room = ux > 0 ? arrows.easel.wide - x : x
    const fits = (line) => g.measureText(line).width < room - 4
    const both = fits(rubs.join(" ")) ? [rubs.join(" ")] : rubs
    const name = ["force from the ", ""].map((before) => scene.names[contact].replace("at the ", before)).find(fits) ?? ""
    const pressed = ["normal force", "normal"].map((word) => `${word} ${number(n, look.places)}`).find(fits) ?? number(n, look.places)
    const lines = look.unnamed ? [name] : [name, pressed, ...both]
    const foot = arrows.outline(0) && px < cx - NAMED ? "left" : undefined // away from the weight
    const side = Math.abs(ux) < 0.3 ? name.match(/(left|right) end/)?.[1] ?? foot : ux > 0 ? "right" : "left" // away from the other end
    write(x, py + 34 * uy, lines, { left: "right", right: "left" }[side] ?? "center")
  }
  const load = Math.hypot(body.load[0], body.load[1]), thin = arrows.outline(0)
  if (load > 1e-9) write(cx + (thin ? 8 : 0), cy + (thin ? load * arrows.forceUnit : -0.55 * scene.r[0]) * arrows.unit, [`${load === Math.hypot(scene.load[0], scene.load[1]) ? "weight" : "weight and push"} ${Number(load.toPrecision(3))}`], thin ? "left" : "center")
}
