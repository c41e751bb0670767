// One force of 400 disks is dragged: all others follow along networks computed by the server. The
// marked one is asked for, and goes a little way before the prediction; any other can be dragged too, from the network on
// screen. options: marked: which contact is marked, as the packing names it.

import { networkAt } from "../../packing/replay/replay.js"
import { OPENS } from "../../packing/drawing/first_motion.js"
import { PackingExperiment } from "./packing_experiment.js"

const FOUND = 0.01 // of the distance between both ends
const CHANGED = 0.1 // mean forces: contacts that changed by more are counted
const TASTE = 0.3 // of the way to an end: so far a force can be pulled before the prediction
const LONG = 1.6 // a drag over the whole picture, relative to the distance between both ends

export class Grab extends PackingExperiment {
  async load(source) {
    const { marked } = this.options, packing = await source.get("packing", "0.1"), contact = packing[marked]
    Object.assign(this, { source, packing, contact, held: null })
    this.network = this.before = this.asPacked(packing)
    this.tangential = packing.tangential.subarray(0, packing.contacts)
    this.start = this.value
    this.canvas.show(packing, contact)
    this.fetching = true
    this.fetched = source.get("rail", marked).then((rail) => {
      Object.assign(this, { rail: { ...rail, contact }, first: rail, fetching: false })
      if (this.wanted) this.pull(...this.wanted)
    })
  }

  /** The force of the marked line. */
  get value() { return this.network[this.contact] }

  get answer() { return this.packing.largest[this.contact] }

  get facts() {
    const { packing, contact } = this
    return { ...this.counted(packing), start: this.start, low: packing.least[contact], high: packing.largest[contact], changed: this.changesTo(this.first?.normal.subarray(-packing.contacts) ?? []), ...this.atEnd }
  }

  /** A promise: dragging has to wait for the first rail. */
  ready() {
    this.say("")
    return this.fetched
  }

  /** Predictions are not below what the hand has seen. */
  get possible() { return [this.seen?.[1] ?? this.start, Infinity] }

  /** Number of other forces that change from the first network to this one. */
  changesTo(network) {
    return network.reduce((sum, v, c) => sum + (Math.abs(v - this.before[c]) > CHANGED && c !== this.contact ? 1 : 0), 0)
  }

  /** At the end of the first rail: contacts that are open or slip. */
  get atEnd() {
    const [normal, tangential] = ["normal", "tangential"].map((name) => this.first?.[name].subarray(-this.packing.contacts) ?? [])
    const marks = this.marks(normal, tangential), among = (kind) => marks.filter((mark) => mark === kind).length
    return { opened: among(OPENS), sliding: among(1) }
  }

  drag(x) { this.pull(this.contact, () => x) }

  /** How far the force of the rail goes: a little way before the prediction. */
  get reach() {
    const { rail: { values }, start, locked } = this
    return [values[0], values.at(-1)].map((end) => (locked ? start + TASTE * (end - start) : end))
  }

  /** Give a contact the force value(its rail), as far as possible, once its rail is there. */
  async pull(contact, value) {
    this.wanted = [contact, value]
    if (!this.rail) this.say("finding how far it can be pulled …")
    if (this.fetching) return
    if (this.rail.contact !== contact) {
      this.fetching = true
      try {
        const rail = await this.source.get("rail", String(contact), [...this.network, ...this.tangential])
        this.rail = { ...rail, contact }
      } catch (error) {
        return this.say(error.message)
      } finally {
        this.fetching = false
      }
      return this.pull(...this.wanted)
    }
    const { rail, seen, start, locked } = this, [low, high] = this.reach, asked = value(rail), now = Math.min(high, Math.max(low, asked))
    const { normal, tangential } = networkAt(rail, now)
    Object.assign(this, { network: normal, tangential })
    this.seen = [Math.min(this.value, seen?.[0] ?? start), Math.max(this.value, seen?.[1] ?? start)]
    if (contact === this.contact) {
      this.answered ||= !locked && high - now < FOUND * (high - low)
      this.say(locked && asked !== now ? "It goes further. First predict how far." : `${this.changesTo(normal)} other forces follow, by more than ${CHANGED}`)
    } else this.say(`this line: ${now.toFixed(2)}, possible ${rail.lower.toFixed(2)} to ${rail.upper.toFixed(2)}`)
    this.changed()
  }

  takes(contact) { return !this.locked || contact === this.contact }

  /** Contacts at their limits, once there is an answer. */
  get limited() { return this.answered ? super.limited : null }

  take(contact) {
    this.held = contact
    this.taken = this.network[contact]
    if (contact !== this.contact) this.say(`this line: ${this.taken.toFixed(2)}; finding how far it can be pulled …`)
    this.pulled(0)
  }

  pulled(part) {
    const { held, taken } = this
    this.pull(held, ({ values }) => taken + LONG * part * (values.at(-1) - values[0]))
  }

  release() {
    this.held = null
    this.changed()
  }

  get picture() {
    const { packing, contact, seen, answered } = this, level = (x) => [x, 0]
    return { now: [this.value, 0], seen: seen?.map(level), exact: answered ? [packing.least[contact], packing.largest[contact]].map(level) : [] }
  }
}
