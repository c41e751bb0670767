// A packing of 400 disks in a chapter: line widths show forces, blue shows their change, and one
// contact is marked.

import { Scene } from "../../packing/drawing/scene.js"
import { arrow } from "../../browser/canvas_paths.js"

const WIDTH = 0.23 // of a line with the mean force, in largest radii
const FULL = 0.5 // change in mean forces at full blue; orange is for contacts about to slip, as in the small scenes
const REACH = 14 // px from the marked contact within which it can be dragged

export class PackingPicture {
  /** dragged(part): fraction of the height of the picture, upwards, from the start of the drag; null: the
   * drag starts. */
  constructor(host, palettes, dragged) {
    this.scene = new Scene(() => {})
    this.scene.frozen = true // nothing to point at or to select
    this.scene.palette = palettes.scene
    this.scene.onRepaint = () => {}
    this.scene.onMarks = (marks, scene) => this.drawPush(marks, scene)
    this.push = 0
    host.append(this.scene.root)
    this.sized = new ResizeObserver(() => this.scene.resize())
    this.sized.observe(this.scene.root)
    this.listen(host, dragged)
  }

  stop() { this.sized.disconnect() }

  /** A packing, as `frames` in player.py, with one marked contact. */
  show(packing, marked) {
    this.packing = packing
    const count = packing.contacts
    this.style = { width: new Float32Array(count), bin: new Int16Array(count) }
    this.scene.show(packing)
    this.scene.selected = marked
    this.scene.resize()
    this.scene.changed()
  }

  /** The network: normal forces, from grey to blue by their change from `before`, or all grey without it. */
  draw(normal, before, palettes) {
    const { scene, style } = this, colours = palettes.change, middle = colours.length >> 1
    for (let c = 0; c < normal.length; c++) {
      style.width[c] = normal[c] > 1e-6 ? WIDTH * normal[c] : 0
      const part = before ? Math.min(1, Math.abs(normal[c] - before[c]) / FULL) : 0
      style.bin[c] = Math.round(middle * (1 - part))
    }
    style.colours = colours
    scene.palette = palettes.scene
    scene.drawChains(style)
  }

  /** Arrows that push the disks of the marked contact apart. */
  drawPush(marks, scene) {
    if (!this.push || scene.selected === null) return
    const { palette, scale, geometry } = scene
    marks.strokeStyle = palette.selected
    marks.lineWidth = 4 / scale
    marks.beginPath()
    for (const { k, a, b } of scene.segments((contact) => contact === scene.selected)) {
      const far = Math.hypot(b[0] - a[0], b[1] - a[1]), way = [(b[0] - a[0]) / far, (b[1] - a[1]) / far]
      for (const [at, sign, grain] of [[a, -1, geometry.i[k]], [b, 1, geometry.j[k]]]) {
        const from = at.map((v, d) => v + sign * 0.3 * geometry.radius[grain] * way[d])
        arrow(marks, from, from.map((v, d) => v + sign * (0.4 + 1.4 * this.push) * way[d]), 12 / scale, 0.5)
      }
    }
    marks.stroke()
  }

  listen(host, dragged) {
    const { scene } = this
    scene.root.style.pointerEvents = "none" // otherwise the wheel would zoom
    let from = null
    const near = (event) => {
      if (!this.packing) return false
      const k = scene.linkAt(...scene.place(event), REACH)
      return k >= 0 && scene.geometry.contact[k] === scene.selected
    }
    host.addEventListener("pointerdown", (event) => {
      if (!near(event) || !dragged(null)) return
      from = event.clientY
      host.setPointerCapture(event.pointerId)
      event.preventDefault()
    })
    host.addEventListener("pointermove", (event) => {
      if (from !== null) dragged((from - event.clientY) / host.clientHeight)
      else host.style.cursor = near(event) ? "ns-resize" : "default"
    })
    for (const end of ["pointerup", "pointercancel"]) host.addEventListener(end, () => { from = null })
  }
}
