// The same number of disks packed with increasing friction: at every stop, the picture and the numbers are
// those of one packing, which runs through its networks.

import { STILL } from "../../browser/motion.js"
import { PackingExperiment } from "./packing_experiment.js"

const SECONDS = 0.8 // from one network to the next

const START = 0.1 // friction
const nearest = (list, mu) => list.reduce((one, other) => (Math.abs(Math.log(other / mu)) < Math.abs(Math.log(one / mu)) ? other : one))

export class Friction extends PackingExperiment {
  async load(source) {
    const { mu, spread, free } = await source.get("curve")
    Object.assign(this, { stops: [...mu], spreads: [...spread].map((part) => 100 * part), free: [...free], packings: new Map(), visited: new Set() })
    this.value = nearest(this.stops, START)
    const fetched = this.stops.map((one) => source.get("packing", String(one)).then((packing) => this.packings.set(one, packing)))
    this.fetched = Promise.all(fetched)
    await fetched[this.stops.indexOf(this.value)]
    this.go()
    this.frame = requestAnimationFrame((time) => this.play(time))
  }

  /** A promise: dragging has to wait for all packings. */
  ready() { return this.fetched }

  /** Show the packing of the present stop. */
  go() {
    const packing = this.packing = this.packings.get(this.value)
    this.network = Float32Array.from(this.asPacked(packing))
    this.before = this.asPacked(packing)
    this.shown = null
    this.canvas.show(packing, null)
    this.answered ||= this.visited.size === this.stops.length
    this.changed()
  }

  play(time) {
    this.frame = requestAnimationFrame((next) => this.play(next))
    const { packing, network } = this, rows = packing.number.length, { normal, contacts } = packing
    if (!this.host.isConnected) return
    const at = (time / 1000 / SECONDS) % (rows - 2), part = STILL.matches ? 0 : at % 1, row = 1 + Math.floor(at)
    if (STILL.matches && row === this.row) return
    this.row = row
    for (let c = 0; c < contacts; c++) network[c] = (1 - part) * normal[row * contacts + c] + part * normal[(row + 1) * contacts + c]
    this.draw(null, this.palettes)
  }

  /** The friction at which forces vary most. */
  get answer() { return this.stops[this.spreads.indexOf(Math.max(...this.spreads))] }

  get facts() {
    const { packing, packings } = this
    return { ...this.counted(packing), spread: packing.spread, packings: this.stops.length, rows: [...packings.values()].sort((one, other) => one.mu - other.mu) }
  }

  /** Move to the nearest stop, past all stops on the way. */
  drag(x) {
    const { stops, value } = this, to = nearest(stops, x), [low, high] = [Math.min(to, value), Math.max(to, value)]
    for (const stop of stops) if (stop >= low && stop <= high) this.visited.add(stop)
    if (to === value) return
    this.value = to
    this.go()
  }

  /** To the ends, and to the answer. */
  finish({ x }) { for (const to of [x.low, x.high, this.answer]) this.drag(to) }

  get picture() {
    const { stops, spreads, free, value, visited } = this, now = stops.indexOf(value), top = stops.indexOf(this.answer), curve = stops.map((mu, k) => [mu, spreads[k]])
    const been = ([mu]) => mu === value || visited.has(mu), seen = curve.filter(been)
    return {
      now: curve[now], words: `μ = ${value}`, seen, dots: seen, curve: true, second: stops.map((mu, k) => [mu, free[k]]).filter(been),
      names: this.answered ? [{ at: curve[top + 1], scale: "y", words: "forces vary by" }, { at: [stops[1], free[1]], scale: "right", words: "free numbers" }] : [],
    }
  }

  stop() {
    cancelAnimationFrame(this.frame)
    super.stop()
  }
}
