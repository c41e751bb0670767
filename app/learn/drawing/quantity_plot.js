// A plot of one or two quantities: the range explored, the prediction, the dot and, once found, the
// answer. Drawn as SVG, so that its handles have roles, focus and keys.

const NS = "http://www.w3.org/2000/svg"
const PILL = { high: 26, letter: 6.8, padding: 18 } // px
const GAP = 5, INSET = 12 // px between a line and words next to it, and between two axes and the dot at their ends
const GRAB = 26 // px from the dot within which dragging does not move it
const NEAR = 0.05 // of the axis: a prediction that is right
const STEPS = 60, FAST = 5 // keyboard steps along an axis; with the Shift key, so many at once
let plots = 0 // so far: names what clips them

function element(parent, tag, attributes = {}) {
  const child = parent.appendChild(document.createElementNS(NS, tag))
  for (const [name, value] of Object.entries(attributes)) child.setAttribute(name, value)
  return child
}

/** One axis: {low, high, label, log, symbol, digits: of values in words, ticks, stops, follows: whether the other one sets its value}, and its position in pixels. */
export class Scale {
  constructor(axis, from, to) { Object.assign(this, { axis, from, to }) }

  part(value) {
    const { low, high, log } = this.axis, turn = log ? Math.log10 : (v) => v
    return (turn(value) - turn(low)) / (turn(high) - turn(low))
  }

  px(value) { return this.from + this.part(value) * (this.to - this.from) }

  value(px) {
    const { low, high, log } = this.axis, part = Math.min(1, Math.max(0, (px - this.from) / (this.to - this.from)))
    return log ? low * (high / low) ** part : low + part * (high - low)
  }

  /** The value one keyboard step further: the next stop, if there are stops. */
  step(value, sign, fast) {
    const { stops } = this.axis
    if (!stops) return this.value(this.px(value) + ((fast ? FAST : 1) * sign * (this.to - this.from)) / STEPS)
    const further = stops.filter((stop) => sign * (stop - value) > 1e-9 * stop)
    return (sign > 0 ? further[0] : further.at(-1)) ?? value
  }

  get ticks() {
    const { low, high, ticks } = this.axis
    if (ticks) return ticks
    const size = Math.abs(this.to - this.from) < 340 ? 4 : 7, raw = (high - low) / size, ten = 10 ** Math.floor(Math.log10(raw))
    const step = ten * [1, 2, 5, 10].find((k) => k * ten >= raw)
    return Array.from({ length: Math.floor((high - low) / step + 1e-9) + 1 }, (_, k) => low + k * step)
  }
}

export class QuantityPlot {
  /** axes: {x, y}, y null for a single quantity. hears: {marker(value), dot(x, y)}: called when dragged; {release()}: and when let go. */
  constructor(host, { x, y = null, second = null }, hears) {
    Object.assign(this, { host, axes: { x, y, second }, hears, allowed: null, state: {} })
    const svg = this.svg = element(host, "svg", { role: "group", "aria-label": x.label })
    this.frame = element(svg, "g")
    const inside = `inside${++plots}`, clip = { "clip-path": `url(#${inside})` }
    this.inside = element(element(svg, "clipPath", { id: inside }), "rect")
    this.exact = element(svg, "path", { class: "exact", ...clip })
    this.further = element(svg, "g", { class: "further" })
    this.second = element(svg, "path", { class: "second" })
    this.seen = element(svg, "path", { class: "visited", ...clip })
    this.names = element(svg, "g", { class: "names" })
    this.dots = element(svg, "path", { class: "dots" })
    this.lines = element(svg, "g", { class: "lines" })
    this.answer = this.flag("answer")
    this.marker = this.flag("marker")
    const slider = { role: "slider", tabindex: -1, "aria-orientation": "horizontal" }
    for (const [name, value] of Object.entries({ ...slider, "aria-label": `your prediction: ${x.label}` })) this.marker.group.setAttribute(name, value)
    this.dot = element(svg, "g", { class: "now", ...slider, "aria-label": `now: ${x.label}` })
    element(this.dot, "circle", { r: 9 })
    this.reading = element(this.dot, "text", { y: -18, "text-anchor": "middle" })
    this.listen()
    new ResizeObserver(() => this.fit()).observe(host)
  }

  flag(name) {
    const group = element(this.svg, "g", { class: name })
    return { group, line: element(group, "line"), box: element(group, "rect", { height: PILL.high, rx: 6 }), text: element(group, "text", { "text-anchor": "middle" }) }
  }

  /** Fit the size of the host and lay out everything again. */
  fit() {
    const { clientWidth: wide, clientHeight: high } = this.host
    if (!wide || !high) return
    this.svg.setAttribute("viewBox", `0 0 ${wide} ${high}`)
    const left = this.axes.y ? 66 : 26, bottom = high - 54, end = wide - (this.axes.second ? 62 : 26), pad = this.axes.y ? INSET : 0
    Object.assign(this, { wide, high, left, bottom, end, top: 44 })
    this.x = new Scale(this.axes.x, left + pad, end - pad)
    this.y = this.axes.y ? new Scale(this.axes.y, bottom - INSET, this.top) : null
    this.right = this.axes.second ? new Scale(this.axes.second, this.y.from, this.y.to) : null
    for (const [key, value] of Object.entries({ x: left, y: this.y?.to ?? 0, width: end - left, height: (this.y?.from ?? bottom) - (this.y?.to ?? 0) })) this.inside.setAttribute(key, value)
    this.drawAxes()
    this.draw(this.state)
  }

  /** Height of the drawing for a single quantity. */
  get level() { return (this.top + this.bottom) / 2 + 4 }

  place([x, y]) { return [this.x.px(x), this.y ? this.y.px(y) : this.level] }

  drawAxes() {
    const { frame, left, wide, bottom, end, top, x } = this
    frame.replaceChildren()
    element(frame, "path", { class: "axis", d: `M${left} ${bottom}H${end}` })
    for (const tick of x.ticks) {
      const at = x.px(tick)
      element(frame, "path", { class: "axis", d: `M${at} ${bottom}v5` })
      element(frame, "text", { x: at, y: bottom + 19, "text-anchor": "middle" }).textContent = name(tick)
    }
    element(frame, "text", { x: (left + end) / 2, y: bottom + 42, "text-anchor": "middle", class: "label" }).textContent = x.axis.label
    for (const [scale, at, way] of [[this.y, left, -1], [this.right, end, 1]]) {
      if (!scale) continue
      const paint = way > 0 ? "second" : ""
      element(frame, "path", { class: "axis", d: `M${at} ${scale.from}V${top}` })
      for (const tick of scale.ticks) {
        const y = scale.px(tick)
        element(frame, "path", { class: "axis", d: `M${at} ${y}h${5 * way}` })
        element(frame, "text", { x: at + 9 * way, y: y + 4, "text-anchor": way > 0 ? "start" : "end", class: paint }).textContent = name(tick)
      }
      element(frame, "text", { transform: `translate(${way > 0 ? wide - 8 : 16} ${(top + bottom) / 2}) rotate(-90)`, "text-anchor": "middle", class: "label" }).textContent = scale.axis.label
    }
  }

  /**
   * state: {now: [x, y], words, marker: {value, words}, answer: {value, words}, seen, exact, dots}: seen and exact are
   * lists of points, and so is dots; null hides a part. filled: they are areas; endless: exact has no end; walk, curve: seen is a thin or a thick line.
   * second: points of a second quantity. names: [{at: [x, y], scale, words}] of curves. lines: [{value, words}], named values, the first one a bound on the others.
   */
  draw(state) {
    this.state = state
    if (!this.x) return
    const { now = null, words = "", marker = null, answer = null, seen = [], exact = [], endless = false, dots = [], second = [], filled = false, walk = false, curve = false, lines = [], names = [] } = state
    const path = (points, end = "") => (points.length ? `M${points.map((point) => this.place(point).map((v) => v.toFixed(1)).join()).join("L")}${end}` : "")
    for (const [part, points] of [[this.exact, exact], [this.seen, seen]]) {
      const area = filled && !((walk || curve) && points === seen)
      part.setAttribute("d", path(points, area && points.length > 2 ? "Z" : ""))
      part.classList.toggle("filled", area)
      part.classList.toggle("thin", walk && points === seen)
      part.classList.toggle("curve", curve && points === seen)
    }
    this.further.replaceChildren()
    for (const [x, y, up] of this.beyond(exact)) {
      element(this.further, "path", { d: up ? `M${x} ${y - 13}l-9 14h18z` : `M${x + 13} ${y}l-14 -9v18z` })
      if (endless) element(this.further, "text", { x: x + (up ? 22 : -4), y: y + (up ? 0 : 26), "text-anchor": "middle" }).textContent = "∞"
    }
    this.second.setAttribute("d", second.length ? `M${second.map(([x, y]) => `${this.x.px(x)} ${this.right.px(y)}`).join("L")}h0` : "")
    this.names.replaceChildren()
    for (const { at: [x, y], words, scale } of names) element(this.names, "text", { x: this.x.px(x) + 2 * GAP, y: this[scale].px(y) - GAP }).textContent = words
    this.drawLines(lines)
    this.dots.setAttribute("d", dots.map((point) => `M${this.place(point).map((v) => v.toFixed(1)).join()}h0`).join(""))
    this.show(this.marker, marker && { ...marker, words: answer ? "" : marker.words })
    this.show(this.answer, answer)
    this.dot.style.display = now ? "" : "none"
    if (now) {
      const [px, py] = this.place(now)
      this.dot.setAttribute("transform", `translate(${px} ${py})`)
      this.reading.setAttribute("x", this.beside(px, (words.length * PILL.letter) / 2, [marker, answer, ...lines]))
      this.reading.textContent = [answer, ...lines].some((flag) => flag && Math.abs(this.x.px(flag.value) - px) < GAP) ? "" : words
      this.dot.setAttribute("aria-valuetext", words)
      this.dot.setAttribute("aria-valuenow", now[0])
    }
    if (marker) {
      this.marker.group.setAttribute("aria-valuenow", marker.value)
      this.marker.group.setAttribute("aria-valuetext", marker.words)
    }
  }

  /** Where an area or a bar leaves the axes, on the right and at the top: [x, y, whether at the top]. */
  beyond(points) {
    return [this.x, this.y].flatMap((scale, d) => {
      const other = d ? this.x : this.y, high = scale?.axis.high
      const met = points.flatMap((b, k) => {
        const a = points.at(k - 1), part = (high - a[d]) / (b[d] - a[d]), at = a[1 - d] + part * (b[1 - d] - a[1 - d])
        return part >= 0 && part <= 1 ? [other ? Math.min(other.axis.high, Math.max(other.axis.low, at)) : at] : []
      })
      if (!met.length || !points.some((point) => point[d] > 1.001 * high)) return []
      const middle = (Math.min(...met) + 7 * Math.max(...met)) / 8
      return [[...this.place(d ? [middle, high] : [high, middle]), d === 1]]
    })
  }

  /** Where to write words of this half width above px, relative to it: on the plot, next to the vertical lines. */
  beside(px, half, flags) {
    const lines = flags.filter(Boolean).map(({ value }) => this.x.px(value)), [low, high] = [(this.y ? this.left : 0) + half + GAP, this.end - half - GAP]
    const free = (x) => x >= low && x <= high && lines.every((line) => Math.abs(line - x) > half + GAP)
    const above = Math.min(high, Math.max(low, px)), far = (x) => Math.abs(x - px)
    const places = [above, ...lines.flatMap((line) => [line - half - 2 * GAP, line + half + 2 * GAP])].sort((a, b) => far(a) - far(b))
    return (places.find((x) => free(x) && far(x) < 2 * half) ?? above) - px
  }

  /** Named values: lines up to their names, which are one below the other on the right. */
  drawLines(lines) {
    const { top, bottom, lines: group } = this, right = Math.max(...lines.map(({ value }) => this.x.px(value)))
    group.replaceChildren()
    lines.forEach(({ value, words }, k) => {
      const y = top + 10 + 16 * k
      element(group, "path", { d: `M${this.x.px(value)} ${bottom}V${y - 4}H${right + 2 * GAP}`, class: k ? "" : "bound" })
      element(group, "text", { x: right + 3 * GAP, y }).textContent = words
    })
  }

  /** A vertical line, with a label on top if it has words. */
  show({ group, line, box, text }, what) {
    group.style.display = what ? "" : "none"
    if (!what) return
    const px = this.x.px(what.value), y = this.top - 38, wide = what.words ? what.words.length * PILL.letter + PILL.padding : 0
    const middle = Math.min(Math.max(px, (this.y ? this.left : 0) + wide / 2 + 2), this.wide - wide / 2 - 2)
    for (const [key, value] of Object.entries({ x1: px, x2: px, y1: what.words ? y : this.top - 8, y2: this.bottom })) line.setAttribute(key, value)
    for (const [key, value] of Object.entries({ x: middle - wide / 2, y, width: wide })) box.setAttribute(key, value)
    for (const [key, value] of Object.entries({ x: middle, y: y + 17.5 })) text.setAttribute(key, value)
    text.textContent = what.words
  }

  /** The handle that can be dragged: none before the plot is laid out. */
  get movable() { return this.x ? this.allowed : null }

  /** Allow a handle to be dragged: "marker", "dot" or none. */
  allow(handle) {
    if (handle !== this.allowed) this.svg.classList.add("fresh") // until it is moved
    this.allowed = handle
    for (const [one, group] of [["marker", this.marker.group], ["dot", this.dot]]) {
      group.setAttribute("tabindex", one === handle ? 0 : -1)
      group.classList.toggle("movable", one === handle)
    }
    this.svg.style.touchAction = !handle ? "auto" : this.axes.y && !this.axes.y.follows && handle === "dot" ? "none" : "pan-y"
  }

  // Dragging

  listen() {
    const { svg } = this
    let held = null
    const at = (event) => {
      const box = svg.getBoundingClientRect()
      return [event.clientX - box.left, event.clientY - box.top]
    }
    svg.addEventListener("pointerdown", (event) => {
      if (!this.movable || event.button !== 0) return
      const [px, py] = at(event), [nx, ny] = this.state.now ? this.place(this.state.now) : [px, py]
      const near = this.movable === "dot" && Math.hypot(px - nx, py - ny) < GRAB
      const flag = this.movable === "marker" && this.marker.group.contains(event.target)
      held = near ? [nx - px, ny - py] : flag ? [this.x.px(this.state.marker.value) - px, 0] : [0, 0]
      svg.setPointerCapture(event.pointerId)
      ;(this.movable === "dot" ? this.dot : this.marker.group).focus({ preventScroll: true })
      this.move(px + held[0], py + held[1])
      event.preventDefault()
    })
    svg.addEventListener("pointermove", (event) => {
      if (!held) return
      const [px, py] = at(event)
      this.move(px + held[0], py + held[1])
    })
    for (const end of ["pointerup", "pointercancel", "keyup"]) svg.addEventListener(end, () => {
      held = null
      this.hears.release?.()
    })
    svg.addEventListener("keydown", (event) => this.key(event))
  }

  move(px, py) {
    this.svg.classList.remove("fresh")
    if (this.movable === "marker") this.hears.marker(this.x.value(px))
    if (this.movable === "dot") this.hears.dot(this.x.value(px), this.y ? this.y.value(py) : 0)
  }

  key(event) {
    const [right, up] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] ?? []
    if (right === undefined || !this.movable) return
    event.preventDefault()
    event.stopPropagation()
    this.svg.classList.remove("fresh")
    if (this.movable === "marker") return this.hears.marker(this.x.step(this.state.marker.value, right || up, event.shiftKey))
    const [x, y] = this.state.now
    if (!this.y) return this.hears.dot(this.x.step(x, right || up, event.shiftKey), 0)
    this.hears.dot(right ? this.x.step(x, right, event.shiftKey) : x, up ? this.y.step(y, up, event.shiftKey) : y)
  }
}

/** A value of the quantity on an axis, in words. */
export const told = ({ log, digits = 2 }, value) => (log ? String(Number(value.toPrecision(2))) : value.toFixed(digits))

/** Whether a prediction is right, in the numbers shown: between two values of the answer, or near them. */
export function isRight(x, prediction, [low, high]) {
  const off = Math.max(told(x, low) - told(x, prediction), told(x, prediction) - told(x, high), 0)
  return x.log ? !off : off < NEAR * (x.high - x.low)
}

/** A number on an axis. */
const name = (value) => String(Number(value.toPrecision(3))).replace("-", "−")
