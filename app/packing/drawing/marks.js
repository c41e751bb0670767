// Marks over the chains of a Scene, which provides all positions: the selected contact, axes of
// force space, and forces on a disk.

import { arrow, circle, line } from "../../browser/canvas_paths.js"

const ARROW = 1.3 // length for the largest force on a disk, in largest radii
const AXIS = [0.3, 7] // width of a contact whose force is an axis of force space, in largest radii, and at most in px

/** The forces on a disk, each an arrow that ends at its contact point. */
export function markForces(marks, scene, disk) {
  const { scale, palette, geometry } = scene, { x, y, r, grain, radius } = geometry
  const forces = scene.describe.forces(grain[disk])
  const most = Math.max(...forces.map(({ fx, fy }) => Math.hypot(fx, fy)))
  const long = ARROW * Math.max(...radius), head = Math.max(0.16, 6 / scale)
  marks.lineWidth = Math.max(0.07, 2 / scale)
  marks.strokeStyle = palette.strong
  marks.lineCap = "round"
  marks.beginPath()
  for (const { nx, ny, fx, fy } of forces) {
    if (!(Math.hypot(fx, fy) > 1e-3 * most)) continue
    const ex = x[disk] + r[disk] * nx, ey = y[disk] + r[disk] * ny
    arrow(marks, [ex - (long * fx) / most, ey - (long * fy) / most], [ex, ey], head, 0.5)
  }
  marks.stroke()
}

/** A contact in the colour of its axis of force space. */
export function highlight(marks, scene, chosen, colour) {
  const { scale, palette } = scene
  marks.lineCap = "round"
  for (const [more, paint] of [[3 / scale, palette.halo], [0, colour]]) {
    marks.lineWidth = Math.max(Math.min(AXIS[0], AXIS[1] / scale), 5 / scale) + more
    marks.strokeStyle = paint
    for (const { a, b } of scene.segments((contact) => contact === chosen)) line(marks, a, b)
  }
}

/** The selected contact, and its two disks. */
export function markSelected(marks, scene, selected) {
  const { scale, palette, geometry } = scene
  marks.strokeStyle = palette.selected
  marks.lineCap = "round"
  for (const { k, a, b } of scene.segments((contact) => contact === selected)) {
    marks.lineWidth = 2 / scale
    for (const [at, grain] of [[a, geometry.i[k]], [b, geometry.j[k]]]) {
      circle(marks, at, geometry.radius[grain])
      marks.stroke()
    }
    marks.lineWidth = Math.max(0.12, 3 / scale)
    line(marks, a, b)
  }
}
