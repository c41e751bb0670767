// A question that the hand answers: how strong, and how weak, one force of a small scene can get.

import { forceName, number } from "./saying.js"

const NEAR = 0.01 // of what is possible: this near to an end it has been found

export class Quest {
  constructor(host) { this.host = host; this.begin() }

  /** Nothing is found yet: another scene, or another S. */
  begin() { this.found = [false, false] }

  /** Of the normal force of a contact, with its [least, largest] if known; colour: of its axis, in words; moved: by hand. */
  look(body, contact, colour, ends, moved) {
    const [low, high] = (body.bounded && ends) || [NaN, NaN], room = high - low
    this.host.hidden = !(room > 1e-6 * body.scaleOf())
    if (this.host.hidden) return
    const value = body.forces()[2 * contact]
    if (moved) this.found = this.found.map((found, k) => found || Math.abs(value - [high, low][k]) < NEAR * room)
    const [most, least] = this.found, name = `the ${colour}${forceName(body.scene, 2 * contact)}`
    const now = most && least ? `✓ Any value from ${number(low)} to ${number(high)}: balance alone does not say which.`
      : most ? `✓ ${number(high)} is its largest. And its smallest?`
      : least ? `✓ ${number(low)} is its smallest. And its largest?`
      : "Drag the red dot and find out."
    const asked = `<b>Your turn: how strong can ${name} get?</b> <span>${now}</span>`
    if (asked !== this.asked) this.host.innerHTML = this.asked = asked
  }
}
