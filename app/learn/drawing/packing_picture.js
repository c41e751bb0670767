// A packing of 400 disks in a chapter: line widths show forces, blue and orange their change, as in Explore, and
// one contact is marked.

import { Scene } from "../../packing/drawing/scene.js"
import { drawLimits, drawMotion } from "../../packing/drawing/first_motion.js"
import { markSelected } from "../../packing/drawing/marks.js"
import { arrow } from "../../browser/canvas_paths.js"

const WIDTH = 0.23 // of a line with the mean force, in largest radii
const FULL = 0.5 // change in mean forces at full colour
const ARROW = { rest: 0.8, grown: 1.6 } // lengths of the push in largest radii
const REACH = 14 // px from a contact within which it can be dragged

export class PackingPicture {
  /** hand: {takes(contact), take(contact), pulled(part), release()}, as in PackingExperiment. */
  constructor(host, palettes, hand) {
    this.scene = new Scene(() => {})
    this.scene.frozen = true // nothing to point at or to select
    this.scene.palette = palettes.scene
    this.scene.onRepaint = () => {}
    this.scene.onMarks = (marks, scene) => this.mark(marks, scene)
    this.limited = null // (N_c,) contacts that are open, or slip, as in drawLimits
    this.push = null // part of the largest push, in the chapter that pushes
    this.motion = null // displacements (2 N,) of the disks that move
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

  /** Show only a part of the packing, this fraction of its width, around a contact. */
  zoom(chosen, part) {
    const { scene } = this, [{ middle: [x, y] }] = scene.segments((contact) => contact === chosen)
    scene.view = { x, y, half: part * scene.whole.half }
  }

  /** The network: normal forces, blue if smaller than `before`, orange if larger. */
  draw(normal, before, palettes) {
    const { scene, style } = this, colours = palettes.change, middle = colours.length >> 1
    for (let c = 0; c < normal.length; c++) {
      style.width[c] = normal[c] > 1e-6 ? WIDTH * normal[c] : 0
      const part = Math.max(-1, Math.min(1, (normal[c] - before[c]) / FULL))
      style.bin[c] = Math.round(middle * (1 + part))
    }
    style.colours = colours
    scene.palette = palettes.scene
    scene.drawChains(style)
  }

  /** Over the lines: contacts at their limits, the contact in the hand, and arrows of the push and of the motion. */
  mark(marks, scene) {
    if (this.limited && !this.motion) drawLimits(marks, scene, this.limited)
    if (this.held !== null) markSelected(marks, scene, this.held)
    const { scale } = scene
    marks.lineWidth = 4 / scale
    marks.strokeStyle = scene.palette.selected
    marks.beginPath()
    for (const { from, to } of this.pushes()) arrow(marks, from, to, 12 / scale, 0.5)
    marks.stroke()
    if (this.motion) drawMotion(marks, scene, { field: this.motion, contacts: this.limited })
  }

  /** The arrows that push the disks of the marked contact apart: {from, to, way: direction}. */
  * pushes() {
    const { scene, push } = this, { geometry } = scene
    if (push === null || scene.selected === null) return
    for (const { k, a, b } of scene.segments((contact) => contact === scene.selected)) {
      const far = Math.hypot(b[0] - a[0], b[1] - a[1]), along = [(b[0] - a[0]) / far, (b[1] - a[1]) / far]
      for (const [at, sign, grain] of [[a, -1, geometry.i[k]], [b, 1, geometry.j[k]]]) {
        const way = along.map((v) => sign * v), from = at.map((v, d) => v + 0.3 * geometry.radius[grain] * way[d])
        yield { from, to: from.map((v, d) => v + geometry.unit * (ARROW.rest + ARROW.grown * push) * way[d]), way }
      }
    }
  }

  listen(host, hand) {
    const { scene } = this
    scene.root.style.pointerEvents = "none" // otherwise the wheel would zoom
    let from = null
    /** The arrow of the push under a pointer. */
    const arrowAt = (event) => {
      const [px, py] = scene.place(event)
      return [...this.pushes()].find(({ to }) => { const [x, y] = scene.toPixel(...to); return Math.hypot(px - x, py - y) < REACH })
    }
    /** The contact that a pointer would take: the marked one, if it is in reach, or null. */
    const near = (event) => {
      if (!this.packing) return null
      if (arrowAt(event) && hand.takes(scene.selected)) return scene.selected
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
      // An arrow follows the hand; a line is pulled upwards.
      const held = arrowAt(event), [x, y] = held?.way ?? [0, 1]
      from = { at: scene.place(event), way: [x, -y], far: held ? 2 * ARROW.grown * scene.geometry.unit * scene.scale : host.clientHeight }
      host.setPointerCapture(event.pointerId)
      event.preventDefault()
    })
    host.addEventListener("pointermove", (event) => {
      if (from !== null) {
        const { at, way, far } = from
        hand.pulled(scene.place(event).reduce((sum, v, d) => sum + (v - at[d]) * way[d], 0) / far)
      } else host.style.cursor = near(event) === null ? "default" : arrowAt(event) ? "grab" : "ns-resize"
    })
    for (const end of ["pointerup", "pointercancel"]) host.addEventListener(end, () => {
      if (from === null) return
      from = this.held = null
      hand.release()
    })
  }
}
