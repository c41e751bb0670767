// A question that the hand answers. Famous scenes have one of their own; in all others it is how
// strong, and how weak, one force can get.

import { forceName, number } from "./saying.js"

const NEAR = 0.01 // of what is possible: this near to an end it has been found
const FIND = "Drag the red dot and find out."

/** By scenes: what is asked, from which normal force on, or how many times the other axis' force, and what is said then. */
const OWN = {
  groove: {
    ask: "can you make the normal force at the left wall larger than the weight?", least: 1.005, goal: 1,
    done: (value, high) => `✓ It presses with ${number(value)}, the disk weighs 1, and all is in balance. At ${number(high)} friction can do no more.`,
  },
  box: {
    of: "between", // if that is the force up: which two forces are axes depends on friction
    ask: "can you make the normal force between the disks (violet) larger than 3.5 (each disk weighs 1)?", least: 3.5, goal: 3.5,
    done: (value) => `✓ ${number(value)}, and everything still balances.`,
  },
  thirteen: {
    ask: "can you make the violet normal force three times as strong as the green one?", times: 3,
    done: () => "✓ And everything still balances.",
  },
}

export class Quest {
  constructor(host) { this.host = host; this.begin() }

  /** How many times the force across the one up is to be, and which value a normal force is to pass; undefined where nothing such is asked. */
  get times() { return this.asked?.times }
  get goal() { return this.asked?.goal }

  /** Nothing is found yet: another scene, or another S. */
  begin() { Object.assign(this, { found: [false, false], best: -Infinity }) }

  /**
   * Of the normal force of a contact, with its [least, largest] if known; colour: of its axis, in
   * words; place: of the dot, across and up; moved: by hand.
   */
  look(body, contact, { colour, ends, place, moved }) {
    const [low, high] = (body.bounded && ends) || [NaN, NaN], room = high - low
    const none = !(room > 1e-6 * body.scaleOf())
    this.host.classList.toggle("none", none)
    this.asked = undefined
    if (none) return
    const value = body.forces()[2 * contact], known = OWN[body.scene.name]
    this.ratio = place[1] / place[0]
    const own = this.asked = known && body.scene.names[contact].startsWith(known.of ?? "") ? known : undefined
    const reached = own ? [own.times ? place[1] >= own.times * place[0] : value >= own.least] : [high, low].map((end) => Math.abs(value - end) < NEAR * room)
    if (moved) this.found = this.found.map((found, k) => found || Boolean(reached[k]))
    const said = own ? this.own(own, value, high) : this.both(low, high)
    const ask = own ? own.ask : `how strong can the ${colour}${forceName(body.scene, 2 * contact)} get?`
    const text = `<b>Your turn: ${ask}</b> <span>${said}</span>`
    if (text !== this.text) this.host.innerHTML = this.text = text
  }

  own({ least, times, done }, value, high) {
    if (high < least) return "Not with this friction: take more."
    if (!this.found[0]) return times ? `${FIND} It is ${this.ratio.toFixed(1)} times as strong now.` : FIND
    this.best = Math.max(value, this.best)
    return done(this.best, high)
  }

  both(low, high) {
    const [most, least] = this.found
    if (most && least) return `✓ Any value from ${number(low)} to ${number(high)}: balance alone does not say which.`
    if (most) return `✓ ${number(high)} is its largest. And its smallest?`
    return least ? `✓ ${number(low)} is its smallest. And its largest?` : FIND
  }
}
