// The same number of disks packed with increasing friction, each packing running through its
// networks.

import { PackingExperiment } from "./packing_experiment.js"

const SECONDS = 0.8 // from one network to the next

export class Friction extends PackingExperiment {
  async load(source, frictions) {
    Object.assign(this, { source, frictions, visited: new Map(), mu: 0.1 })
    this.still = window.matchMedia("(prefers-reduced-motion: reduce)").matches
    await this.go(this.mu)
    this.curve = source.get("curve").then((curve) => { this.curve = curve })
    this.frame = requestAnimationFrame((time) => this.play(time))
    for (const mu of frictions) source.get("packing", String(mu)).catch(() => {}) // in advance
  }

  /** Show the packing at a friction. */
  async go(mu) {
    const packing = await this.source.get("packing", String(mu))
    if (!this.locked) this.visited.set(mu, packing)
    this.found ||= this.enough()
    if (mu === this.mu) { // otherwise the slider has moved on
      this.packing = packing
      this.network = Float32Array.from(this.asPacked(packing))
      this.before = this.asPacked(packing)
      this.canvas.show(packing, packing.typical)
    }
    this.changed()
  }

  play(time) {
    this.frame = requestAnimationFrame((next) => this.play(next))
    const { packing, palettes, network } = this, rows = packing.number.length, { normal, contacts } = packing
    if (!this.canvas.scene.root.isConnected) return
    const at = (time / 1000 / SECONDS) % (rows - 2), part = this.still ? 0 : at % 1, row = 1 + Math.floor(at)
    if (this.still && row === this.row) return
    this.row = row
    for (let c = 0; c < contacts; c++) network[c] = (1 - part) * normal[row * contacts + c] + part * normal[(row + 1) * contacts + c]
    this.canvas.draw(network, this.before, palettes)
  }

  /** Whether the friction at which forces vary most was visited, and those on both sides of it. */
  enough() {
    const { frictions, visited, answer } = this, k = frictions.indexOf(answer)
    return k > 0 && [k - 1, k, k + 1].every((at) => at >= frictions.length || visited.has(frictions[at]))
  }

  get finds() { return this.visited.size }

  get value() { return this.mu }

  /** The visited friction at which forces vary most. */
  get answer() {
    const rows = [...this.visited.values()]
    return rows.length ? rows.reduce((one, other) => (other.spread > one.spread ? other : one)).mu : NaN
  }

  get facts() {
    const rows = [...this.visited.values()].sort((a, b) => a.mu - b.mu).map((packing) => this.counted(packing))
    return { ...this.counted(this.packing), rows }
  }

  drag(x) {
    const away = (mu) => Math.abs(Math.log(mu / x))
    const mu = this.frictions.reduce((one, other) => (away(other) < away(one) ? other : one))
    if (mu === this.mu && this.visited.has(mu)) return
    this.visited.set(this.packing.mu, this.packing)
    this.mu = mu
    this.changed()
    this.go(mu)
  }

  get picture() {
    const rows = this.facts.rows, { curve, found } = this
    return {
      now: [this.mu, this.packing.spread], words: `μ = ${this.mu}`,
      dots: rows.map(({ mu, spread }) => [mu, spread]), seen: [], brush: 2,
      thin: true, exact: found && curve.mu ? [curve.mu.map((mu, k) => [mu, curve.spread[k]]).filter(([mu]) => mu >= this.frictions[0])] : [],
    }
  }

  stop() {
    cancelAnimationFrame(this.frame)
    super.stop()
  }
}
