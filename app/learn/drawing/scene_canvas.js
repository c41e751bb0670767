// The small scene: disks, walls, the force on each disk at each contact as an arrow within its
// cone.

import { shape } from "../model/contact_curves.js"
import { distance, dot } from "../model/polytope.js"
import { Easel } from "./layered_canvas.js"
import { ASIDE, drawNames, drawValues } from "./force_labels.js"
import { circle, font, inside, line, polygon, unflat } from "../../browser/canvas_paths.js"

const CLEAR = 11 // px from a disk's number to the nearest arrow, if there is room
const LONG = 0.27 // of the picture: largest radius of a disk
const LEAN = 0.42, WORDS = 90 // of the picture without this many px: the same of another body
const NUMBERS = [0, ...Array.from({ length: 12 }, (_, k) => k + 1)] // positions of the number: the centre, and around it
const NAMED = 3 // most disks, and most contacts of a single one, for which the numbered components of forces are drawn

/** Whether a scene is so much taller than wide that it needs a tall picture. */
export function tall({ name, x, box }) {
  const extent = (k) => { const all = x.filter((_, n) => n % 2 === k); return Math.max(...all) - Math.min(...all) }
  return name !== "own" && !box[0] && extent(1) > 4 * extent(0) && extent(0) > 0
}

export class Arrows {
  constructor(root, handler) {
    this.handler = handler // handler(what, …): called for pointer events
    this.canvas = root
    this.easel = new Easel(root)
    this.hover = null
    this.held = null
    const at = (event) => this.easel.at(event)
    root.addEventListener("pointermove", (event) => this.moved(...at(event)))
    root.addEventListener("pointerleave", () => { if (!this.held) { this.hover = null; handler("hover", null) } })
    root.addEventListener("pointerdown", (event) => this.grabbed(...at(event), event))
    for (const name of ["pointerup", "pointercancel"]) root.addEventListener(name, () => { this.held = null; handler("release") })
  }

  get context() { return this.easel.g }

  /** Fit disks and walls into the canvas. */
  fit(body, same = false) {
    this.body = body
    this.easel.measure()
    const heaviest = Math.max(...body.scene.load.map(Math.abs)) // a weight on many contacts remains in the picture
    const mean = Math.max(body.sumAt(body.u) / body.count || 0, heaviest / 2)
    const size = (body.scene.box[0] ? Math.min : Math.max)(...body.scene.r) // many arrows are shorter
    const long = same ? Math.min(size, LONG * Math.min(this.easel.wide, this.easel.high) / this.unit) : size
    this.forceUnit = (0.75 * long) / Math.max(mean, 1e-6)
    if (same) return // in the builder only what is dragged moves
    const { scene } = body, { x, r, walls, box } = scene
    const xs = [], ys = []
    for (let g = 0; g < r.length; g++) {
      xs.push(x[2 * g] - r[g], x[2 * g] + r[g])
      ys.push(x[2 * g + 1] - r[g], x[2 * g + 1] + r[g])
    }
    for (let k = 0; k < walls.length; k += 2) { xs.push(walls[k]); ys.push(walls[k + 1]) }
    for (const { from } of this.pressing()) { xs.push(from[0]); ys.push(from[1]) }
    if (box[0]) { xs.splice(0, Infinity, 0, box[0]); ys.splice(0, Infinity, 0, box[1]) }
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)]
    const { wide: width, high: height } = this.easel
    const rooms = [0.1, tall(scene) ? 0.02 : box[0] ? 0.12 : 0.1]
    const [across, up] = [right - left, high - low].map((size, k) => size * (1 + 2 * rooms[k]))
    this.unit = Math.min(width / across, height / up)
    this.unit = Math.min(this.unit, (this.outline(0) ? LEAN * (Math.min(width, height) - WORDS) : LONG * Math.min(width, height)) / Math.max(...r))
    this.x0 = width / 2 - (this.unit * (left + right)) / 2
    this.y0 = height / 2 + (this.unit * (low + high)) / 2
  }

  /** The coordinates at the centre of the canvas. */
  get middle() { return this.back(this.easel.wide / 2, this.easel.high / 2) }

  px(x, y) { return [this.x0 + this.unit * x, this.y0 - this.unit * y] }
  back(px, py) { return [(px - this.x0) / this.unit, (this.y0 - py) / this.unit] }

  /** Arrows of pressing walls, three per wall: {from, force of length 1}. */
  pressing() {
    const { walls, pressing, press, r } = this.body.scene, long = 0.8 * Math.max(...r)
    return [...pressing].flatMap((wall, k) => {
      const [ax, ay, bx, by] = walls.slice(4 * wall, 4 * wall + 4), size = Math.hypot(press[2 * k], press[2 * k + 1])
      const force = [press[2 * k] / size, press[2 * k + 1] / size]
      return [0.2, 0.5, 0.8].map((s) => ({ from: [ax + s * (bx - ax) - long * force[0], ay + s * (by - ay) - long * force[1]], force }))
    })
  }

  /** A point of a body, where its pose has carried it. */
  carried(disk, [x, y]) {
    const [dx, dy, turn] = this.look?.poses?.[disk] ?? []
    if (dx === undefined) return [x, y]
    if (!this.body.scene.outlines[disk]?.length) return [x + dx, y + dy] // disks roll off their contacts
    const { scene } = this.body, [a, b] = [x - scene.x[2 * disk], y - scene.x[2 * disk + 1]], [c, s] = [Math.cos(turn), Math.sin(turn)]
    return [x - a + c * a - s * b + dx, y - b + s * a + c * b + dy]
  }

  /** The centre of a body on screen, in px. */
  centre(disk) {
    const { x } = this.body.scene
    return this.px(...this.carried(disk, [x[2 * disk], x[2 * disk + 1]]))
  }

  /** Both ends of every contact: {contact, disk, at, inward: force on the disk for f_n = 1, across}. */
  ends() {
    const ends = this.touching()
    return this.look?.poses ? ends.map((end) => ({ ...end, at: this.carried(end.disk, end.at) })) : ends
  }

  /** The same before any body has moved. */
  touching() {
    const { scene } = this.body, disks = scene.r.length, ends = []
    if (this.endsOf === scene) return this.contactEnds
    Object.assign(this, { endsOf: scene, contactEnds: ends, places: [] })
    for (let c = 0; c < scene.i.length; c++) {
      const [nx, ny] = [scene.normal[2 * c], scene.normal[2 * c + 1]]
      const [b_i, b_j] = scene.levers.slice(2 * c, 2 * c + 2)
      for (const [disk, sign, arm, b] of [[scene.i[c], -1, scene.arm_i[c], b_i], [scene.j[c], 1, scene.arm_j[c], b_j]]) {
        if (disk >= disks) continue
        const at = [scene.x[2 * disk] - sign * arm * nx - b * ny, scene.x[2 * disk + 1] - sign * arm * ny + b * nx]
        ends.push({ contact: c, disk, at, inward: [sign * nx, sign * ny], across: [-sign * ny, sign * nx] })
      }
      const [one, other] = ends.slice(-2)
      if (!scene.box[0] || Math.hypot(one.at[0] - other.at[0], one.at[1] - other.at[1]) < 1e-6) continue
      Object.assign(one, { copy: other.at }) // its position on a copy of its disk
      Object.assign(other, { copy: one.at })
    }
    return ends
  }

  draw(look) {
    const { body } = this
    this.look = look
    this.easel.measure()
    this.shafts = [] // of arrows, which numbers must avoid
    const wall = look.wall ?? []
    this.easel.begin(look.paper, [body.scene, this.unit, this.x0, this.y0, look.disk, wall.join(), look.poses?.join()], () => {
      this.drawWalls(wall)
      this.drawDisks()
    })
    const F = body.empty ? null : body.forces()
    if (F) for (const end of this.ends()) this.drawEnd(end, F)
    if (look.fall) this.drawFall(look.fall)
    if (F || !look.poses) this.drawLoads() // none on what has fallen
    if (F) drawValues(this, F)
    if (body.scene.r.length > 1) this.drawNumbers()
    else if (F && body.count <= NAMED) drawNames(this, F)
    if (look.carried) this.drawCarried(shape(look.carried))
    if (look.handle) this.drawHandle(...look.handle.map((end) => this.px(...end)))
    if (look.cursor) this.drawCursor(this.px(...look.cursor))
  }

  /** more: a wall being drawn. */
  drawWalls(more) {
    const { context: g, body, look } = this, { box } = body.scene, walls = [...body.scene.walls, ...more]
    g.lineWidth = 3
    g.lineCap = g.lineJoin = "round"
    for (let k = 0; k < walls.length; k += 4) {
      const [dx, dy] = k / 4 === look.pushed?.wall ? look.pushed.by : [0, 0]
      g.strokeStyle = dx || dy ? look.hand : look.ink
      line(g, ...[0, 2].map((end) => this.px(walls[k + end] + dx, walls[k + end + 1] + dy)))
    }
    if (!box[0]) return
    g.setLineDash([5, 5])
    g.lineWidth = 1
    const [left, top] = this.px(0, box[1])
    g.strokeRect(left, top, box[0] * this.unit, box[1] * this.unit)
    g.setLineDash([])
  }

  /** A body being dragged, before its scene arrives. */
  drawCarried({ corners, round }) {
    const { context: g, look } = this, ends = corners.map((corner) => this.px(...corner))
    if (round) circle(g, ends[0], round * this.unit)
    else polygon(g, ends)
    g.strokeStyle = look.hand
    g.lineWidth = 2
    g.stroke()
  }

  /** The handle by which a block is turned, in px. */
  drawHandle(from, to) {
    const { context: g, look } = this
    g.strokeStyle = look.hand
    g.lineWidth = 1.5
    line(g, from, to)
    circle(g, to, 6)
    g.fillStyle = look.paper
    g.fill()
    g.stroke()
  }

  /** The keyboard cursor. */
  drawCursor([x, y]) {
    const { context: g, look } = this
    g.strokeStyle = look.hand
    g.lineWidth = 2
    for (const [dx, dy] of [[9, 0], [0, 9]]) line(g, [x - dx, y - dy], [x + dx, y + dy])
  }

  drawDisks() {
    const { context: g, body, look } = this, { r } = body.scene, copies = this.copies()
    const originals = Array.from(r, (_, disk) => ({ disk, at: this.centre(disk) }))
    for (const [k, { disk, at }] of [...originals, ...copies].entries()) {
      const outline = this.outline(disk)
      if (outline) polygon(g, outline.map((corner) => this.px(...corner)))
      else circle(g, at, r[disk] * this.unit)
      g.globalAlpha = k < originals.length ? 1 : 0.3
      g.fillStyle = look.disk === disk ? look.lit : look.fill
      g.fill()
      g.strokeStyle = look.edge
      g.lineWidth = 1.5
      g.stroke()
    }
    this.beginNumbers()
    g.globalAlpha = 0.35
    for (const { disk, at } of copies) g.fillText(String(disk + 1), ...at)
    g.globalAlpha = 1
  }

  /** Corners of a body; null for a disk. */
  outline(disk) { return unflat(this.body.scene.outlines[disk])?.map((corner) => this.carried(disk, corner)) }

  /** Visible copies of the disks of a periodic scene. */
  copies() {
    const { r, box } = this.body.scene, { wide, high } = this.easel, copies = []
    if (!box[0]) return copies
    for (let disk = 0; disk < r.length; disk++) {
      for (const a of [-1, 0, 1]) for (const b of [-1, 0, 1]) {
        const [px, py] = this.centre(disk), at = [px + a * box[0] * this.unit, py - b * box[1] * this.unit], R = r[disk] * this.unit
        if ((a || b) && at[0] > -R && at[1] > -R && at[0] < wide + R && at[1] < high + R) copies.push({ disk, at })
      }
    }
    return copies
  }

  beginNumbers() {
    const { context: g, look } = this
    g.fillStyle = look.ink
    g.font = font("12px")
    g.textAlign = "center"
    g.textBaseline = "middle"
  }

  /** Numbers of the disks, clear of all arrows if there is room, and at the previous position if it is still
   * clear. */
  drawNumbers() {
    const { context: g, body } = this, { r } = body.scene
    this.ends() // a new scene resets the positions of the previous one
    this.beginNumbers()
    for (let d = 0; d < r.length; d++) {
      const clear = (k) => { const at = this.numberAt(d, k); return Math.min(...this.shafts.map(([a, b]) => distance(a, b, ...at))) }
      if (clear((this.places[d] ??= 1)) < CLEAR) {
        const room = NUMBERS.map(clear)
        this.places[d] = room.indexOf(Math.max(...room))
      }
      g.fillText(String(d + 1), ...this.numberAt(d, this.places[d]))
    }
  }

  /** Position k of a disk's number: 0 its centre, otherwise around it. */
  numberAt(d, k) {
    const { r } = this.body.scene, [px, py] = this.centre(d)
    const R = k && !this.outline(d) ? 0.72 * r[d] * this.unit : 0, angle = (k * Math.PI) / 6 + 3.4
    return [px + R * Math.cos(angle), py + R * Math.sin(angle)]
  }

  drawEnd({ contact, disk, at, inward, across, copy }, F) {
    const { context: g, body, look } = this, { mu } = body
    const [normal, tangential] = [F[2 * contact], F[2 * contact + 1]]
    const [px, py] = this.px(...at), lit = look.contacts.has(contact), long = this.unit * body.scene.r[disk] * 0.62
    const slides = body.slides(normal, tangential)
    // The cone: possible directions of the force on the disk.
    const wide = Math.atan(mu), middle = Math.atan2(-inward[1], inward[0])
    if (lit || slides || !body.crowded) {
      g.beginPath()
      g.moveTo(px, py)
      g.arc(px, py, long, middle - wide, middle + wide)
      g.closePath()
      g.fillStyle = lit ? look.coneLit : slides ? look.coneFull : look.cone
      g.fill()
      if (mu < 0.01) { g.strokeStyle = look.coneLit; g.lineWidth = 1; g.stroke() }
    }
    if (normal < 1e-9) {
      circle(g, [px, py], 4)
      g.strokeStyle = look.ink
      g.lineWidth = 1.5
      g.stroke()
      return
    }
    const force = [0, 1].map((k) => normal * inward[k] + tangential * across[k])
    const axisColour = this.axisColour(contact), named = body.scene.r.length === 1 && body.count <= NAMED
    const apart = axisColour && body.scene.r.length <= NAMED // the numbered component separately
    if (named) {
      g.globalAlpha = 0.45
      this.arrow(px, py, inward.map((v) => v * normal), look.cold, 1.5)
      g.globalAlpha = 1
      this.arrow(px + ASIDE * inward[0], py - ASIDE * inward[1], across.map((v) => v * tangential), look.cold, 3)
    }
    const colour = lit ? look.hand : (!apart && axisColour) || look.cold, thick = lit || (axisColour && !apart) ? 3.5 : 2.5
    this.arrow(px, py, force, colour, thick)
    if (apart) this.arrow(px, py, inward.map((v) => v * normal), axisColour, 3.5)
    g.globalAlpha *= 0.35
    if (copy) this.arrow(...this.px(...copy), force, colour, thick)
    g.globalAlpha = 1
  }

  /** The colour of a contact whose force is an axis of S. */
  axisColour(contact) { return this.look.axes?.get(2 * contact) ?? this.look.axes?.get(2 * contact + 1) }

  arrow(px, py, force, colour, thick) {
    const { context: g } = this, unit = this.unit * this.forceUnit
    let [dx, dy] = [force[0] * unit, -force[1] * unit], size = Math.hypot(dx, dy)
    const most = 0.5 * Math.min(this.easel.wide, this.easel.high)
    if (size < 1.5) return
    const cut = size > most
    if (cut) { dx *= most / size; dy *= most / size; size = most }
    const head = Math.min(11, 0.5 * size + 2), [ux, uy] = [dx / size, dy / size]
    this.shafts.push([[px, py], [px + dx, py + dy]])
    g.strokeStyle = g.fillStyle = colour
    g.lineWidth = thick
    g.lineCap = "butt"
    if (cut) g.setLineDash([8, 4])
    line(g, [px, py], [px + dx - head * 0.8 * ux, py + dy - head * 0.8 * uy])
    g.setLineDash([])
    g.beginPath()
    g.moveTo(px + dx, py + dy)
    g.lineTo(px + dx - head * ux - 0.45 * head * uy, py + dy - head * uy + 0.45 * head * ux)
    g.lineTo(px + dx - head * ux + 0.45 * head * uy, py + dy - head * uy - 0.45 * head * ux)
    g.fill()
  }

  /** Weights, and loads added by the visitor. */
  drawLoads() {
    const { body, look } = this, { r } = body.scene
    for (let d = 0; d < r.length; d++) {
      const load = [body.load[3 * d], body.load[3 * d + 1]]
      if (Math.hypot(...load) > 1e-9) this.arrow(...this.centre(d), load, look.weight, 2.5)
    }
    const long = (0.72 * Math.max(...r)) / this.forceUnit
    for (const { from, force } of this.pressing()) this.arrow(...this.px(...from), force.map((v) => v * long), look.weight, 2.5)
  }

  drawFall(motion) {
    const { body, look, context: g } = this, { x, r, walls, pressing } = body.scene
    pressing.forEach((wall, k) => {
      const at = 3 * (r.length + k), big = (0.9 * Math.max(...r)) / this.forceUnit
      const middle = [0, 1].map((d) => (walls[4 * wall + d] + walls[4 * wall + 2 + d]) / 2)
      this.arrow(...this.px(...middle), [motion[at] * big, motion[at + 1] * big], look.warm, 4)
    })
    for (let d = 0; d < r.length; d++) {
      const [vx, vy, spin] = [motion[3 * d], motion[3 * d + 1], motion[3 * d + 2]]
      const [px, py] = this.px(x[2 * d], x[2 * d + 1]), big = 0.9 * r[d] / this.forceUnit
      this.arrow(px, py, [vx * big, vy * big], look.warm, 4)
      if (Math.abs(spin) < 0.05) continue
      const R = 0.55 * r[d] * this.unit, turn = Math.max(-2.5, Math.min(2.5, 2 * spin))
      g.strokeStyle = look.warm
      g.lineWidth = 2.5
      g.beginPath()
      g.arc(px, py, R, -Math.PI / 2, -Math.PI / 2 - turn, turn > 0)
      g.stroke()
      const end = -Math.PI / 2 - turn, sign = Math.sign(turn), tip = [px + R * Math.cos(end), py + R * Math.sin(end)]
      const ahead = [sign * Math.sin(end), -sign * Math.cos(end)] // along the circle
      g.fillStyle = look.warm
      g.beginPath()
      g.moveTo(tip[0] + 9 * ahead[0], tip[1] + 9 * ahead[1])
      for (const side of [5, -5]) g.lineTo(tip[0] + side * ahead[1], tip[1] - side * ahead[0])
      g.fill()
    }
  }

  // Pointer

  find(px, py) {
    const { body } = this, { x, r } = body.scene
    if (!body.empty) {
      const F = body.forces(), unit = this.unit * this.forceUnit
      let best = null, least = 26
      for (const end of this.ends()) {
        const [ax, ay] = this.px(...end.at), [n, t] = [F[2 * end.contact], F[2 * end.contact + 1]]
        const tip = [ax + unit * (n * end.inward[0] + t * end.across[0]), ay - unit * (n * end.inward[1] + t * end.across[1])]
        const far = Math.min(Math.hypot(px - tip[0], py - tip[1]), Math.hypot(px - ax, py - ay) * 1.2)
        if (far < least) { least = far; best = { ...end, grip: [tip[0] - px, tip[1] - py] } }
      }
      if (best) return best
    }
    for (let d = 0; d < r.length; d++) {
      const [cx, cy] = this.px(x[2 * d], x[2 * d + 1]), outline = this.outline(d)
      if (outline ? inside(outline, this.back(px, py)) : Math.hypot(px - cx, py - cy) < r[d] * this.unit) return { disk: d, loose: true }
    }
    return null
  }

  grabbed(px, py, event) {
    const target = this.find(px, py)
    if (this.handler("press", { target, at: this.back(px, py) })) {
      this.held = { taken: true }
      this.canvas.setPointerCapture(event.pointerId)
      return
    }
    this.handler("select", target)
    if (!target || target.loose) return
    this.held = target
    this.canvas.setPointerCapture(event.pointerId)
    event.preventDefault()
  }

  moved(px, py) {
    if (this.held?.taken) return this.handler("carry", { at: this.back(px, py) })
    if (this.held) return this.pull(px, py)
    const target = this.find(px, py)
    this.canvas.style.cursor = target && !target.loose ? "grab" : "default"
    this.handler("hover", target)
  }

  pull(px, py) {
    const { contact, at, inward, across, grip } = this.held, [ax, ay] = this.px(...at)
    const unit = this.unit * this.forceUnit
    const force = [(px + grip[0] - ax) / unit, -(py + grip[1] - ay) / unit]
    this.handler("pull", { contact, normal: dot(force, inward), tangential: dot(force, across) })
  }
}
