// Chapters of small scenes: the disks with their forces, and the explored part of S over one or two
// forces.

import { unflat } from "../../browser/canvas_paths.js"
import { Arrows } from "../drawing/scene_canvas.js"
import { Body } from "../model/polytope.js"
import { fixed, middleOf } from "../model/middle.js"
import { palette } from "../drawing/palette.js"

const FOUND = 0.01 // relative distance from the end at which it counts as found
const WAY = 1500 // stored positions of the drag
const STEPS = 20, SECONDS = 0.4 // to other forces behind the same dot

export class SceneExperiment {
  /** options: {scene, x, y}: forces on the axes, 2 c for the normal one of contact c; y null for a line. */
  constructor(host, options, changed) {
    Object.assign(this, { host, options, changed, way: [], locked: true, answered: false, lit: new Set() })
    this.canvas = host.appendChild(document.createElement("canvas"))
    Object.assign(this.canvas, { role: "img", ariaLabel: "Disks, and the force on them at every contact" })
    this.arrows = new Arrows(this.canvas, (what, given) => this.respond(what, given))
  }

  async load(source) {
    const scene = await source.get("scene", this.options.scene)
    this.scene = scene
    this.body = new Body(scene).cut(scene.mu)
    if (this.body.whole) this.body.u = [...this.body.middle]
    else {
      this.body.goInside()
      this.body.u = middleOf(this.body)
    }
    this.start = this.at
    this.mean = this.body.sumAt(this.body.u) / this.body.count
    if (this.body.whole) this.end(this.body.interval(this.options.x), this.corners)
    else this.ends = source.get("ends", this.options.scene).then(({ bounds, outline }) => this.end(bounds[this.options.x / 2], unflat([...outline])))
  }

  /** Whether the answer can be found: if S is not drawn whole, only the server knows it. */
  ready() { return this.ends }

  /** The least and the largest value of the quantity, and the corners of S on its axes, in order. */
  end([low, high], outline) { Object.assign(this, { low, high, outline }) }

  /** Corners of a polygon S on its axes, in order. */
  get corners() {
    const { body, options: { x, y } } = this
    const flat = body.corners.map(({ u }) => { const F = body.forces(u); return [F[x], y === null ? 0 : F[y]] })
    const [a, b] = [0, 1].map((d) => flat.reduce((sum, point) => sum + point[d], 0) / flat.length)
    return flat.sort((one, other) => Math.atan2(one[1] - b, one[0] - a) - Math.atan2(other[1] - b, other[0] - a))
  }

  get at() {
    const F = this.body.forces(), { x, y } = this.options
    return [F[x], y === null ? 0 : F[y]]
  }

  get value() { return this.at[0] }
  get answer() { return this.high }

  /** Numbers that the text needs. */
  get facts() {
    const { scene, body } = this
    const weight = [...scene.load].reduce((sum, v, k) => sum + (k % 3 === 1 ? -v : 0), 0)
    return {
      contacts: body.count, disks: scene.r.length, equations: scene.equations, free: body.h, mu: scene.mu,
      low: this.low, high: this.high, weight, start: this.start[0], mean: this.mean, others: this.others,
    }
  }

  /** Move the dot to these values, as far as S extends. */
  drag(x, y) {
    const { body, options } = this
    if (options.y !== null) body.steer([options.x, options.y], [x, y])
    body.steer([options.x], [x]) // at the edge of S the other force yields
    this.moved()
  }

  /** Where S is drawn as a shadow, other forces behind the same dot. */
  get offer() { return this.body.whole ? null : { words: "Change the other forces", run: () => this.change() } }

  /** Walk to another point of S with the same forces on the axes; there is none behind the edge of the shadow. */
  change() {
    const { body, options: { x, y } } = this, from = body.u
    this.random ??= fixed()
    let to = from
    for (let k = 0; k < STEPS; k++) to = body.step(to, this.random, [x, y])
    this.others = Math.hypot(...to.map((v, d) => v - from[d])) > FOUND * body.scaleOf()
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches
    this.go(from, to, still ? -Infinity : performance.now())
  }

  /** Move from one point of S to another, which began at this time. */
  go(from, to, began) {
    const part = Math.min(1, (performance.now() - began) / (1000 * SECONDS))
    this.body.u = from.map((v, d) => v + part * (to[d] - v))
    this.changed()
    if (part < 1) this.frame = requestAnimationFrame(() => this.go(from, to, began))
  }

  moved() {
    cancelAnimationFrame(this.frame)
    this.others = null
    const { at, way } = this, before = way.at(-1) ?? this.start
    if (!way.length) way.push(this.start)
    if (Math.hypot(at[0] - before[0], at[1] - before[1]) > 1e-3) way.push(at)
    if (way.length > WAY) way.splice(1, 1)
    if (this.high - at[0] < FOUND * (this.high - this.low)) this.answered = true
    this.changed()
  }

  respond(what, given) {
    if (what === "hover" && !this.arrows.held) {
      this.lit = new Set(given && !given.loose ? [given.contact] : [])
      this.changed()
    }
    if (this.locked) return what === "press"
    if (what === "pull") {
      this.body.pull(given.contact, given.normal, given.tangential)
      this.moved()
    }
    return false
  }

  /** The contents of the plot. */
  get picture() {
    const { way, answered, options: { y }, low, high, outline } = this, xs = way.map(([x]) => x)
    const line = way.length ? [[[Math.min(...xs), 0], [Math.max(...xs), 0]]] : []
    return {
      now: this.at,
      seen: y === null ? line : way.length ? [way] : [],
      exact: !answered ? [] : y === null ? [[[low, 0], [high, 0]]] : [outline],
      filled: y !== null,
      brush: y === null ? 10 : 14,
      clip: y === null ? null : outline,
    }
  }

  draw(dark) {
    const { arrows, body, canvas, options: { x, y } } = this
    if (!body || !canvas.clientWidth) return
    if (arrows.body !== body || arrows.wide !== canvas.clientWidth) {
      arrows.fit(body)
      arrows.wide = canvas.clientWidth
    }
    const colours = palette(dark), axes = new Map(y === null ? [] : [[x, colours.across], [y, colours.up]])
    arrows.draw({ ...colours, axes, contacts: this.lit, contact: null, disk: null, fall: null })
  }

  stop() { cancelAnimationFrame(this.frame) }
}
