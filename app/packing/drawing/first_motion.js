// The first motion under a push: an arrow on each disk that moves noticeably, rings around contacts
// that open, and spots on contacts that slide.

import { arrow, circle } from "../../browser/canvas_paths.js"
import { extremes } from "./displacement.js"

const LONGEST = 4 // mean radii, the arrow of the fastest disk
const SHORTEST = 0.6 // mean radii; shorter arrows are not drawn
export const OPENS = 2 // value of a contact that opens; 1: it slides
const RING = 0.3, SPOT = 0.16, LEAST_PX = 2 // radii of the marks, largest radii

/** Rings around contacts that open, and spots on those that slide; contacts: (N_c,) 0, 1 or OPENS. */
export function drawLimits(context, scene, contacts) {
  const { palette, geometry: { unit }, scale } = scene, least = LEAST_PX / scale
  for (const { contact, middle } of scene.segments((c) => contacts[c])) {
    const opens = contacts[contact] === OPENS
    circle(context, middle, Math.max((opens ? RING : SPOT) * unit, opens ? 2 * least : least))
    context.fillStyle = opens ? palette.halo : palette.slides
    context.lineWidth = Math.max((opens ? 0.09 : 0.05) * unit, 1 / scale)
    context.strokeStyle = opens ? palette.strong : palette.halo
    context.fill()
    context.stroke()
  }
}

/** field: flat (2 N,) displacements; contacts: as in drawLimits. */
export function drawMotion(context, scene, { field, contacts }) {
  const { palette, geometry: { x, y, grain, unit }, scale } = scene
  const { mean, most } = extremes(scene, field), per = (LONGEST * mean) / most
  drawLimits(context, scene, contacts)
  context.beginPath()
  context.lineCap = context.lineJoin = "round"
  for (let k = 0; k < x.length; k++) {
    const u = per * field[2 * grain[k]], v = per * field[2 * grain[k] + 1], long = Math.hypot(u, v)
    if (long < SHORTEST * mean) continue
    const from = [x[k] + scene.shift(grain[k], 0), y[k] + scene.shift(grain[k], 1)]
    arrow(context, from, [from[0] + u, from[1] + v], Math.min(0.35 * unit, long / 2.5), 0.5)
  }
  for (const [wide, paint] of [[0.2, palette.halo], [0.09, palette.strong]]) {
    context.lineWidth = Math.max(wide * unit, (10 * wide) / scale)
    context.strokeStyle = paint
    context.stroke()
  }
}
