// The look of the forces: width, colour and marks of each contact's chain, as set in the model.

import { plain } from "../../browser/send.js"
import { touching } from "./images.js"

export const CARRYING = 1e-6 // in ⟨fₙ⟩; less is not drawn
const THIN = 0.15 // factor on the width of a chain excluded by a filter

/** A grain by its number; those behind walls stand for them. */
export const named = (grain, { centres }) => (2 * grain < centres.length ? grain : "wall")

/** A formatted number without the sign of a rounded zero. */
export const unsigned = (text) => text.replace(/^-(?=[0.]*$)/, "")

export class Look {
  constructor(model, walk) {
    this.model = model
    this.walk = walk
    this.scales = plain(model.scales)
    this.only = null // 1 for each contact that passes a filter, or null
    this.before = null // fₙ before the pull whose changes are coloured
    this.style = { width: new Float32Array(walk.contacts), bin: new Int16Array(walk.contacts) }
    if (walk.outlines?.length) this.style.lean = new Float32Array(walk.contacts) // fₜ/fₙ: the direction of a chain
    // Half the smaller disk, so that chains hide none.
    this.widest = Float32Array.from(walk.i, (i, c) => Math.min(...[i, walk.j[c]].map((grain) => walk.radius[grain] || Infinity)))
    this.touching = touching(walk)
    this.one = walk.outlines?.length ? "body" : "disk"
    this.measure()
  }

  /** ΔFₙ: of exact intervals if known, otherwise of all states. */
  measure() {
    const { model, walk } = this, exact = plain(model.exact ?? {})
    this.exact = exact.low?.length === walk.contacts ? exact : null
    const { low, high } = this.exact ?? walk
    this.extent = high.map((value, c) => value - low[c])
    this.loads = model.loads?.length === walk.contacts ? model.loads : null
    this.mostLoad = Math.max(...(this.loads ?? [1]))
    const measured = plain(model.measured ?? {})
    this.measured = measured.normal?.length === walk.contacts ? measured : null
    this.reduction = model.reduction?.length === walk.contacts ? model.reduction : null // reduction of ΔFₙ by known forces
    const known = new Set(plain(model.pins ?? {}).contacts)
    this.mostReduced = Math.max(CARRYING, ...(this.reduction ?? []).filter((_, c) => !known.has(c)))
  }

  /** The kinds of the intervals, in words: exact bounds obey held forces, networks only once sampled with them. */
  get bounds() { return this.reduction ? "exact given the held forces" : "exact" }
  get seen() { return this.reduction && this.model.ignoring ? "seen in all of S" : "seen" }

  /** Least and largest possible fₙ of a contact, as far as known. */
  boundsOf(c) { return this.exact ? [this.exact.low[c], this.exact.high[c]] : [0, Infinity] }

  /** The style of these forces, for the scene. */
  of(mixed) {
    const { model, style } = this, { thickness, most, palettes, full, most_change, stretch } = model
    const colour = this.before && model.colour === "change" ? "pulled" : model.colour
    // Reading the model is slow.
    this.settings = { thickness, colour, most, full: most_change }
    this.settings.load = full ?? this.mostLoad
    const unit = this.walk.unit * this.scales.width * (stretch ?? 1)
    for (let c = 0; c < style.width.length; c++) {
      const value = this.thickness(c, mixed)
      style.width[c] = value > CARRYING ? Math.min(unit * value, this.widest[c]) * (this.only?.[c] === 0 ? THIN : 1) : 0
    }
    for (let c = 0; c < style.lean?.length; c++) style.lean[c] = mixed.normal[c] > CARRYING ? mixed.tangential[c] / mixed.normal[c] : 0
    const coloured = (colour !== "mobilised" || this.walk.mu > 0) && (colour !== "known" || this.reduction) &&
      (colour !== "deviation" || this.measured) && (colour !== "load" || this.loads) &&
      (colour !== "extent" || most > 0 || !this.walk.free)
    style.colours = coloured ? palettes[model.colour] : [palettes.neutral]
    const last = style.colours.length - 1
    for (let c = 0; c < style.bin.length; c++) {
      style.bin[c] = coloured ? Math.round(last * Math.max(0, Math.min(1, this.shade(c, mixed)))) : 0
    }
    return style
  }

  /** The quantity shown by the width, in ⟨fₙ⟩. */
  thickness(c, { normal }) {
    const { thickness } = this.settings
    if (thickness === "extent") return this.extent[c]
    if (thickness === "load" && this.loads) return this.loads[c]
    if (thickness === "known" && this.reduction) return this.reduction[c]
    return thickness === "measured" && this.measured ? this.measured.normal[c] || 0 : normal[c]
  }

  /** Position on the colour scale, 0 … 1. */
  shade(c, { normal, tangential }) {
    const { colour, most } = this.settings
    if (colour === "mobilised") return 0.5 + (this.mobilised(c, normal[c], tangential[c]) ?? 0) / 2
    if (colour === "extent") return most > 0 ? this.extent[c] / most : 0
    if (colour === "deviation") return 0.5 + (this.measured.off[c] || 0) / (2 * this.scales.deviation)
    if (colour === "known") return this.reduction[c] / this.mostReduced
    if (colour === "load") return this.loads[c] / this.settings.load
    const before = colour === "pulled" ? this.before : this.walk.normal
    return 0.5 + (normal[c] - before[c]) / (2 * this.settings.full)
  }

  /** fₜ/(μ fₙ), or null if undefined. */
  mobilised(c, normal, tangential) {
    const friction = this.walk.friction[c]
    return friction > 0 && normal > CARRYING ? tangential / (friction * normal) : null
  }

  // Details of the contact under the pointer: rows of name and value

  contact(c, { mixed }) {
    const { walk, exact } = this
    const n = mixed.normal[c], t = mixed.tangential[c]
    const interval = (from, to) => `${from.toFixed(3)} … ${to.toFixed(3)}`
    const rows = [
      ["contact", `${walk.backbone[c]} (${this.one === "body" ? "bodies" : "disks"} ${named(walk.i[c], walk)} – ${named(walk.j[c], walk)})`],
      ["normal force fₙ, mean = 1", n.toFixed(3)],
      ["tangential force fₜ", unsigned(t.toFixed(3))],
      ["fₜ/(μ fₙ)", unsigned(this.mobilised(c, n, t)?.toFixed(2) ?? "–")],
      [`force ${walk.origin}`, walk.normal[c].toFixed(3)],
    ]
    const pins = plain(this.model.pins ?? {}), pin = [...(pins.contacts ?? [])].indexOf(c)
    if (pin >= 0) rows.push(["held at", pins.words[pin]])
    if (exact) rows.push([`interval of fₙ, ${this.bounds}`, interval(exact.low[c], exact.high[c])])
    if (walk.number.length > 1) rows.push([`interval of fₙ, ${this.seen}`, interval(walk.low[c], walk.high[c])])
    return rows
  }

  grain(grain, { mixed }) {
    const count = this.touching[grain], rows = [[this.one, `${grain}${count ? "" : " (loose)"}`], ["contacts", count]]
    if (this.one === "body") return rows
    rows.splice(1, 0, ["radius", this.walk.radius[grain].toFixed(3)])
    const { pressure, shear, angle } = this.stressOn(grain, mixed)
    if (!(pressure > 0)) return rows
    const degrees = Math.round((angle * 180) / Math.PI)
    return [...rows,
      ["pressure / mean", (pressure / this.meanPressure(mixed)).toFixed(2)],
      ["shear / pressure", `${(shear / pressure).toFixed(2)}, pressed most at ${degrees}°`],
    ]
  }

  /** The forces on a grain: {arm ax, ay from its centre, force fx, fy} of each contact. */
  forcesOn(grain, { normal, tangential }) {
    const { i, j, starts, reach, centres, radius } = this.walk, r = radius[grain], body = this.one === "body", forces = []
    for (let c = 0; c < i.length; c++) {
      if (i[c] !== grain && j[c] !== grain) continue
      const [dx, dy] = [reach[2 * c], reach[2 * c + 1]], far = Math.hypot(dx, dy), out = i[c] === grain ? 1 : -1
      const nx = dx / far, ny = dy / far, n = normal[c], t = tangential[c]
      // The normal points from i to j, and the force acts on j; t = (−n_y, n_x).
      forces.push({
        ax: body ? starts[2 * c] + dx / 2 - centres[2 * grain] : out * r * nx,
        ay: body ? starts[2 * c + 1] + dy / 2 - centres[2 * grain + 1] : out * r * ny,
        fx: -out * (n * nx - t * ny),
        fy: -out * (n * ny + t * nx),
      })
    }
    return forces
  }

  /** Stress on a disk, σ = (1/πr²) Σ r n F, compression positive: its mean principal stress, half the
   * difference of the two, and the direction of the larger, −90° … 90°. */
  stressOn(grain, mixed) {
    let xx = 0, yy = 0, xy = 0
    for (const { ax, ay, fx, fy } of this.forcesOn(grain, mixed)) {
      xx -= ax * fx
      yy -= ay * fy
      xy -= (ax * fy + ay * fx) / 2
    }
    const unit = 1 / (Math.PI * this.walk.radius[grain] ** 2), shear = unit * Math.hypot((xx - yy) / 2, xy)
    return { pressure: (unit * (xx + yy)) / 2, shear, angle: Math.atan2(2 * xy, xx - yy) / 2 }
  }

  /** Mean pressure of the grains, weighted by area. */
  meanPressure({ normal }) {
    const { i, j, radius } = this.walk
    const virial = normal.reduce((sum, force, c) => sum + force * (radius[i[c]] + radius[j[c]]), 0)
    return virial / (2 * Math.PI * radius.reduce((sum, r) => sum + r * r, 0))
  }
}
