// A packing of 400 disks in a chapter: line widths show forces, blue shows their change, and one
// contact is marked.

import { Scene } from "../../packing/drawing/scene.js"
import { markSelected } from "../../packing/drawing/marks.js"
import { arrow } from "../../browser/canvas_paths.js"

const WIDTH = 0.23 // of a line with the mean force, in largest radii
const FULL = 0.5 // change in mean forces at full blue; orange is for contacts about to slip, as in the small scenes
const REACH = 14 // px from a contact within which it can be dragged

export class PackingPicture {
  /** hand: {takes(contact), take(contact), pulled(part), release()}, as in PackingExperiment. */
  constructor(host, palettes, hand) {
    this.scene = new Scene(() => {})
    this.scene.frozen = true // nothing to point at or to select
    this.scene.palette = palettes.scene
    this.scene.onRepaint = () => {}
    this.scene.onMarks = (marks, scene) => this.drawPush(marks, scene)
    this.push = 0
    this.held = null // the contact in the hand
    host.append(this.scene.root)
    this.sized = new ResizeObserver(() => this.scene.resize())
    this.sized.observe(this.scene.root)
    this.listen(host, hand)
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

  /** An outline of the contact in the hand, and arrows that push the disks of the marked one apart. */
  drawPush(marks, scene) {
    if (this.held !== null) markSelected(marks, scene, this.held)
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

  listen(host, hand) {
    const { scene } = this
    scene.root.style.pointerEvents = "none" // otherwise the wheel would zoom
    let from = null
    /** The contact that a pointer would take: the marked one, if it is in reach, or null. */
    const near = (event) => {
      if (!this.packing) return null
      const at = scene.place(event), link = (chosen) => scene.linkAt(...at, REACH, chosen)
      const marked = link((contact) => contact === scene.selected), k = marked < 0 ? link() : marked
      return k >= 0 && hand.takes(scene.geometry.contact[k]) ? scene.geometry.contact[k] : null
    }
    // By touch only the marked contact is dragged; otherwise the page scrolls under the finger.
    host.addEventListener("touchstart", (event) => {
      if (near(event.touches[0]) === scene.selected) event.preventDefault()
    }, { passive: false })
    host.addEventListener("pointerdown", (event) => {
      const contact = near(event)
      if (contact === null || (event.pointerType === "touch" && contact !== scene.selected)) return
      this.held = contact
      hand.take(contact)
      from = event.clientY
      host.setPointerCapture(event.pointerId)
      event.preventDefault()
    })
    host.addEventListener("pointermove", (event) => {
      if (from !== null) hand.pulled((from - event.clientY) / host.clientHeight)
      else host.style.cursor = near(event) === null ? "default" : "ns-resize"
    })
    for (const end of ["pointerup", "pointercancel"]) host.addEventListener(end, () => {
      if (from === null) return
      from = this.held = null
      hand.release()
    })
  }
}
