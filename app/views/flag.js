// A guess before the hand finds out: a flag on the axis of the force that is asked for.

import { line } from "./pen.js"
import { number } from "./saying.js"

const HIGH = 26, WIDE = 16 // pixels of its pole and its cloth
const REACH = 22 // pixels around it in which it is taken
const BEGIN = 0.88 // of its axis, where it waits

export class Flag {
  constructor() { this.begin() }

  /** It waits for a guess: in a new scene. */
  begin() { Object.assign(this, { value: null, axis: null }) }

  /** Which axis it stands on: d = 1 for one that goes up; its other coordinate, its ends, and pixels of a value 0 and 1. */
  on(axis) { this.axis = axis }

  /** How far along its axis it is, in pixels. */
  get along() {
    const { value, axis: { ends, zero, one } } = this
    return value === null ? ends[0] + BEGIN * (ends[1] - ends[0]) : zero + value * (one - zero)
  }

  get foot() {
    const { axis: { d, at }, along } = this
    return d ? [at, along] : [along, at]
  }

  near(px, py) {
    if (!this.axis) return false
    const [x, y] = this.foot, side = this.axis.d ? [HIGH / 2, 0] : [0, -HIGH / 2]
    return Math.hypot(px - x - side[0], py - y - side[1]) < REACH
  }

  move(px, py) {
    const { d, ends, zero, one } = this.axis, [low, high] = [...ends].sort((a, b) => a - b)
    this.value = Math.max(0, (Math.min(high, Math.max(low, d ? py : px)) - zero) / (one - zero))
  }

  draw(space) {
    const { context: g, look } = space, { axis: { d }, value } = this, [x, y] = this.foot
    const [tx, ty] = d ? [x + HIGH, y] : [x, y - HIGH]
    g.strokeStyle = g.fillStyle = look.guess
    g.lineWidth = 2
    line(g, [x, y], [tx, ty])
    g.beginPath()
    g.moveTo(tx, ty)
    if (d) for (const [a, b] of [[-WIDE, 0], [-WIDE / 2, -WIDE * 0.7]]) g.lineTo(tx + a, ty + b)
    else for (const [a, b] of [[0, WIDE * 0.7], [-WIDE, WIDE * 0.35]]) g.lineTo(tx + a, ty + b)
    g.fill()
    const words = value === null ? "your guess: drag" : `your guess ${number(value)}`
    space.write(d ? tx + 5 : tx, d ? ty : ty - 9, words, look.guess, 12, d ? "left" : "center")
  }
}
