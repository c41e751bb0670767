// The same number of disks packed with increasing friction. The plot has the means of the study at
// every stop; the picture shows the stored packing with the nearest friction, running through its
// networks.

import { STILL } from "../../browser/motion.js"
import { PackingExperiment } from "./packing_experiment.js"

const SECONDS = 0.8 // from one network to the next

const START = 0.1 // friction
const nearest = (list, mu) => list.reduce((one, other) => (Math.abs(Math.log(other / mu)) < Math.abs(Math.log(one / mu)) ? other : one))

export class Friction extends PackingExperiment {
  async load(source) {
    const { mu, spread, packed, touching, free } = await source.get("curve")
    Object.assign(this, { stops: [...mu], spreads: [...spread], packed: [...packed], touching: [...touching], free: [...free], packings: new Map(), visited: new Set() })
    this.value = nearest(this.stops, START)
    const fetch = (one) => source.get("packing", String(one)).then((packing) => this.packings.set(one, packing))
    const fetched = new Map([...new Set(this.packed)].map((one) => [one, fetch(one)]))
    await fetched.get(this.packed[this.stops.indexOf(this.value)])
    this.go()
    for (const one of fetched.values()) one.then(() => this.go(), () => {}) // packings that are missing are not shown
    this.frame = requestAnimationFrame((time) => this.play(time))
  }

  /** Show the packing of the present stop, once it is there. */
  go() {
    const { packings, packed, stops, value, visited } = this, packing = packings.get(packed[stops.indexOf(value)])
    if (packing && packing !== this.packing) {
      this.packing = packing
      this.network = Float32Array.from(this.asPacked(packing))
      this.before = this.asPacked(packing)
      this.canvas.show(packing, packing.grabbed)
      this.say(`picture: a packing made at μ = ${packing.mu}`)
    }
    this.answered ||= visited.size === stops.length
    this.changed()
  }

  play(time) {
    this.frame = requestAnimationFrame((next) => this.play(next))
    const { packing, palettes, network } = this, rows = packing.number.length, { normal, contacts } = packing
    if (!this.host.isConnected) return
    const at = (time / 1000 / SECONDS) % (rows - 2), part = STILL.matches ? 0 : at % 1, row = 1 + Math.floor(at)
    if (STILL.matches && row === this.row) return
    this.row = row
    for (let c = 0; c < contacts; c++) network[c] = (1 - part) * normal[row * contacts + c] + part * normal[(row + 1) * contacts + c]
    this.canvas.draw(network, this.before, palettes)
  }

  /** The friction at which forces vary most. */
  get answer() { return this.stops[this.spreads.indexOf(Math.max(...this.spreads))] }

  get facts() {
    const { packing, stops, spreads, touching, free } = this
    return { ...this.counted(packing), rows: stops.map((mu, k) => ({ mu, touching: touching[k], free: free[k], spread: spreads[k] })) }
  }

  /** Move to the nearest stop, past all stops on the way. */
  drag(x) {
    const { stops, value } = this, to = nearest(stops, x), [low, high] = [Math.min(to, value), Math.max(to, value)]
    for (const stop of stops) if (stop >= low && stop <= high) this.visited.add(stop)
    this.value = to
    this.go()
  }

  /** To the ends, and to the answer. */
  finish({ x }) { for (const to of [x.low, x.high, this.answer]) this.drag(to) }

  get picture() {
    const { stops, spreads, free, value, visited, answered } = this, now = stops.indexOf(value), curve = stops.map((mu, k) => [mu, spreads[k]])
    const been = ([mu]) => mu === value || visited.has(mu)
    return {
      now: curve[now], words: `μ = ${value}: ${free[now].toFixed(0)} free`, dots: curve.filter(been),
      second: stops.map((mu, k) => [mu, free[k]]).filter(been), thin: true, exact: answered ? curve : [],
    }
  }

  stop() {
    cancelAnimationFrame(this.frame)
    super.stop()
  }
}
