// How the forces look: width, colour and marks of each contact's chain, as the model asks for them.

const WIDTH = 0.23 // of a chain that carries the mean normal force, in largest radii
const CARRYING = 1e-6 // in ⟨fₙ⟩; less is not drawn
const MARKED = 0.1 // of the contacts, as in Fig. 5 of the paper
const THIN = 0.15 // of its width, a chain that a filter leaves out
const DIM = 0.35 // chains under the marks of Fig. 5

class Look {
  constructor(model, walk) {
    this.model = model
    this.walk = walk
    this.only = null // 1 for each contact that a filter leaves, or null
    this.before = null // fₙ before the pull whose changes are coloured
    this.style = { width: new Float32Array(walk.contacts), bin: new Int16Array(walk.contacts) }
    this.strong = largest(walk.normal.subarray(0, walk.contacts))
    this.measure()
  }

  /** ΔFₙ: of exact intervals where known, else of all states. */
  measure() {
    const { model, walk } = this, exact = plain(model.exact ?? {})
    this.exact = exact.low?.length === walk.contacts ? exact : null
    const { low, high } = this.exact ?? walk
    this.extent = high.map((value, c) => value - low[c])
    this.loose = largest(this.extent)
    this.loads = model.loads?.length === walk.contacts ? model.loads : null
    this.mostLoad = Math.max(...(this.loads ?? [1]))
    this.gone = model.gone?.length === walk.contacts ? model.gone : null // of ΔFₙ, by what is known
  }

  /** The style of these forces, for the scene. */
  of(mixed) {
    const { model, style } = this, { thickness, reference, most, palettes } = model
    const colour = this.before ? "pulled" : model.colour
    this.asked = { thickness, colour, pinned: reference * this.walk.contacts, most } // a model is slow to ask
    for (let c = 0; c < style.width.length; c++) {
      const value = this.thickness(c, mixed)
      style.width[c] = value > CARRYING ? WIDTH * value * (this.only?.[c] === 0 ? THIN : 1) : 0
    }
    const told = (colour !== "mobilised" || this.walk.mu > 0) && (colour !== "known" || this.gone)
    style.colours = told ? palettes[this.before ? "change" : colour] : [palettes.neutral]
    const last = style.colours.length - 1
    for (let c = 0; c < style.bin.length; c++) {
      style.bin[c] = told ? Math.round(last * Math.max(0, Math.min(1, this.shade(c, mixed)))) : 0
    }
    style.alpha = model.overlay ? DIM : 1
    style.strong = model.overlay ? this.strong : null
    style.loose = model.overlay ? this.loose : null
    return style
  }

  /** fₙ of the pinned state. */
  pinned(c) { return this.walk.normal[this.asked.pinned + c] }

  /** What the width shows, in ⟨fₙ⟩. */
  thickness(c, { normal }) {
    const { thickness } = this.asked
    if (thickness === "extent") return this.extent[c]
    if (thickness === "load" && this.loads) return this.loads[c]
    if (thickness === "known" && this.gone) return this.gone[c]
    return thickness === "difference" ? Math.abs(normal[c] - this.pinned(c)) : normal[c]
  }

  /** Place on the scale of colours, 0 … 1. */
  shade(c, { normal, tangential }) {
    const { colour, most } = this.asked
    if (colour === "mobilised") return 0.5 + (this.mobilised(normal[c], tangential[c]) ?? 0) / 2
    if (colour === "extent") return most > 0 ? this.extent[c] / most : 0
    if (colour === "known") return this.gone[c] / Math.max(this.gone[c] + this.extent[c], CARRYING)
    if (colour === "load") return this.loads ? this.loads[c] / this.mostLoad : 0.5
    if (colour === "pulled") return 0.5 + (normal[c] - this.before[c]) / (2 * FULL)
    if (colour === "change") return 0.5 + (normal[c] - this.walk.normal[c]) / (2 * FULL)
    return 0.5 + 0.5 * Math.sign(normal[c] - this.pinned(c))
  }

  /** fₜ/(μ fₙ), or null where it means nothing. */
  mobilised(normal, tangential) {
    return this.walk.mu > 0 && normal > CARRYING ? tangential / (this.walk.mu * normal) : null
  }

  // What is told of the one under the pointer: rows of name and value

  contact(k, { mixed, seen, low, high }) {
    const { walk, exact } = this, c = walk.contact[k]
    const n = mixed.normal[c], t = mixed.tangential[c]
    const told = (from, to) => `${from.toFixed(3)} … ${to.toFixed(3)}`
    const rows = [
      ["contact", `${walk.backbone[c]} (disks ${walk.i[k]} – ${walk.j[k]})`],
      ["fₙ / ⟨fₙ⟩", n.toFixed(3)],
      ["fₜ / ⟨fₙ⟩", t.toFixed(3)],
      ["fₜ/(μ fₙ)", this.mobilised(n, t)?.toFixed(2) ?? "–"],
      ["original fₙ", walk.normal[c].toFixed(3)],
    ]
    if (seen) rows.push(["fₙ seen", told(low[c], high[c])])
    if (exact) rows.push(["fₙ possible", told(exact.low[c], exact.high[c])])
    return rows
  }

  grain(k) {
    const { walk } = this
    return [
      ["disk", `${walk.grain[k]}${walk.kind[k] % 2 ? " (rattler)" : ""}`],
      ["radius", walk.r[k].toFixed(3)],
      ["contacts", walk.touching[k]],
    ]
  }
}

/** Takes what the server sent, a Map or a plain object, as a plain object. */
function plain(given) {
  return given instanceof Map ? Object.fromEntries(given) : given
}

/** Which of the values are among the largest, MARKED of them: 1 or 0 each. */
function largest(values) {
  const order = Array.from(values.keys()).sort((a, b) => values[b] - values[a] || a - b)
  const marked = new Uint8Array(values.length)
  for (const c of order.slice(0, Math.max(1, Math.round(MARKED * values.length)))) marked[c] = 1
  return marked
}
