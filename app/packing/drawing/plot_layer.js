// Moving parts of the plots next to the packing, on separate canvases above the static parts: while
// the player plays or a force is dragged, Bokeh draws nothing. At rest Bokeh draws the same parts.

import { createElement } from "../../browser/dom.js"
import { circle, line } from "../../browser/canvas_paths.js"

const TRAIL = 4 // states in the trail in force space
const DOT_REACH = 9 // px from a dot that still count as the dot
const TOUCH_REACH = 22 // the same for a finger

export class Layer {
  /** A figure whose moving renderers have the tag "moves"; draw(context, scales) draws them. */
  constructor(fig, draw) {
    this.fig = fig
    this.draw = draw
    this.on = false
    this.canvas = createElement("canvas", { className: "layer", style: "position: absolute; inset: 0; pointer-events: none" })
  }

  get view() {
    if (!this.cached?.el?.isConnected) this.cached = this.fig.document?.views_manager?.find_one(this.fig) ?? null
    return this.cached
  }

  /** Take the moving parts over from Bokeh, or give them back. */
  take(on) {
    if (on === this.on || (on && !this.view?.frame)) return
    this.on = on
    for (const renderer of this.fig.renderers) {
      if (renderer.tags.includes("moves")) renderer.setv({ visible: !on }, { sync: false })
    }
    if (!on) this.canvas.remove()
  }

  paint() {
    const { view, canvas } = this, frame = view?.frame, root = view?.canvas_view?.shadow_el
    if (!this.on || !frame || !root) return
    if (canvas.parentNode !== root) root.insertBefore(canvas, root.querySelector(".bk-events"))
    const ratio = window.devicePixelRatio || 1, { width, height } = view.canvas_view.bbox
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio)
      canvas.height = Math.round(height * ratio)
      canvas.style.width = `${width}px`
      canvas.style.height = `${height}px`
    }
    const context = canvas.getContext("2d"), { left, top, width: w, height: h } = frame.bbox
    context.setTransform(ratio, 0, 0, ratio, 0, 0)
    context.clearRect(0, 0, width, height)
    context.save()
    context.beginPath()
    context.rect(left, top, w, h)
    context.clip()
    this.x = linear(frame.x_scale)
    this.y = linear(frame.y_scale)
    this.draw(context, this)
    context.restore()
  }
}

/** A linear Bokeh scale as a plain function. */
function linear(scale) {
  const zero = scale.compute(0), slope = scale.compute(1) - zero
  return (value) => zero + slope * value
}

export const LAYERS = {
  bars(context, { x, y, fig }, plots) {
    const glyph = (name) => fig.renderers.find((each) => each.name === name).glyph
    const column = (name) => plots.find("bars").get_column(name)
    const rank = column("rank"), low = column("low"), high = column("high")
    const now = column("now"), original = column("original")
    const half = 0.5 * glyph("seen").width.value * Math.abs(x(1) - x(0)), radius = (name) => glyph(name).size.value / 2
    context.fillStyle = plots.colours.seen
    for (let k = 0; k < rank.length; k++) {
      const top = y(high[k])
      context.fillRect(x(rank[k]) - half, top, 2 * half, y(low[k]) - top)
    }
    context.fillStyle = plots.colours.original
    dots(context, rank, original, x, y, radius("packed"))
    context.fillStyle = plots.colours.dots
    dots(context, rank, now, x, y, radius("dots"))
    context.fillStyle = plots.colours.now
    const chosen = plots.find("chosen")?.get_column("rank")?.[0]
    const at = chosen === undefined ? -1 : rank.indexOf(chosen)
    if (at < 0) return
    circle(context, [x(rank[at]), y(now[at])], 6)
    context.fill()
  },

  growth(context, { x, y }, plots, { frame }) {
    const growth = plots.find("growth"), state = growth.get_column("state")
    for (const name of ["eta1", "eta2", "eta3"]) {
      context.strokeStyle = plots.colours[name]
      context.lineWidth = 2
      const eta = growth.get_column(name), count = Math.min(frame + 1, state.length)
      context.beginPath()
      for (let k = 1; k < count; k++) context.lineTo(x(state[k]), y(eta[k]))
      context.stroke()
    }
  },

  path(context, { x, y }, plots, replay) {
    const path = plots.find("path"), px = path.get_column("x"), py = path.get_column("y")
    const [a, b, part] = replay.spot, mix = (values) => (1 - part) * values[a] + part * values[b]
    if (!(b < px.length)) return
    context.fillStyle = plots.colours.states
    for (let k = plots.placed.drawn; k < plots.placed.count; k++) context.fillRect(x(px[k]) - 2, y(py[k]) - 2, 4, 4)
    context.lineWidth = 2.2
    context.strokeStyle = plots.colours.now
    const held = replay.held && plots.projected(replay.mixed)
    if (replay.held && !held) return
    if (held) return spot(context, [x(held[0]), y(held[1])], plots)
    const from = Math.max(0, replay.frame - TRAIL)
    const points = Array.from({ length: replay.frame + 1 - from }, (_, k) => [x(px[from + k]), y(py[from + k])])
    points.push([x(mix(px)), y(mix(py))])
    for (let k = 1; k < points.length; k++) {
      context.globalAlpha = 0.85 * (k / points.length) ** 2
      line(context, points[k - 1], points[k])
    }
    context.globalAlpha = 1
    spot(context, points[points.length - 1], plots)
  },
}

/** The state on screen, in force space, as Bokeh draws it (tabs/force_space/space_figure.py). */
function spot(context, [px, py], plots) {
  context.fillStyle = plots.colours.now
  context.strokeStyle = "white"
  context.lineWidth = 1.5
  circle(context, [px, py], 6)
  context.fill()
  context.stroke()
}

function dots(context, xs, ys, x, y, radius) {
  context.beginPath()
  for (let k = 0; k < xs.length; k++) {
    context.moveTo(x(xs[k]) + radius, y(ys[k]))
    context.arc(x(xs[k]), y(ys[k]), radius, 0, 2 * Math.PI)
  }
  context.fill()
}

/** Points that can be dragged in a plot: hand.take(k, x, y), move(x, y), leave(), in the units of the plot. */
export class Handles {
  /** The points k of a source, in these columns, on the plot with the layer `name`. */
  constructor(plots, name, source, columns, hand) {
    Object.assign(this, { plots, name, source, columns, hand })
    this.taken = null // id of the pointer that drags one
    this.heard = ["pointerdown", "pointermove", "pointerup", "pointercancel"].map((name) => {
      const hear = (event) => this.hear(event)
      window.addEventListener(name, hear, { capture: true }) // before Bokeh, which would pan
      return () => window.removeEventListener(name, hear, { capture: true })
    })
  }

  remove() { for (const end of this.heard) end() }

  hear(event) {
    const { type, pointerId } = event
    if (this.taken === null && type !== "pointerdown") return
    const view = this.plots.layer(this.name)?.view, element = view?.canvas_view?.el
    if (!element) return
    if (this.taken === null && type === "pointerdown" && event.button === 0 && event.composedPath().includes(element)) {
      const k = this.nearest(event, element, view.frame)
      if (k < 0) return
      this.taken = pointerId
      view.canvas_view.events_el?.dispatchEvent(new PointerEvent("pointerout", event)) // otherwise a tooltip remains
      this.hand.take(k, ...this.place(event, element, view.frame))
    } else if (this.taken === pointerId && type === "pointermove") {
      this.hand.move(...this.place(event, element, view.frame))
    } else if (this.taken === pointerId) {
      this.taken = null
      this.hand.leave()
    } else return
    event.stopPropagation()
    event.preventDefault()
  }

  place(event, element, { x_scale, y_scale }) {
    const box = element.getBoundingClientRect()
    return [x_scale.invert(event.clientX - box.left), y_scale.invert(event.clientY - box.top)]
  }

  nearest(event, element, { x_scale, y_scale }) {
    const source = this.plots.find(this.source), box = element.getBoundingClientRect()
    const px = event.clientX - box.left, py = event.clientY - box.top
    const [x, y] = this.columns.map((name) => source?.get_column(name) ?? [])
    let best = -1, least = event.pointerType === "touch" ? TOUCH_REACH : DOT_REACH
    for (let k = 0; k < x.length; k++) {
      const away = Math.hypot(x_scale.compute(x[k]) - px, y_scale.compute(y[k]) - py)
      if (away < least) { least = away; best = k }
    }
    return best
  }
}
