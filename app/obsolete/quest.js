// Questions that the hand answers. Famous scenes have some of their own, one after the other; in all others
// it is how strong, and how weak, one force can get.

import { forceName, number } from "../learn/model/sentences.js"

const NEAR = 0.01 // of what is possible: this near to an end it has been found
const FIND = "Drag the red dot and find out."
const GUESS = "Guess first, with the grey marker; then drag the red dot."
const SLIDE = "Drag the friction slider."

const single = (body) => !body.empty && body.whole && body.corners.length === 1
const endless = (body) => !body.empty && !body.bounded
const ONE_LEFT = { ask: "at which friction is just one set of forces left?", reached: single, done: "✓ Without friction everything is determined." }

/**
 * By scenes, what is asked: how large a normal force can get; below which value, or how many times the other
 * axis' force, whether or not S hides in fog meanwhile; or what is to become of S. of: what that force's name begins with, as axes depend on friction.
 */
const OWN = {
  groove: [
    { ask: "how large can the normal force at the left wall get? (The disk weighs 1.)", how: "Drag the red dot to the right until it stops.", largest: true, done: "✓ That large: friction can do no more." },
    ONE_LEFT,
    { ask: "from which friction on can the walls press as hard as you like?", reached: endless, done: "✓ As steep as the walls are, the wedges let them: the disk has jammed itself." },
  ],
  box: [
    { of: "between", ask: "how large can the violet normal force get? (Each disk weighs 1.)", how: "Drag the red dot to the highest point that it reaches.", largest: true, done: "✓ That large: wedged between the walls, the disks press far harder than they weigh." },
    ONE_LEFT,
    { ask: "from which friction on can they press as hard as you like?", reached: endless, done: "✓ The disks have jammed themselves." },
  ],
  thirteen: [
    { ask: "can you make the violet normal force three times the green one?", times: 3, hides: true, done: "✓ And everything still balances." },
    { ask: "can you bring the violet force below 2?", most: 2, done: "✓ That, too." },
    { ask: "with how little friction do these disks still hold?", reached: (body) => body.empty, done: "✓ Below that nothing balances: these disks need some friction." },
  ],
}

export class Quest {
  constructor(host) { this.host = host; this.begin() }

  /** How many times the force across the one up is to be, and below which value; undefined where nothing such is asked. */
  get times() { return this.asked?.times }
  get goal() { return this.asked?.most }
  /** Whether the answer is to be found out, not seen. */
  get fog() { return Boolean(this.asked?.largest || this.asked?.hides) }

  /** Another scene: from its first question on. */
  begin() {
    Object.assign(this, { step: 0, told: "" })
    this.again()
  }

  /** Another S of the same disks. */
  again() { this.found = [false, false] }

  /**
   * Ask of the normal force that goes up in the picture of S, or across, and have that show what is asked;
   * bounds: of all contacts, where S is not drawn whole; moved: whether by hand; hides: whether the answer is to
   * be found out, and may be guessed before.
   */
  ask(space, { bounds, moved, hides }) {
    const { body, axed, read } = space, contact = body.count && body.h && !body.empty ? read.at(-1) ?? 0 : null
    const ends = contact === null ? null : body.whole ? body.interval(2 * contact) : bounds?.[contact]
    const colour = axed.at(-1) === 2 * contact ? "violet " : ""
    this.look(body, contact, { colour, ends, place: space.flat(body.u), moved, hides, guess: space.flag.value })
    const asks = hides && this.asked?.largest, told = this.step === 1 && space.flag.value !== null
    Object.assign(space, { ray: this.times, goal: this.goal, flagged: Boolean(asks || told) })
  }

  /**
   * Of the normal force of a contact, with its [least, largest] if known; colour: of its axis, in
   * words; place: of the dot, across and up; moved: by hand; guess: of what is asked, or null.
   */
  look(body, contact, { colour, ends, place, moved, hides, guess }) {
    const [low, high] = (body.bounded && ends) || [NaN, NaN], room = high - low
    const steps = OWN[body.scene.name] ?? [], value = contact === null ? NaN : body.forces()[2 * contact]
    const now = { body, value, low, high, times: place[1] / place[0], hides, guess, moved }
    const own = this.step >= steps.length || steps[this.step].reached || body.scene.names[contact]?.startsWith(steps[this.step].of ?? "")
    if (steps.length && own && reaches(steps[this.step], now, moved)) {
      const { done, largest } = steps[this.step++]
      this.told = largest && guess !== null ? `${done} It is ${number(high)}; you guessed ${number(guess)}.` : done
    }
    const step = own ? steps[this.step] : undefined, over = steps.length > 0 && this.step === steps.length
    const none = !over && !step?.reached && !(room > 1e-6 * body.scaleOf())
    this.host.classList.toggle("none", none)
    this.asked = none ? undefined : step
    if (none) return
    const text = over ? this.told : step ? this.next(step, steps.length, now) : this.both(`${colour}${forceName(body.scene, 2 * contact)}`, now, moved)
    if (text !== this.text) this.host.innerHTML = this.text = text
  }

  next(step, count, now) {
    const turn = this.step ? `${this.told} <b>Next` : "<b>Your turn"
    return `${turn} (${this.step + 1} of ${count}): ${step.ask}</b> <span>${hint(step, now)}</span>`
  }

  both(name, { value, low, high }, moved) {
    const near = [high, low].map((end) => Math.abs(value - end) < NEAR * (high - low))
    if (moved) this.found = this.found.map((found, k) => found || near[k])
    const [most, least] = this.found
    const said = most && least ? `✓ Any value from ${number(low)} to ${number(high)}: balance alone does not say which.`
      : most ? `✓ ${number(high)} is its largest. And its smallest?` : least ? `✓ ${number(low)} is its smallest. And its largest?` : FIND
    return `<b>Your turn: how strong can the ${name} get?</b> <span>${said}</span>`
  }
}

/** Whether what is asked is so: by hand, of forces. */
function reaches(step, { body, value, low, high, times }, moved) {
  if (!step) return false
  if (step.reached) return step.reached(body)
  return moved && ((step.largest && high - value < NEAR * (high - low)) || value < step.most || times >= step.times)
}

/** What is to be done. */
function hint({ most, times, reached, largest, how }, { low, times: by, hides, guess, moved }) {
  if (reached) return SLIDE
  if (how) return largest && hides && guess === null && !moved ? GUESS : how
  if (low > most) return "Not with this friction: try another."
  return times ? `${FIND} It is ${by.toFixed(1)} times the green one now.` : FIND
}
