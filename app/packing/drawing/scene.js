// The packing on canvases: disks, chains and marks on separate layers, so that a frame repaints
// only chains. One unit of length is the same number of pixels in x and y.

import { addPolygon, inside, line, polygon, unflat } from "../../browser/canvas_paths.js"
import { createElement } from "../../browser/dom.js"
import { LEAST, strokeByClass, strokeEach } from "./chain_strokes.js"
import { highlight, markForces, markSelected } from "./marks.js"
import { withImages } from "./images.js"
import { listen } from "../hand/pointing.js"
import { PIXELS, Sheet } from "./svg_context.js"

const FEW = 2500 // chains drawn one by one, with round ends; more are gathered in classes
const GRAB = 6 // px from a chain that still count as the chain
const TIP = 14 // px between the pointer and the hover box
const ZOOM = [0.02, 4] // smallest and largest fraction of the whole view
const ZOOM_HINT = "Ctrl + wheel zooms; after a click here the wheel alone does."

export class Scene {
  constructor(onSelect) {
    this.root = createElement("div", { className: "scene", tabIndex: 0, role: "img", ariaLabel: "packing with its force chains" })
    const layer = () => this.root.appendChild(document.createElement("canvas")).getContext("2d")
    this.disks = layer()
    this.chains = layer()
    this.marks = layer()
    this.tip = this.root.appendChild(createElement("div", { className: "tip" }))
    this.root.scene = this
    this.onSelect = onSelect
    this.size = 0
    this.painted = 0
    this.counts = { segments: 0, drawn: 0, outside: 0, thin: 0 }
    this.selected = null
    this.pair = [] // contacts whose forces are the axes of force space, across and up
    this.under = null // what the hover box describes: a segment `link` or a disk, −1: neither
    this.pointed = -1 // the disk under the pointer, whose forces are drawn
    this.frozen = false // whether the drawing is animated and cannot be pointed at
    this.offset = null
    this.mixed = null
    listen(this)
  }

  // Geometry and view

  show(packing) {
    this.pointed = -1
    this.closeTip()
    const moved = `${packing.window}` !== `${this.geometry?.window}`
    this.geometry = withImages(packing)
    const { x0 } = this.geometry
    this.width = new Float32Array(x0.length)
    this.bin = new Int16Array(x0.length)
    if (moved) this.reset(false)
  }

  /** The view of the whole packing. */
  get whole() {
    const [left, right, bottom, top] = this.geometry.window
    return { x: (left + right) / 2, y: (bottom + top) / 2, half: (right - left) / 2 }
  }

  reset(paint = true) {
    this.view = this.whole
    if (paint) this.changed()
  }

  /** px of the layout per unit of length, along x and y. */
  get scale() { return this.size / (2 * this.view.half) }

  toPixel(x, y) {
    const { scale, view, size } = this
    return [size / 2 + (x - view.x) * scale, size / 2 - (y - view.y) * scale]
  }

  toPlace(px, py) {
    const { scale, view, size } = this
    return [view.x + (px - size / 2) / scale, view.y - (py - size / 2) / scale]
  }

  resize() {
    const size = this.root.clientWidth, ratio = window.devicePixelRatio || 1
    if (!size || (size === this.size && ratio === this.ratio)) return
    this.size = size
    this.finer(size * ratio)
  }

  /** Draw with this many pixels per side, independent of the screen; undone by `resize`. */
  finer(pixels) {
    this.ratio = pixels / this.size
    for (const { canvas } of [this.disks, this.chains, this.marks]) canvas.width = canvas.height = Math.round(pixels)
    if (this.geometry) this.changed()
  }

  /** After pan, zoom, resize or a change of theme: redraw everything, once per painted frame. */
  changed() {
    this.stale = true
    if (this.pendingFrame) return
    this.pendingFrame = requestAnimationFrame(() => {
      this.pendingFrame = 0
      if (this.geometry && this.size) this.repaint()
    })
  }

  repaint() {
    this.drawDisks()
    this.stale = false
    if (!this.style) return
    this.drawChains(this.style)
    this.onRepaint()
  }

  // Painting

  begin(context) {
    const { ratio, scale, view, size } = this
    context.setTransform(1, 0, 0, 1, 0, 0)
    context.clearRect(0, 0, context.canvas.width, context.canvas.height)
    const s = ratio * scale
    const middle = (ratio * size) / 2
    context.setTransform(s, 0, 0, -s, middle - s * view.x, middle + s * view.y)
  }

  /** The whole packing, drawn as on screen, as SVG text. */
  picture(caption) {
    const { disks, chains, marks, view, size, geometry } = this, sheet = new Sheet()
    Object.assign(this, { disks: sheet, chains: sheet, marks: sheet, size: PIXELS, pointed: -1 })
    this.reset(false)
    this.drawDisks()
    this.stale = false
    this.drawChains(this.style)
    Object.assign(this, { disks, chains, marks, view, size })
    this.changed()
    return sheet.svg(geometry.window, { ...caption, unit: geometry.unit, bodies: geometry.outlines?.length > 0 })
  }

  drawDisks() {
    const { x, y, r, kind, grain } = this.geometry, { disks, view, scale } = this
    this.begin(disks)
    this.drawBox(disks)
    const near = view.half
    for (const [number, { fill, line }] of this.palette.disks.entries()) {
      disks.beginPath()
      for (let k = 0; k < x.length; k++) {
        if (kind[k] !== number) continue
        const reach = near + r[k]
        const px = x[k] + this.shift(grain[k], 0), py = y[k] + this.shift(grain[k], 1)
        if (Math.abs(px - view.x) > reach || Math.abs(py - view.y) > reach) continue
        this.addBody(disks, px, py, grain[k])
      }
      disks.fillStyle = fill
      disks.fill()
      if (scale < 3) continue // disks a few pixels large would be nothing but outline
      disks.lineWidth = 0.8 / scale
      disks.strokeStyle = line
      disks.stroke()
    }
    this.drawWalls(disks)
  }

  drawWalls(context) {
    const { walls = [] } = this.geometry // a moving packing has none
    context.lineWidth = 2 / this.scale
    context.strokeStyle = this.palette.strong
    for (let k = 0; k < walls.length; k += 4) line(context, walls.slice(k, k + 2), walls.slice(k + 2, k + 4))
  }

  drawBox(context) {
    const { box: [width, height], tilt } = this.geometry
    if (width < 0 || height < 0) return // open
    polygon(context, [[0, 0], [width, 0], [width + tilt, height], [tilt, height]])
    context.setLineDash([4 / this.scale, 4 / this.scale])
    context.lineWidth = 1 / this.scale
    context.strokeStyle = this.palette.edge
    context.stroke()
    context.setLineDash([])
  }

  /** Add a disk or polygon with its centre at a point to a path. */
  addBody(context, px, py, grain) {
    const outline = this.outline(grain), r = this.geometry.radius[grain]
    if (outline) return addPolygon(context, outline.map(([x, y]) => [px + x, py + y]))
    context.moveTo(px + r, py)
    context.arc(px, py, r, 0, 2 * Math.PI)
  }

  /** Corners of a body relative to its centre; null for a disk. */
  outline(grain) { return unflat(this.geometry.outlines?.[grain]) }

  /** The displacement of a grain at this moment of an animated displacement field. */
  shift(grain, axis) {
    return this.offset ? this.offset.amplitude * this.offset.field[2 * grain + axis] : 0
  }

  /** style: per contact `width` (units) and `bin` of `colours`; marks to set; alpha. */
  drawChains(style) {
    this.style = style
    if (!this.size || this.stale) return this.stale && this.changed()
    const { x0, y0, x1, y1, contact } = this.geometry
    const { chains, view, scale, width, bin } = this
    const least = LEAST / scale, order = this.order ??= []
    let drawn = 0, outside = 0, thin = 0
    for (let k = 0; k < contact.length; k++) {
      const w = style.width[contact[k]]
      width[k] = 0
      if (w < least) { thin++; continue }
      const left = view.x - view.half - w, right = view.x + view.half + w
      const low = view.y - view.half - w, high = view.y + view.half + w
      if ((x0[k] < left && x1[k] < left) || (x0[k] > right && x1[k] > right) ||
          (y0[k] < low && y1[k] < low) || (y0[k] > high && y1[k] > high)) { outside++; continue }
      width[k] = w
      bin[k] = style.bin[contact[k]]
      order[drawn++] = k
    }
    this.counts = { segments: contact.length, drawn, outside, thin }
    this.begin(chains)
    this.stroke(order.slice(0, drawn), style.colours)
    this.drawMarks()
    this.fillTip() // other forces
    if (!this.painted++) performance.mark("packing painted") // time until the page showed a packing
  }

  /** Stroke these rows of the geometry. */
  stroke(rows, colours) {
    const { chains, width, bin, scale } = this, lines = { rows, width, bin, colours, ends: (k) => this.ends(k) }
    if (rows.length <= FEW || chains instanceof Sheet) strokeEach(chains, lines)
    else strokeByClass(chains, lines, scale)
  }

  /** Both ends of a chain; on bodies it turns about its middle, the contact, into the direction of the force. */
  ends(k) {
    const { x0, y0, x1, y1, i, j, contact } = this.geometry, lean = this.style?.lean?.[contact[k]] || 0
    const turn = 1 / Math.hypot(1, lean), u = (x1[k] - x0[k]) / 2, v = (y1[k] - y0[k]) / 2
    const dx = lean ? u - turn * (u - lean * v) : 0, dy = lean ? v - turn * (v + lean * u) : 0
    return [
      x0[k] + dx + this.shift(i[k], 0), y0[k] + dy + this.shift(i[k], 1),
      x1[k] - dx + this.shift(j[k], 0), y1[k] - dy + this.shift(j[k], 1),
    ]
  }

  /** Each segment k of the contacts with chosen(contact): both ends a and b, and the midpoint. */
  *segments(chosen) {
    const { contact } = this.geometry
    for (let k = 0; k < contact.length; k++) {
      if (!chosen(contact[k])) continue
      const [xa, ya, xb, yb] = this.ends(k)
      yield { k, contact: contact[k], a: [xa, ya], b: [xb, yb], middle: [(xa + xb) / 2, (ya + yb) / 2] }
    }
  }

  /** The selected contact, the axes of force space, and marks of other modules. */
  drawMarks() {
    const { marks, palette } = this
    this.begin(marks)
    if (this.selected !== null) markSelected(marks, this, this.selected)
    this.pair.forEach((contact, k) => highlight(marks, this, contact, k ? palette.up : palette.across))
    if (this.pointed >= 0 && this.describe?.forces) markForces(marks, this, this.pointed)
    if (marks instanceof Sheet) this.onSheet?.(marks, this)
    else this.onMarks?.(marks, this)
  }

  // Pointer

  /** Explain briefly how the wheel zooms. */
  hintAtZoom() {
    const hint = this.root.appendChild(createElement("div", { className: "hint", textContent: ZOOM_HINT, role: "status" }))
    hint.addEventListener("animationend", () => hint.remove())
  }

  /** The segment at a point of the layout, or −1; reach: px from a chain that still count as the chain; chosen(contact). */
  linkAt(px, py, reach = GRAB, chosen = () => true) {
    const [x, y] = this.toPlace(px, py), { contact } = this.geometry
    let best = -1, least = Infinity
    for (let k = 0; k < contact.length; k++) {
      if (!chosen(contact[k])) continue
      const [x0, y0, x1, y1] = this.ends(k), dx = x1 - x0, dy = y1 - y0
      const along = ((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy)
      if (along < 0.05 || along > 0.95) continue // many chains meet at a centre
      const away = Math.hypot(x - x0 - along * dx, y - y0 - along * dy)
      if (away - this.width[k] / 2 < least) { least = away - this.width[k] / 2; best = k }
    }
    return least * this.scale <= reach ? best : -1
  }

  diskAt(px, py) {
    const [a, b] = this.toPlace(px, py), { x, y, r, grain } = this.geometry
    for (let k = 0; k < x.length; k++) {
      const corners = this.outline(grain[k])
      if ((a - x[k]) ** 2 + (b - y[k]) ** 2 < r[k] ** 2 && (!corners || inside(corners, [a - x[k], b - y[k]]))) return k
    }
    return -1
  }

  place(event) {
    const box = this.root.getBoundingClientRect()
    return [event.clientX - box.left, event.clientY - box.top]
  }

  /** Highlight a disk, or none (−1). */
  point(disk) {
    if (disk === this.pointed) return
    this.pointed = disk
    if (this.style && this.geometry && !this.frozen) this.drawMarks()
  }

  /** The contact that a pointer takes in hand, or null where it moves the view.

   * Where disks are so small that a chain lies under every point, the view could not be moved. */
  takenAt(event, touch) {
    if (!this.geometry || this.frozen || !this.hand || this.scale < GRAB) return null
    const k = this.linkAt(...this.place(event), touch ? 3 * GRAB : GRAB)
    if (k < 0 || (touch && this.geometry.contact[k] !== this.selected)) return null
    return this.geometry.contact[k]
  }

  drag(fingers, id, before, now) {
    this.closeTip()
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]]
    const other = [...fingers].find(([key]) => key !== id)?.[1]
    if (other) {
      const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1])
      this.zoom(apart(before) / Math.max(1, apart(now)), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2)
    }
    const part = other ? 0.5 : 1
    this.view.x -= (part * dx) / this.scale
    this.view.y += (part * dy) / this.scale
    this.changed()
  }

  zoom(factor, px, py) {
    if (!this.geometry) return
    const whole = this.whole.half
    const before = this.toPlace(px, py)
    this.view.half = Math.min(ZOOM[1] * whole, Math.max(ZOOM[0] * whole, this.view.half * factor))
    const after = this.toPlace(px, py)
    this.view.x += before[0] - after[0]
    this.view.y += before[1] - after[1]
    this.changed()
  }

  pick(px, py) {
    if (!this.geometry || this.frozen) return
    const k = this.linkAt(px, py), contact = k < 0 ? null : this.geometry.contact[k]
    this.onSelect(contact === this.selected ? null : contact)
  }

  hover(px, py) {
    if (!this.geometry || !this.describe || this.frozen) return this.closeTip()
    const link = this.linkAt(px, py), disk = link < 0 ? this.diskAt(px, py) : -1
    this.point(disk)
    this.root.style.cursor = link >= 0 ? "pointer" : "grab"
    if (link < 0 && disk < 0) return this.closeTip()
    this.under = { link, disk }
    this.tip.classList.add("on")
    this.fillTip()
    this.placeTip(px, py)
  }

  closeTip() {
    this.under = null
    this.tip.classList.remove("on")
  }

  /** Describe what is under the pointer, as on screen. */
  fillTip() {
    if (!this.under) return
    const { link, disk } = this.under, { contact, grain } = this.geometry
    const rows = link < 0 ? this.describe.grain(grain[disk]) : this.describe.contact(contact[link])
    this.tip.innerHTML = rows.map(([name, value]) => `<i>${name}</i><b>${value}</b>`).join("")
  }

  /** Next to the pointer, on the side with more room, and within the picture. */
  placeTip(px, py) {
    const { tip, size } = this // 100 %: of the box, which grows where rows come
    const from = (at) => `max(0px, min(${size}px - 100%, ${at > size / 2 ? `${at - TIP}px - 100%` : `${at + TIP}px`}))`
    tip.style.transform = `translate(${from(px)}, ${from(py)})`
  }
}
