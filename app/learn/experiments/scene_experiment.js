// Chapters of small scenes: the bodies with their forces, and the explored part of S over one or two
// forces.

import { STILL, eased } from "../../browser/motion.js"
import { Arrows } from "../drawing/scene_canvas.js"
import { area, distance, dot, hull } from "../model/polytope.js"
import { palette } from "../drawing/palette.js"
import { givesWay, part, slide } from "../model/give_way.js"
import { SceneInHand } from "../model/scene_in_hand.js"
import { stopping } from "../model/sentences.js"
import { createElement } from "../../browser/dom.js"

const FOUND = 0.01 // relative distance from an end at which it counts as found
const ROUND = 0.9 // part of S that a path round it has to enclose
const ENDLESS = 100 // of the loads: how far an unbounded S is drawn, beyond all axes
const GIVES = 0.2 // of the largest radius: most that bodies move at an end of S
const SOFT = 3 // per weight: how fast they move when the hand goes past the end
const FALL = 0.9 // s, of a body that no forces hold
const FRICTION = { label: "friction μ", max: 1.2, step: 0.05, stage: 2 }

export class SceneExperiment {
  /**
   * options: {scene, x, y}: forces on the axes, 2 c for the normal one of contact c; y null for a line. goal: where the dot
   * has to go: to "both" ends or "round" S.
   */
  constructor(host, options, changed) {
    Object.assign(this, { host, options, changed, steered: true, locked: true, answered: false, lit: new Set(), way: [] })
    this.canvas = host.appendChild(createElement("canvas", { role: "img", ariaLabel: "What is in balance, and the force on it at every contact" }))
    this.label = host.appendChild(createElement("div", { className: "label" }))
    this.arrows = new Arrows(this.canvas, (what, given) => this.respond(what, given))
  }

  async load(source) {
    const scene = this.scene = await source.get("scene", this.options.scene)
    this.hand = new SceneInHand(scene, () => {})
    this.begun = this.body.u
    this.start = this.at
    if (this.body.whole) this.end()
  }

  get body() { return this.hand.body }

  /** Farther than any axis: where S is cut if it has no end. */
  get far() { return ENDLESS * this.body.scaleOf() }

  /** S at the present friction: [least, largest] value of the quantity, and the corners on its axes. */
  measured() {
    const { body, options: { x }, far } = this, ends = body.corners.flatMap(({ u }) => [u, ...body.rays.map((ray) => u.map((v, d) => v + far * ray[d]))])
    return { bounds: body.empty ? [] : body.interval(x), outline: hull(ends.map((u) => this.flat(u))) }
  }

  end() {
    this.S = this.measured()
    if (this.first) return
    [this.low, this.high] = (this.first = this.S).bounds
    this.smooth = this.frictionless()
  }

  // Friction

  get knob() { return FRICTION }

  /** Another friction: S is cut again, and explored anew. */
  turn(mu) {
    this.hand.cut(mu)
    Object.assign(this, { way: [], varied: mu !== this.scene.mu, past: null })
    this.end()
    this.fall()
    this.changed()
  }

  get turned() { return { value: this.body.mu, words: this.friction } }

  get friction() { return `μ = ${Number(this.body.mu.toFixed(2))}` }

  /** The friction that the question was asked for, and its answer. */
  get before() {
    const { scene: { mu }, first: { bounds }, options: { goal } } = this
    return `With μ = ${mu}, as asked: ${goal === "both" ? "from " : ""}${(goal === "both" ? bounds : [this.high]).map((v) => v.toFixed(2)).join(" to ")}.`
  }

  /** S at another friction, in words. */
  get headline() {
    const { varied, scene, body, S: { bounds: [low, high] } } = this, mu = this.friction
    if (!varied) return ""
    if (low === undefined) return `${mu}: nothing holds ${scene.r.length > 1 ? "them" : "it"}, S is empty.`
    if (!body.bounded) return `${mu}: S has no end.`
    return high - low < 1e-6 ? `${mu}: S is one point, ${low.toFixed(2)}.` : `${mu}: from ${low.toFixed(2)} to ${high.toFixed(2)}.`
  }

  get bodies() { return `${this.scene.one}${this.scene.r.length > 1 ? "s" : ""}` }

  /** What is about to slip or to open where the dot is, at the edge of S, in words. */
  get edge() {
    const { body } = this, met = ({ slope, rest }) => Math.abs(dot(slope, body.u) + rest) < 1e-6 * body.scaleOf()
    if (this.locked || body.empty || body.corners.length < 2) return ""
    const stops = body.rows.filter(met).map(({ contact, what }) => [contact, what])
    return this.past ? `with ${this.past.sign > 0 ? "more" : "less"}, the ${this.bodies} would move` : stopping(body, { stops })
  }

  // Motion

  /**
   * How the bodies move if the normal force of a wall were to go past its interval, towards this value: {sign, contact, motion, size};
   * null if they do not. The force goes to the end of its interval.
   */
  beyond(index, value) {
    const { body, scene } = this, contact = index >> 1
    if (scene.j[contact] < scene.r.length) return null // between two disks
    const [low, high] = body.empty ? [] : body.interval(index), sign = value > high ? 1 : value < low ? -1 : 0
    if (!sign) return null
    body.goToEnd(index, sign)
    const motion = givesWay(body, contact, sign), far = Math.abs(value - (sign > 0 ? high : low)) / body.scaleOf()
    if (!motion) return null
    const most = Math.max(...motion.flatMap(([x, y, turn], d) => [Math.hypot(x, y), Math.abs(turn) * scene.r[d]]))
    return { sign, contact, motion, size: (GIVES * Math.max(...scene.r) * (1 - Math.exp(-SOFT * far))) / most }
  }

  /** Let go: bodies return. */
  release() {
    if (!this.past) return
    this.past = null
    this.changed()
  }

  /** If no forces hold a single body at two walls any more, it slides down; otherwise it is where it was. */
  fall() {
    const { body, arrows, slid, scene } = this, falls = body.empty && scene.r.length === 1 && body.count === 2
    this.slid = falls ? slid ?? { poses: slide(body, arrows.touching()), began: performance.now() } : null
  }

  /** Poses on screen, null where nothing has moved, and the wall that moves with a body. */
  get motion() {
    const { slid, past, scene, arrows } = this
    if (slid) {
      const share = STILL.matches ? 1 : Math.min(1, (performance.now() - slid.began) / 1000 / FALL)
      return { poses: slid.poses[Math.round(share ** 2 * (slid.poses.length - 1))], moves: share < 1 }
    }
    this.pushed = past ?? this.pushed // whose motion runs back
    const size = past?.size ?? 0, [gone] = this.gone = eased(this.gone ?? [0], [size]), moves = gone !== size
    if (!gone) return { poses: null, moves }
    const { contact, motion, sign } = this.pushed, { at, inward } = arrows.touching().find((end) => end.contact === contact)
    return { poses: part(motion, gone), pushed: { wall: wallAt(scene, at), by: inward.map((v) => sign * gone * v) }, moves }
  }

  // Forces

  /** Forces on the axes, at a point of S. */
  flat(u) {
    const F = this.body.forces(u), { x, y } = this.options
    return [F[x], y === null ? 0 : F[y]]
  }

  get at() { return this.flat(this.body.u) }
  get value() { return this.at[0] }
  get answer() { return this.high }

  /** What the prediction is compared with in the end: one value, or all possible ones. */
  get range() { return [this.options.goal === "both" ? this.low : this.answer, this.answer] }

  /** Numbers that the text needs. */
  get facts() {
    const { scene, body } = this
    const weight = [...scene.load].reduce((sum, v, k) => sum + (k % 3 === 1 ? -v : 0), 0)
    return {
      contacts: body.count, disks: scene.r.length, equations: scene.equations, free: body.h, mu: scene.mu,
      low: this.low, high: this.high, smooth: this.smooth, weight, endless: !body.bounded, empty: body.empty,
    }
  }

  /** On a line S, the quantity where the friction of its contact is zero. */
  frictionless() {
    const { body, options: { x } } = this, [a, b] = body.corners?.map(({ u }) => body.forces(u)) ?? []
    return a && b ? a[x] - (a[x + 1] * (b[x] - a[x])) / (b[x + 1] - a[x + 1]) : NaN
  }

  /** Move the dot to these values, as far as S extends. */
  drag(x, y) {
    const { body, options } = this
    if (body.empty) return
    if (options.y !== null) body.steer([options.x, options.y], [x, y])
    body.steer([options.x], [x]) // at the edge of S the other force yields
    this.past = this.beyond(options.x, x) ?? (options.y === null ? null : this.beyond(options.y, y))
    this.moved()
  }

  /** To both ends, or round S, and to the answer. */
  finish({ x, y }) {
    const { S: { outline }, options: { goal } } = this, ends = [x.low, x.high, this.answer].map((to) => [to, y?.high ?? 0])
    for (const [px, py] of goal === "round" ? [...outline, ...ends] : ends) this.drag(px, py)
  }

  moved() {
    this.way = hull([...(this.way.length ? this.way : [this.varied ? this.at : this.start]), this.at])
    this.answered ||= this.reached
    this.changed()
  }

  /** Whether the dot has been where it has to go. */
  get reached() {
    if (this.options.goal === "round") return this.enclosed > ROUND
    const { low, high } = this, near = FOUND * (high - low), xs = this.way.map(([x]) => x)
    return high - Math.max(...xs) < near && Math.min(...xs) - low < near
  }

  /** Part of the area of S that the path encloses. */
  get enclosed() { return area(this.way) / area(this.first.outline) }

  /** An arrow is pulled: a contact, towards these forces. */
  pulled({ contact, normal, tangential }) {
    this.body.pull(contact, normal, tangential)
    this.past = this.beyond(2 * contact, normal)
    this.moved()
  }

  respond(what, given) {
    if (what === "hover" && !this.arrows.held) {
      this.lit = new Set(given && !given.loose ? [given.contact] : [])
      this.changed()
    }
    if (this.locked) return what === "press"
    if (what === "pull") this.pulled(given)
    if (what === "release") this.release()
    return false
  }

  /** Whether the force shown is the one asked for. */
  get hidden() { return this.locked && this.options.goal === "both" }

  /** The contents of the plot. */
  get picture() {
    const { way, answered, varied, options: { goal, y }, S, body } = this
    const round = goal === "round" && !this.locked && !answered ? `, ${Math.round(100 * this.enclosed)} % of S` : ""
    return {
      now: body.empty || this.hidden ? null : this.at, words: `now ${this.value.toFixed(2)}${round}`,
      seen: way, exact: answered ? S.outline : [], endless: !body.bounded, filled: y !== null, unanswered: varied || goal === "both",
    }
  }

  /** Colours of forces: of those on the axes of the plot. */
  coloured({ across, up }) {
    const { x, y } = this.options
    return new Map(y === null ? [] : [[x, across], [y, up]])
  }

  /** Draw the forces on their way to the point of S; returns whether they have not arrived. */
  draw(dark) {
    const { arrows, hand, canvas } = this
    if (!hand || !canvas.clientWidth) return false
    const { body } = hand, { u } = body
    if (arrows.body !== body || arrows.wide !== canvas.clientWidth) {
      body.u = this.begun // the same scale, wherever the dot is
      arrows.fit(body)
      arrows.wide = canvas.clientWidth
    }
    body.u = this.shown = eased(this.shown, u)
    this.label.textContent = this.edge
    const colours = palette(dark), axes = this.coloured(colours), { poses, pushed, moves } = this.motion
    arrows.draw({ ...colours, axes, contacts: this.lit, contact: null, disk: null, fall: null, unnamed: this.hidden, places: 2, poses, pushed })
    body.u = u
    return this.shown !== u || moves
  }

  stop() {}
}

/** The number of the wall on which a point lies. */
function wallAt({ walls }, [x, y]) {
  const far = Array.from({ length: walls.length / 4 }, (_, k) => distance(walls.slice(4 * k, 4 * k + 2), walls.slice(4 * k + 2, 4 * k + 4), x, y))
  return far.indexOf(Math.min(...far))
}
