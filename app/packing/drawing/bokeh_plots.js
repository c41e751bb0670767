// Bokeh plots next to the packing, found in the page by name: some numeric columns are updated in
// place, without telling the server.

import { Handles, Layer, LAYERS } from "./plot_layer.js"

export class Plots {
  /** hands: handlers for dragging the dots of the bars, and the point in force space. */
  constructor(document, onData, { dots, point }) {
    this.document = document
    this.handles = [
      new Handles(this, "bars", "bars", ["rank", "now"], dots),
      new Handles(this, "path", "current", ["x", "y"], point),
    ]
    this.plane = {}
    this.onData = onData
    this.heard = new Set()
    this.layers = {} // by the name of the source in their plot
    this.moving = false
    this.colours = {}
    this.placed = { count: 0, drawn: 0 } // states of a walk in progress: placed in force space, and drawn by Bokeh
  }

  /** Draw moving parts on layers, or at rest let Bokeh draw them. */
  move(on) {
    this.moving = on
    if (on) return
    for (const layer of Object.values(this.layers)) layer.take(false)
    this.drawPlaced()
  }

  /** The layer of a plot, if it is on screen. */
  layer(name) {
    const fig = named(this.document, `${name}_figure`), known = this.layers[name]
    if (!fig || known?.fig === fig) return known
    return (this.layers[name] = new Layer(fig, (context, scales) => LAYERS[name](context, scales, this, this.replay)))
  }

  /** Show new contents of a source, on its layer during motion. */
  changed(source, name) {
    const layer = this.layer(name)
    layer?.take(this.moving)
    if (layer?.on) layer.paint()
    else source.change.emit()
  }

  /** A source by name; its changes are watched from now on. */
  find(name) {
    const source = named(this.document, name)
    if (source) this.watch(source)
    return source
  }

  /** Watch for new contents of a source, which the server computes from the states, not from a pull. */
  watch(source) {
    if (this.heard.has(source)) return
    this.heard.add(source)
    source.properties.data.change.connect(this.onData)
  }

  /** Intervals, and the measures of a walk in progress. */
  show(replay, scale) {
    this.replay = replay
    const bars = this.find("bars"), growth = this.find("growth"), { walk, frame } = replay
    if (bars?.get_column("at")) this.showBars(bars, replay, scale)
    if (!walk.numbers || !(growth?.get_column("state")?.length >= walk.number.length)) return
    let most = 0
    for (const name of ["eta1", "eta2", "eta3"]) {
      const column = growth.get_column(name), factor = name === "eta3" ? 0.15 : 1, all = walk[name]
      for (let k = 0; k <= frame; k++) {
        column[k] = factor * all[k]
        if (column[k] > most) most = column[k]
      }
      column.fill?.(NaN, frame + 1)
    }
    this.reach(most)
    this.changed(growth, "growth")
  }

  /** Extend the axis of η to η, which is unknown while states are being computed. */
  reach(most) {
    const range = named(this.document, "growth_range")
    if (most > range?.end) range.end = 1.25 * most
  }

  /** The present forces; for a walk in progress also the values seen, which otherwise do not change. */
  showBars(bars, { walk, mixed }, scale) {
    const column = (name) => bars.get_column(name)
    const at = column("at"), bottom = column("low"), top = column("high"), now = column("now")
    const grows = Boolean(walk.numbers)
    let reached = 0
    for (let k = 0; k < now.length; k++) {
      const c = at[k], unit = scale === "own" ? walk.normal[c] : 1
      now[k] = mixed.normal[c] / unit
      if (!grows) continue
      bottom[k] = walk.low[c] / unit
      top[k] = walk.high[c] / unit
      if (top[k] > reached) reached = top[k]
    }
    const axis = grows && scale !== "own" && named(this.document, "bars_range")
    if (1.04 * reached > axis?.end) axis.end = 1.04 * reached
    this.changed(bars, "bars")
  }

  /** The position of a network in the plane on screen, or null if its contacts are not in it. */
  projected({ normal, tangential }) {
    const { xn, xt, yn, yt, origin } = this.plane
    if (xn?.length !== normal.length) return null
    let [x, y] = [-origin[0], -origin[1]]
    for (let c = 0; c < normal.length; c++) {
      x += xn[c] * normal[c] + xt[c] * tangential[c]
      y += yn[c] * normal[c] + yt[c] * tangential[c]
    }
    return [x, y]
  }

  /** Place the states of a walk in progress in force space as they arrive. */
  fill({ walk }) {
    const path = this.find("path"), x = path?.get_column("x"), y = path?.get_column("y")
    const { contacts, number, numbers } = walk
    const { data } = path ?? {}, { plane } = this, { placed } = this
    if (data !== placed.data || plane !== placed.plane || !numbers) Object.assign(placed, { data, plane, count: 0, drawn: 0 })
    if (!numbers || x?.length !== numbers.length || plane.xn?.length !== contacts) return
    const { x_range, y_range } = this.layer("path")?.fig ?? {}
    let outside = placed.drawn === 0
    for (; placed.count < number.length; placed.count++) {
      const k = placed.count, cut = (values) => values.subarray(k * contacts, (k + 1) * contacts)
      const [px, py] = this.projected({ normal: cut(walk.normal), tangential: cut(walk.tangential) })
      x[k] = px
      y[k] = py
      if (x_range && !(px > x_range.start && px < x_range.end && py > y_range.start && py < y_range.end)) outside = true
    }
    if (outside || !this.moving) this.drawPlaced() // otherwise their layer shows them meanwhile
  }

  /** Let Bokeh draw the states in force space that it has not drawn yet, and fit the axes. */
  drawPlaced() {
    const { placed } = this
    if (placed.drawn === placed.count) return
    placed.drawn = placed.count
    this.find("path")?.change.emit()
  }

  /** Points that move along a path: sources with the tags "follows", name of the path, name of tab. */
  follow(tabs, replay) {
    this.replay = replay
    if (tabs.includes("plane")) this.fill(replay)
    const [a, b, part] = replay.spot
    for (const model of this.document._all_models.values()) {
      const [word, name, on] = model.tags ?? []
      if (word !== "follows" || !tabs.includes(on)) continue
      const path = this.find(name)
      if (!path) continue
      this.watch(model)
      const held = name === "path" && replay.held && this.projected(replay.mixed)
      if (held) {
        [model.get_column("x")[0], model.get_column("y")[0]] = held
        this.changed(model, name)
        continue
      }
      for (const column of Object.keys(model.data)) {
        const along = path.get_column(column)
        if (along) model.get_column(column)[0] = (1 - part) * along[a] + part * along[b]
      }
      this.changed(model, name)
    }
  }
}

/** The model of a name: the newest of several, while a plot moves from one place to another. */
function named(page, name) {
  return [...page._all_models.values()].findLast((model) => model.name === name) ?? null
}
