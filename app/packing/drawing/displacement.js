// A displacement field moves the disks out and back to their places, again and again; the largest
// displacement is one mean radius. A motion under a push has a direction: it is never drawn backwards.

const SWING = 2.2 // s, out and back

/** The mean radius of the disks, and the largest displacement of a field, flat (2 N,). */
export function extremes(scene, field) {
  let most = 0
  for (let g = 0; g < field.length; g += 2) most = Math.max(most, Math.hypot(field[g], field[g + 1]))
  const radii = Array.from(scene.geometry?.radius ?? []).filter((r) => r > 0)
  return { mean: radii.reduce((sum, r) => sum + r, 0) / radii.length, most }
}

export class Sway {
  constructor(scene) { this.scene = scene }

  /** field: flat (2 N,) displacements, or null to stop. */
  take(field) {
    const { scene } = this, was = scene.offset, { mean, most } = extremes(scene, field ?? [])
    scene.offset = most > 0 ? { field, most: mean / most, amplitude: 0 } : null
    if (scene.offset && !was) requestAnimationFrame((now) => { this.began = now; this.swing(now) })
    if (!scene.offset && scene.geometry) scene.changed()
  }

  swing(now) {
    const { scene } = this
    if (!scene.offset || !scene.root.isConnected) return
    scene.offset.amplitude = (scene.offset.most * (1 - Math.cos((2 * Math.PI * (now - this.began)) / (1000 * SWING)))) / 2
    scene.repaint()
    requestAnimationFrame((next) => this.swing(next))
  }
}
