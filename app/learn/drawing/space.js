// S of a small scene: a segment, a polygon over two of the forces, or a body in its true shape that
// can be turned, with the network on screen as a point in it. With more dimensions, its projection.

import { distance, dot, solve } from "../model/polytope.js"
import { Easel } from "./layered_canvas.js"
import { axisForce, drawAxis, drawSegment, signOf } from "./line.js"
import { circle, font, line, polygon, unflat } from "../../browser/canvas_paths.js"
import { drawName, readBy } from "./axis_readings.js"
import { drawShadow } from "./shadow.js"
import { drawSolid } from "./solid.js"

const TURN = 0.008 // radians per pixel
const BESIDE = 56, ABOVE = 44 // pixels left and right of S, and above and below it, for words
const FLOOR = 46, ASIDE = 72 // the same for S over two forces, for their axes
const ON = 34 // pixels of an arrow where S is unbounded
const DRAWS = 700, WORK = 3e7 // draws from S, fewer if that takes more than WORK multiplications

export class Space {
  constructor(canvas, handler) {
    this.handler = handler
    this.canvas = canvas
    this.easel = new Easel(canvas)
    this.view = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    this.turn(0.6, -0.5)
    this.half = 0
    this.centre = null
    this.held = null
    this.shadow = [0, 2] // forces that are its axes above three dimensions: 2 c for f_n, 2 c + 1 for f_t
    this.outline = { points: [], stale: true } // of S on them, flat, by linear programs
    this.dots = []
    const at = (event) => this.easel.at(event)
    canvas.addEventListener("pointerdown", (event) => this.grabbed(...at(event), event))
    canvas.addEventListener("pointermove", (event) => this.moved(...at(event)))
    canvas.addEventListener("pointerleave", () => { if (!this.held) handler("side", null) })
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { this.held = null })
    canvas.addEventListener("keydown", (event) => this.key(event))
  }

  get context() { return this.easel.g }

  turn(a, b) {
    const about = ([x, y, z], a, b) => {
      const [x1, z1] = [x * Math.cos(a) + z * Math.sin(a), -x * Math.sin(a) + z * Math.cos(a)]
      return [x1, y * Math.cos(b) - z1 * Math.sin(b), y * Math.sin(b) + z1 * Math.cos(b)]
    }
    const columns = [0, 1, 2].map((k) => about(this.view.map((row) => row[k]), a, b))
    this.view = [0, 1, 2].map((k) => columns.map((column) => column[k]))
  }

  /** Position of u in the plane of the screen, in units of force, and its depth. */
  flat(u) {
    const { body } = this
    if (this.over) return this.onAxes.map(({ row, rest }) => dot(row, u) + rest)
    if (body.h === 2) return u
    if (body.h < 2) return [this.sign * (u[0] ?? 0), 0, 0]
    return this.view.map((row) => dot(row, u))
  }

  /** The direction in which a line is drawn. */
  get sign() { return signOf(this.body) }

  /** The two forces used as axes of S, 2 c for f_n of contact c, 2 c + 1 for f_t; none if S has its true shape. */
  get axed() {
    const { body } = this
    if (body.h > 3) return this.shadow
    if (body.h !== 2) return []
    // Computed once, so that friction does not turn the picture.
    if (this.chosenAxes?.of !== body.axes) this.chosenAxes = { of: body.empty ? null : body.axes, forces: body.empty ? [] : readBy(body).map((c) => 2 * c) }
    return this.chosenAxes.forces
  }

  /** Contacts whose forces are read from the point: on the axis below S, and on the one next to it. */
  get read() {
    const { body } = this
    if (body.h > 1) return this.axed.map((force) => force >> 1)
    const force = body.h === 1 ? axisForce(body, null) : null
    return force === null ? [] : [force >> 1]
  }

  /** Whether S, or its projection, is drawn over two forces. */
  get over() { return this.axed.length > 0 }

  /** Pixels below and left of S for the axes; a line leaves enough room without them. */
  get floor() { return this.over ? FLOOR : 0 }
  get aside() { return this.over ? ASIDE : 0 }

  /** Both axis forces as rows of u: computed once, as many points are drawn. */
  get onAxes() {
    const { body, axed, axes } = this
    if (axes?.of !== body.axes || axes.origin !== body.origin || axes.axed.join() !== axed.join()) {
      const rows = axed.map((k) => ({ row: body.axes.map((axis) => axis[k]), rest: body.origin[k] }))
      this.axes = { of: body.axes, origin: body.origin, axed, rows }
    }
    return this.axes.rows
  }

  /** The u whose position moves by (dx, dy) in the plane of the screen. */
  moving(u, dx, dy) {
    const { body } = this
    if (this.axed.length) {
      const [a, b] = this.onAxes.map(({ row }) => row), M = [[dot(a, a), dot(a, b)], [dot(a, b), dot(b, b)]]
      const part = solve(M, [dx, dy]) ?? [dx / (M[0][0] || 1), 0]
      return u.map((v, k) => v + part[0] * a[k] + part[1] * b[k])
    }
    if (body.h === 2) return u.map((v, k) => v + [dx, dy][k])
    if (body.h < 2) return u.map((v) => v + this.sign * dx)
    return u.map((v, k) => v + dx * this.view[0][k] + dy * this.view[1][k])
  }

  /** Half the width and height available to S, which leaves room for words. */
  get room() {
    const w = this.easel.wide - this.aside, h = this.easel.high - this.floor
    return [w / 2 - Math.min(BESIDE, 0.33 * w), h / 2 - Math.min(ABOVE, 0.2 * h)]
  }

  /** Pixels per unit of force. */
  get unit() { return this.room[1] / this.half }

  /** Distance from the centre of the picture, as a fraction of the available room. */
  far([dx, dy]) {
    const [wide, high] = this.room
    return this.body.h === 3 ? Math.hypot(dx, dy) * Math.max(1, high / wide) : Math.max((Math.abs(dx) * high) / wide, Math.abs(dy))
  }

  px([x, y]) {
    const { wide: w, high: h } = this.easel, { unit } = this
    return [(w + this.aside) / 2 + (x - this.centre[0]) * unit, (h - this.floor) / 2 - (y - this.centre[1]) * unit]
  }

  /** The visible part of the plane follows S in steps, so that its growth is visible. */
  frame(at_once) {
    const { body } = this
    const points = (body.whole ? body.corners.map(({ u }) => u) : [body.u]).map((u) => this.flat(u))
    if (!body.whole) points.push(...this.corners(), ...this.dotted)
    if (!points.length) return false
    const [xs, ys] = [0, 1].map((k) => points.map((p) => p[k]))
    const middle = [xs, ys].map((v) => (Math.max(...v) + Math.min(...v)) / 2)
    if (body.h === 3) middle.splice(0, 2, ...this.flat(body.middle))
    const reach = Math.max(...points.map((p) => this.far([p[0] - middle[0], p[1] - middle[1]])), 1e-6)
    if (!this.centre || at_once) { this.centre = middle; this.half = reach > 1e-3 * body.scaleOf() ? reach * 1.1 : 0.5 * body.scaleOf(); return false }
    const wanted = reach > this.half ? reach * 1.15 : reach < 0.12 * this.half ? reach * 4 : this.half
    const away = Math.hypot(middle[0] - this.centre[0], middle[1] - this.centre[1])
    const moves = Math.abs(wanted - this.half) > 0.01 * this.half || away > 0.02 * this.half
    this.half += 0.18 * (Math.max(wanted, 0.05 * body.scaleOf()) - this.half)
    this.centre = this.centre.map((v, k) => v + 0.18 * (middle[k] - v))
    return moves
  }

  /** Two corners of the rectangle around all random points; computed once. */
  get dotted() {
    const { dots, onAxes } = this
    if (this.around?.dots !== dots || this.around.onAxes !== onAxes) {
      const flat = dots.map((u) => this.flat(u)), side = (k) => flat.map((p) => p[k])
      this.around = { dots, onAxes, ends: flat.length ? [Math.min, Math.max].map((end) => [0, 1].map((k) => end(...side(k)))) : [] }
    }
    return this.around.ends
  }

  fill(random) {
    const { body } = this
    this.dots = []
    if (body.empty || !body.h || !body.bounded || body.least(body.u) < -1e-6) return
    let u = body.u
    const between = Math.max(1, Math.ceil(body.h / 2))
    const draws = Math.min(DRAWS, WORK / (between * body.h * body.rows.length))
    for (let k = 0; k < draws; k++) {
      for (let m = 0; m < between; m++) u = body.step(u, random)
      this.dots.push(u)
    }
  }

  draw(body, look, path) {
    this.body = body
    this.look = look
    this.labels = []
    this.easel.measure()
    const moves = !body.scene.idle && !body.empty && this.frame(this.sceneDrawn !== body.scene)
    this.easel.begin(look.paper, this.standing(), () => {
      if (body.empty || body.scene.idle) return
      if (body.h > 3) drawShadow(this)
      if (look.dots) this.drawDots()
    })
    const { context: g } = this, { wide: w, high: h } = this.easel
    if (body.scene.idle) return this.write(w / 2, h / 2, "nothing presses yet", look.ink, 14)
    g.lineJoin = "round" // no spikes where sides meet
    if (body.empty) return this.write(w / 2, h / 2, `S is empty: no forces hold this${look.enough ? `\nμ = ${look.enough} would do` : ""}`, look.warm, 14)
    this.sceneDrawn = body.scene
    if (body.h === 1) drawSegment(this)
    if (this.over) {
      drawAxis(this, this.axed[0], this.easel.high - FLOOR + 6)
      drawAxis(this, this.axed[1], ASIDE - 6, 1)
    }
    if (body.h === 2) this.drawPolygon()
    if (body.h === 3) drawSolid(this)
    this.writeEvents()
    this.drawPath(path)
    const [x, y] = this.px(this.flat(body.u))
    circle(g, [x, y], 8)
    g.fillStyle = look.hand
    g.fill()
    g.strokeStyle = look.paper
    g.lineWidth = 2
    g.stroke()
    const determined = !body.h || (body.whole && body.corners.length === 1)
    if (determined) this.write(x, y - 28, "one point: everything is determined", look.ink, 13)
    return moves
  }

  /** The values on which the static parts depend while a point moves through S. */
  standing() {
    const { body, look, dots, outline, centre, half, shadow, view } = this
    return [body.scene, body.empty, body.origin, look.dots ? dots : null, outline.points, outline.stale, ...(centre ?? []), half, shadow.join(), view.join()]
  }

  write(x, y, text, colour, size = 13, align = "center") {
    const { context: g, easel } = this
    g.font = font(`${size}px`)
    g.textAlign = align === "middle" ? "center" : align
    g.textBaseline = "middle"
    const words = text.split("\n"), wide = g.measureText(text).width
    if (words.length === 1 && align === "center" && wide > easel.wide - 12) { // in two lines
      const middle = text.indexOf(" ", text.length / 2)
      if (middle > 0) words.splice(0, 1, text.slice(0, middle), text.slice(middle + 1))
    }
    const half = Math.max(...words.map((line) => g.measureText(line).width)) / 2
    if (align === "center") x = Math.min(Math.max(x, half + 5), easel.wide - half - 5)
    y -= 0.6 * size * (words.length - 1)
    g.lineWidth = 3
    g.strokeStyle = this.look.paper
    g.fillStyle = colour
    words.forEach((line, k) => {
      g.strokeText(line, x, y + 1.2 * size * k)
      g.fillText(line, x, y + 1.2 * size * k)
    })
  }

  drawDots() {
    const { context: g, look } = this
    g.fillStyle = look.state
    for (const u of this.dots) {
      const [x, y] = this.px(this.flat(u))
      g.fillRect(x - 1, y - 1, 2, 2)
    }
  }

  drawPath(path) {
    const { context: g, look } = this
    if (path.length < 2) return
    g.strokeStyle = look.hand
    g.globalAlpha = 0.45
    g.lineWidth = 1.5
    g.beginPath()
    path.forEach((u, k) => (k ? g.lineTo(...this.px(this.flat(u))) : g.moveTo(...this.px(this.flat(u)))))
    g.stroke()
    g.globalAlpha = 1
  }

  /** An arrow from this position in a direction in which S is unbounded, along the mean of its rays. */
  drawOn([x, y], thick) {
    const { context: g, body, look } = this, flat = body.rays.map((ray) => this.flat(ray))
    const way = [0, 1].map((k) => flat.reduce((sum, ray) => sum + ray[k], 0)), size = Math.hypot(...way)
    if (size < 1e-6) return // it points away from the viewer
    const [ux, uy] = [way[0] / size, -way[1] / size], head = 8 + thick
    g.strokeStyle = g.fillStyle = look.cold
    g.lineWidth = thick
    line(g, [x, y], [x + (ON - head) * ux, y + (ON - head) * uy])
    g.beginPath()
    g.moveTo(x + ON * ux, y + ON * uy)
    for (const side of [0.6, -0.6]) g.lineTo(x + (ON - head) * ux - side * head * uy, y + (ON - head) * uy + side * head * ux)
    g.fill()
  }

  /** Whether a side is pointed at, is that of a selected contact, or has the point on it. */
  lit({ corners, stops, slope, rest }) {
    const { look, body } = this
    return look.side === corners.join() || stops.some(([c]) => look.contacts.has(c)) || dot(slope, body.u) + rest < 1e-6 * body.scaleOf()
  }

  /** What happens at the lit sides, above S. */
  writeEvents() {
    const { body, easel, look } = this
    for (const [k, side] of (body.whole && body.corners.length > 1 ? body.sides : []).filter((one) => this.lit(one)).entries()) this.write(easel.wide / 2, 16 + 17 * k, side.cap ? "no end this way" : this.handler("words", side), look.hand)
  }

  drawPolygon() {
    const { context: g, body, look } = this, { corners } = body
    const middle = this.px(this.flat(body.middle))
    const places = corners.map(({ u }) => this.px(this.flat(u)))
    const order = [...places.keys()].sort((a, b) =>
      Math.atan2(places[a][1] - middle[1], places[a][0] - middle[0]) - Math.atan2(places[b][1] - middle[1], places[b][0] - middle[0]))
    polygon(g, order.map((k) => places[k]))
    g.fillStyle = look.shade
    g.fill()
    for (const side of body.sides) {
      const [a, b] = [places[side.corners[0]], places[side.corners.at(-1)]], lit = this.lit(side)
      g.strokeStyle = lit ? look.hand : look.cold
      g.lineWidth = lit ? 5 : 2.5
      g.setLineDash(side.cap ? [3, 7] : [])
      line(g, a, b)
      g.setLineDash([])
      if (side.cap) for (const part of [0, 0.5, 1]) this.drawOn([0, 1].map((d) => a[d] + part * (b[d] - a[d])), 2)
      this.labels.push({ side, a, b, reach: 14 })
    }
    if (places.length < 3) return // or a line among two dimensions
    drawName(this, places, middle)
  }

  corners() { return unflat(this.outline.points) ?? [] }

  // Dragging

  grabbed(px, py, event) {
    const { body } = this
    if (!body || body.empty) return
    const [x, y] = this.px(this.flat(body.u)), near = Math.hypot(px - x, py - y) < 24
    this.canvas.setPointerCapture(event.pointerId)
    this.held = { turns: body.h === 3 && !near, px, py, u: [...body.u] }
    this.handler("begin")
    this.handler("point", this.read)
    if (!near && body.h !== 3) { // the point moves to the pointer
      this.held = { px: x, py: y, u: [...body.u] }
      this.moved(px, py)
    }
    event.preventDefault()
  }

  moved(px, py) {
    const { body, held } = this
    if (!body || body.empty) return
    if (!held) {
      const [x, y] = this.px(this.flat(body.u)), near = Math.hypot(px - x, py - y) < 14
      return near ? this.handler("point", this.read) : this.handler("side", this.sideAt(px, py))
    }
    if (held.turns) {
      this.turn((px - held.px) * TURN, (py - held.py) * TURN)
      Object.assign(held, { px, py })
      return this.handler("turned")
    }
    const { unit } = this
    this.handler("go", this.moving(held.u, (px - held.px) / unit, -(py - held.py) / unit))
  }

  sideAt(px, py) {
    for (const { side, x, y, a, b, inside, reach } of [...this.labels].reverse()) {
      if (inside ? within(inside, px, py) : a ? distance(a, b, px, py) < reach : Math.hypot(px - x, py - y) < reach) return side
    }
    return null
  }

  key(event) {
    const [dx, dy] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] ?? []
    if (dx === undefined || !this.body || this.body.empty) return
    event.preventDefault()
    event.stopPropagation()
    if (event.shiftKey && this.body.h === 3) { this.turn(0.1 * dx, -0.1 * dy); return this.handler("turned") }
    this.handler("begin")
    this.handler("go", this.moving(this.body.u, 0.04 * this.half * dx, 0.04 * this.half * dy))
  }
}

function within(points, px, py) {
  let inside = false
  points.forEach(([x, y], k) => {
    const [u, v] = points.at(k - 1)
    if (y > py !== v > py && px < ((u - x) * (py - y)) / (v - y) + x) inside = !inside
  })
  return inside
}
