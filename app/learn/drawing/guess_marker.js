// A guess before the hand finds out: a marker on the axis of the force that is asked for.

import { line, polygon } from "../../browser/canvas_paths.js"
import { number } from "../model/sentences.js"

const HIGH = 16, WIDE = 16 // pixels
const REACH = 22 // pixels around it in which it is taken
const WAITS = [110, 28] // pixels across and up beyond where the force is, until it was dragged: clear of its number

/** The first gesture, pointed out. */
function tag({ context: g, look, easel }, [x, y], words) {
  g.font = "13px sans-serif"
  g.textAlign = "left"
  g.textBaseline = "middle"
  g.fillStyle = look.hand
  const wide = g.measureText(words).width + 12, left = Math.min(x, easel.wide - wide - 2)
  g.fillRect(left, y - 11, wide, 21)
  g.fillStyle = look.paper
  g.fillText(words, left + 6, y)
}

export class Flag {
  constructor() { this.begin() }

  /** It waits for a guess: in a new scene. */
  begin() { Object.assign(this, { value: null, axis: null }) }

  /** Which axis it stands on: d = 1 for one that goes up; its other coordinate, its ends; now: where the force is, and pixels of a value 0 and 1. */
  on(axis) { this.axis = axis }

  /** How far along its axis it is, in pixels. */
  get along() {
    const { value, axis: { d, now, zero, one } } = this
    return value === null ? now + Math.sign(one - zero) * WAITS[d] : zero + value * (one - zero)
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
    g.strokeStyle = look.guess
    g.lineWidth = 1
    g.setLineDash([3, 5])
    line(g, [x, y], d ? [space.easel.wide - 10, y] : [x, 20])
    g.setLineDash([])
    const sides = [-WIDE / 2, WIDE / 2].map((half) => (d ? [x + HIGH, y + half] : [x + half, y - HIGH]))
    polygon(g, [[x, y], ...sides])
    g.fillStyle = look.guess
    g.fill()
    const words = value === null ? "your guess: drag me" : `your guess ${number(value)}`
    const place = d ? [x + HIGH + 5, y - 12] : [x + 5, y - HIGH - 12]
    if (value === null) tag(space, place, words)
    else space.write(...place, words, look.guess, 12, "left")
  }
}
