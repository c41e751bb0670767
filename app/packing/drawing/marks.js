// Marks over the chains of a Scene, which provides all positions: the selected contact, axes of
// force space, and forces on a disk.

import { arrow, line, polygon } from "../../browser/canvas_paths.js"

// Lengths are in units of the packing: its largest radius, see geometry.unit.
const ARROW = 1.3 // length for the largest force on a disk
const AXIS = [0.3, 7] // width of a contact whose force is an axis of force space, and at most in px
const OUTLINE = 4 // px between the line of the selected contact and the outline around it
const SMALL = 12 // px, radius of disks that are not marked with their contact
const ROUND = 8 // straight pieces of each end of that outline

/** The forces on a disk, each an arrow that ends at its contact point. */
export function markForces(marks, scene, disk) {
  const { scale, palette, geometry } = scene, { x, y, grain, unit } = geometry
  const forces = scene.describe.forces(grain[disk])
  const most = Math.max(...forces.map(({ fx, fy }) => Math.hypot(fx, fy)))
  const long = ARROW * unit, head = Math.max(0.16 * unit, 6 / scale)
  marks.lineWidth = Math.max(0.07 * unit, 2 / scale)
  marks.strokeStyle = palette.strong
  marks.lineCap = "round"
  marks.beginPath()
  for (const { ax, ay, fx, fy } of forces) {
    if (!(Math.hypot(fx, fy) > 1e-3 * most)) continue
    const ex = x[disk] + ax, ey = y[disk] + ay
    arrow(marks, [ex - (long * fx) / most, ey - (long * fy) / most], [ex, ey], head, 0.5)
  }
  marks.stroke()
}

/** A contact in the colour of its axis of force space. */
export function highlight(marks, scene, chosen, colour) {
  const { scale, palette, geometry: { unit } } = scene
  marks.lineCap = "round"
  for (const [more, paint] of [[3 / scale, palette.halo], [0, colour]]) {
    marks.lineWidth = Math.max(Math.min(AXIS[0] * unit, AXIS[1] / scale), 5 / scale) + more
    marks.strokeStyle = paint
    for (const { a, b } of scene.segments((contact) => contact === chosen)) line(marks, a, b)
  }
}

/** The selected contact: an outline around its line, which stays visible, and its two disks or bodies. */
export function markSelected(marks, scene, selected) {
  const { scale, palette, geometry, width } = scene
  for (const { k, a, b } of scene.segments((contact) => contact === selected)) {
    marks.strokeStyle = palette.selected
    marks.lineWidth = 1.2 / scale
    for (const [at, grain] of [[a, geometry.i[k]], [b, geometry.j[k]]]) {
      if (geometry.radius[grain] * scale < SMALL) continue // hidden behind the outline
      marks.beginPath()
      const { centres } = geometry, body = scene.outline(grain) && 2 * grain < centres.length
      scene.addBody(marks, ...(body ? centres.slice(2 * grain, 2 * grain + 2) : at), grain)
      marks.stroke()
    }
    for (const [paint, wide] of [[palette.halo, 6], [palette.selected, 2.5]]) {
      polygon(marks, around(a, b, width[k] / 2 + OUTLINE / scale))
      marks.strokeStyle = paint
      marks.lineWidth = wide / scale
      marks.stroke()
    }
  }
}

/** Points around the line from a to b at a distance. */
function around(a, b, away) {
  const angle = Math.atan2(b[1] - a[1], b[0] - a[0])
  return [b, a].flatMap((end, k) => Array.from({ length: ROUND + 1 }, (_, n) => {
    const turn = angle + Math.PI * (k - 0.5 + n / ROUND)
    return [end[0] + away * Math.cos(turn), end[1] + away * Math.sin(turn)]
  }))
}
