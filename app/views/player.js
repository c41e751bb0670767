// Replays states in the page. The frames come once; per painted frame the chains are drawn anew and a
// few numeric columns of the plots beside are rewritten in place, without telling the server.
// Between two states the straight line is shown: S is convex, so every point of it is admissible too.

const WIDTH = 0.23 // of a chain that carries the mean normal force, in largest radii
const CARRYING = 1e-6 // in ⟨fₙ⟩; less is not drawn
const STRONG = 2 // in ⟨fₙ⟩: contacts that Fig. 5 of the paper marks
const PLOTS_MS = 66 // the plots beside are repainted no more often than this while playing,
const PLOTS_FRAMES = 3 // nor than every so many frames, where frames take long
const DIM = 0.35 // chains under the marks of Fig. 5
const SWING = 2.2 // s, for the displacement field to go to and fro

const NARROW = 600 // px; there the sidebar lies over the page

const ICONS = {
  restart: "M6 5h2v14H6zM20 5v14L9 12z",
  back: "M18 5v14L8 12z",
  play: "M7 4v16l13-8z",
  pause: "M6 5h4v14H6zM14 5h4v14h-4z",
  step: "M6 5v14l10-7zM17 5h2v14h-2z",
  pin: "M12 2a7 7 0 0 1 7 7c0 5-7 13-7 13S5 14 5 9a7 7 0 0 1 7-7zm0 4a3 3 0 1 0 0 6 3 3 0 0 0 0-6z",
  between: "M4 12l5-5v3h6V7l5 5-5 5v-3H9v3z",
}

/** The plots beside, found in the page by name. */
class Plots {
  constructor(document, onData) {
    this.document = document
    this.onData = onData
    this.heard = new Set()
  }

  /** A source by name; new contents of it are heard from now on. */
  find(name) {
    const source = this.document.get_model_by_name(name)
    if (source && !this.heard.has(source)) {
      this.heard.add(source)
      source.properties.data.change.connect(this.onData)
    }
    return source
  }

  show(walk, seen, frame, mixed, scale) {
    const bars = this.find("bars"), growth = this.find("growth")
    if (bars?.get_column("at")) this.showBars(bars, walk, seen, frame, mixed, scale)
    if (growth?.get_column("state")?.length !== walk.number.length) return
    for (const name of ["eta1", "eta2", "eta3"]) {
      const column = growth.get_column(name), factor = name === "eta3" ? 0.15 : 1
      for (let k = 0; k < column.length; k++) {
        column[k] = k > 0 && k <= frame ? factor * seen[name][k] : NaN
      }
    }
    growth.change.emit()
  }

  showBars(bars, walk, seen, frame, mixed, scale) {
    const column = (name) => bars.get_column(name)
    const at = column("at"), low = column("low"), high = column("high"), now = column("now")
    for (let k = 0; k < now.length; k++) {
      const c = at[k], unit = scale === "own" ? walk.normal[c] : 1
      now[k] = mixed.normal[c] / unit
      low[k] = frame ? seen.low[0][c] / unit : now[k]
      high[k] = frame ? seen.high[0][c] / unit : now[k]
    }
    bars.change.emit()
  }

  /** Points that go along a path: sources with the tags "follows", name of the path, name of tab. */
  follow(tab, position, track) {
    for (const model of this.document._all_models.values()) {
      const [word, name, on] = model.tags ?? []
      if (word !== "follows" || on !== tab) continue
      const path = this.find(name)
      if (!path) continue
      const [a, b, part] = spot(track, position)
      for (const column of Object.keys(model.data)) {
        const along = path.get_column(column)
        if (along) model.get_column(column)[0] = (1 - part) * along[a] + part * along[b]
      }
      model.change.emit()
    }
  }
}

/** Frames before and after a position on the track, and the part of the way. */
function spot(track, position) {
  const k = Math.min(Math.floor(position), track.length - 2)
  return track.length < 2 ? [track[0], track[0], 0] : [track[k], track[k + 1], position - k]
}

function icon(name) {
  return `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${ICONS[name]}"/></svg>`
}

function layout(scene) {
  const root = document.createElement("div")
  const button = (name, title) =>
    `<button type="button" class="${name}" title="${title}" aria-label="${title}">${icon(name)}</button>`
  root.className = "stage"
  root.innerHTML = `
    <div class="source"></div>
    <div class="bar">
      ${button("restart", "restart at the original network (Home)")}
      ${button("back", "one state back (←)")}
      ${button("play", "play (space)")}
      ${button("step", "one state on (→)")}
      <input class="scrub" type="range" min="0" value="0" step="1" aria-label="state">
      ${button("pin", "pin this state, to compare others with it")}
      ${button("between", "to and fro between the pinned state and this one")}
      <label title="speed, states per second"><input class="speed" type="range" min="0" max="6" step="0.25" value="3"
        aria-label="speed"><span class="rate"></span></label>
    </div>
    <div class="read">
      <span>state <b class="state"></b></span>
      <span>η1 <b class="eta1"></b></span>
      <span>η2 <b class="eta2"></b></span>
      <span>η3 <b class="eta3"></b></span>
      <span title="accepted states per attempt">accepted <b class="acceptance"></b></span>
      <span title="distance from the centre of the states, in ⟨fₙ⟩">from centre <b class="distance"></b></span>
      <span title="largest unbalance, in ⟨fₙ⟩">residual <b class="residual"></b></span>
    </div>`
  root.append(scene.root)
  const skips = root.appendChild(document.createElement("div"))
  skips.className = "skips"
  const part = (name) => root.querySelector(`.${name}`)
  return { root, part }
}

/** Takes what the server sent, a Map or a plain object, as a plain object. */
function plain(given) {
  return given instanceof Map ? Object.fromEntries(given) : given
}

function colourBins(name, walk, mixed, pinned, extent, bins, out) {
  const last = bins - 1, { normal, tangential } = mixed
  for (let c = 0; c < out.length; c++) {
    let part = 0.5
    if (name === "mobilised") part = normal[c] > CARRYING ? 0.5 + tangential[c] / (2 * walk.mu * normal[c]) : 0.5
    else if (name === "extent") part = extent.most > 0 ? extent.normal[c] / extent.most : 0
    else if (name === "change") part = 0.5 + (normal[c] - walk.normal[c]) / 2
    else part = 0.5 + 0.5 * Math.sign(normal[c] - walk.normal[pinned + c])
    out[c] = Math.round(last * Math.max(0, Math.min(1, part)))
  }
}

export function render({ model, view }) {
  const scene = new Scene((contact) => { model.contact = contact })
  const { root, part } = layout(scene)
  const plots = new Plots(view.model.document, () => again())
  let loaded = null, walk = null, seen = null, extent = null, mixed = null, style = null
  let track = [0], position = 0, playing = false, direction = 1, before = 0, toldPlots = 0

  const speed = () => 2 ** Number(part("speed").value) // states per second
  const last = () => track.length - 1
  const swinging = () => model.between !== null && model.between !== undefined
  const frame = () => track[Math.floor(position + 1e-9)]

  // What is drawn

  function mix() {
    const [a, b, portion] = spot(track, position), size = walk.contacts
    for (const name of ["normal", "tangential"]) {
      const from = a * size, to = b * size, values = walk[name], out = mixed[name]
      for (let c = 0; c < size; c++) {
        out[c] = portion ? (1 - portion) * values[from + c] + portion * values[to + c] : values[from + c]
      }
    }
  }

  function restyle() {
    const size = walk.contacts, pinned = model.reference * size
    for (let c = 0; c < size; c++) {
      let value = mixed.normal[c]
      if (model.thickness === "extent") value = extent.normal[c]
      else if (model.thickness === "difference") value = Math.abs(value - walk.normal[pinned + c])
      style.width[c] = value > CARRYING ? WIDTH * value : 0
    }
    const known = model.colour !== "mobilised" || walk.mu > 0
    style.colours = known ? model.palettes[model.colour] : [model.palettes.neutral]
    if (known) colourBins(model.colour, walk, mixed, pinned, extent, style.colours.length, style.bin)
    else style.bin.fill(0)
    style.alpha = model.overlay ? DIM : 1
    style.strong = model.overlay ? walk.strong : null
    style.loose = model.overlay ? extent.loose : null
  }

  function paint() {
    mix()
    restyle()
    scene.drawChains(style)
  }

  function paintPlots(now = performance.now()) {
    toldPlots = now
    if (model.tab === "intervals") plots.show(walk, seen, seen.last, mixed, model.scale)
    plots.follow(model.tab, position, track)
  }

  function read() {
    const k = frame(), measured = seen.last
    const form = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : "–")
    const [a, b, portion] = spot(track, position)
    const here = portion > 0.5 ? b : a
    part("state").textContent = swinging()
      ? `${Math.round(100 * portion)} % of the way from ${name(a)} to ${name(b)}`
      : k ? `${walk.number[k]} of ${walk.states}` : "original"
    for (const eta of ["eta1", "eta2", "eta3"]) part(eta).textContent = form(measured ? seen[eta][measured] : NaN, 3)
    const accepted = seen.acceptance[measured]
    part("acceptance").textContent = measured && accepted <= 1 ? `${Math.round(100 * accepted)} %` : "–"
    part("distance").textContent = form(distance(a, b, portion), 2)
    const residual = walk.residual[here]
    part("residual").textContent = Number.isFinite(residual) ? residual.toExponential(0) : "–"
    part("scrub").value = position
    count()
  }

  function count() {
    const { drawn, segments, outside, thin } = scene.counts
    part("skips").textContent = `Drawn: ${drawn} of ${segments} segments ` +
      `(${outside} out of view, ${thin} thinner than ${LEAST} px).`
  }

  const name = (k) => (k ? `state ${walk.number[k]}` : "the original")

  /** From the centre: |(1−t) a + t b|² = (1−t) a² + t b² − t (1−t) |a − b|². */
  function distance(a, b, t) {
    const size = walk.contacts
    let square = (1 - t) * walk.distance[a] ** 2 + t * walk.distance[b] ** 2
    if (t > 0) {
      let apart = 0
      for (const values of [walk.normal, walk.tangential]) {
        for (let c = 0; c < size; c++) apart += (values[a * size + c] - values[b * size + c]) ** 2
      }
      square -= t * (1 - t) * apart
    }
    return Math.sqrt(Math.max(0, square))
  }

  /** Go to a position on the track and paint it; tell: the server, too. */
  function show(to, tell = true) {
    position = Math.max(0, Math.min(last(), to))
    if (!swinging()) seen.until(frame())
    paint()
    paintPlots()
    read()
    if (tell) model.frame = frame()
  }

  // Playing

  function play(on) {
    playing = on && walk !== null
    part("play").innerHTML = icon(playing ? "pause" : "play")
    part("play").title = `${playing ? "pause" : "play"} (space)`
    part("play").setAttribute("aria-label", playing ? "pause" : "play")
    root.classList.toggle("playing", playing)
    if (!playing) return walk && (model.frame = frame())
    if (position >= last() && !swinging()) show(0, false)
    direction = 1
    before = performance.now()
    requestAnimationFrame(tick)
  }

  function tick(now) {
    if (!playing || !root.isConnected) return
    const took = Math.max(0, now - before)
    position += (direction * took * speed()) / (swinging() ? 8000 : 1000)
    before = now
    if (swinging() && (position >= last() || position <= 0)) direction = position <= 0 ? 1 : -1
    position = Math.max(0, Math.min(last(), position))
    if (!swinging()) seen.until(frame())
    paint()
    if (now - toldPlots > Math.max(PLOTS_MS, PLOTS_FRAMES * took)) {
      paintPlots(now)
      read()
    }
    if (!swinging() && position >= last()) {
      play(false)
      show(last())
    } else requestAnimationFrame(tick)
  }

  // What the server tells

  function load() {
    const given = model.walk
    if (given === loaded || !plain(given).contacts) return
    loaded = given
    const wasPlaying = playing
    playing = false
    walk = plain(given)
    const size = walk.contacts
    seen = new Seen(walk)
    mixed = scene.mixed = { normal: new Float32Array(size), tangential: new Float32Array(size) }
    style = { width: new Float32Array(size), bin: new Int16Array(size) }
    walk.strong = walk.normal.subarray(0, size).map((value) => value > STRONG)
    scene.palette = plain(model.palettes).scene
    scene.selected = model.contact ?? null
    loadExact()
    retrack()
    scene.show(walk)
    scene.resize()
    scene.repaint()
    show(swinging() ? 0 : model.frame, false)
    if (wasPlaying) requestAnimationFrame(() => play(true))
  }

  /** Lengths of the intervals of f_n: exact ones where known, else those of all states. */
  function loadExact() {
    const exact = plain(model.exact ?? {}), size = walk.contacts
    const { low, high } = exact.low?.length === size ? exact : walk
    const normal = new Float32Array(size)
    for (let c = 0; c < size; c++) normal[c] = high[c] - low[c]
    const mean = normal.reduce((sum, value) => sum + value, 0) / size
    const most = Float32Array.from(normal).sort()[Math.floor(0.98 * (size - 1))]
    extent = { normal, most, low, high, loose: normal.map((value) => value > mean), exact: low === exact.low }
  }

  function retrack() {
    track = swinging() ? [...model.between] : Array.from(walk.number.keys())
    position = 0
    const scrub = part("scrub")
    scrub.max = last()
    scrub.step = swinging() ? 0.01 : 1
    part("between").classList.toggle("on", swinging())
    part("between").disabled = !swinging() && walk.number.length < 2
  }

  const tooltip = {
    contact(k) {
      const c = walk.contact[k], n = mixed.normal[c], t = mixed.tangential[c]
      const mobilised = walk.mu > 0 && n > CARRYING ? (t / (walk.mu * n)).toFixed(2) : "–"
      const told = (low, high) => `${low.toFixed(3)} … ${high.toFixed(3)}`
      const rows = [
        ["contact", `${walk.backbone[c]} (grains ${walk.i[k]} – ${walk.j[k]})`],
        ["fₙ / ⟨fₙ⟩", n.toFixed(3)],
        ["fₜ / ⟨fₙ⟩", t.toFixed(3)],
        ["fₜ/(μ fₙ)", mobilised],
        ["original fₙ", walk.normal[c].toFixed(3)],
      ]
      if (seen.last) rows.push(["fₙ seen", told(seen.low[0][c], seen.high[0][c])])
      if (extent.exact) rows.push(["fₙ exact", told(extent.low[c], extent.high[c])])
      return rows
    },
    grain(k) {
      return [
        ["grain", `${walk.grain[k]}${walk.kind[k] % 2 ? " (rattler)" : ""}`],
        ["radius", walk.r[k].toFixed(3)],
        ["contacts", walk.touching[k]],
      ]
    },
  }
  scene.describe = tooltip
  scene.onRepaint = count

  // Widgets and keys

  function tellRate() {
    const rate = speed()
    part("rate").textContent = `${rate < 10 ? rate.toFixed(1) : rate.toFixed(0)} /s`
  }

  const halt = (action) => () => { if (walk) { play(false); action() } }
  const actions = {
    play: () => walk && play(!playing),
    step: halt(() => show(Math.floor(position + 1e-9) + (swinging() ? 0.05 : 1))),
    back: halt(() => show(Math.ceil(position - 1e-9) - (swinging() ? 0.05 : 1))),
    restart: halt(() => show(0)),
    pin: () => walk && (model.reference = frame()),
    between: () => {
      if (!walk) return
      if (swinging()) return (model.between = null)
      const here = frame() || last()
      model.between = [model.reference === here ? 0 : model.reference, here]
      play(true)
    },
  }
  for (const [button, action] of Object.entries(actions)) part(button).addEventListener("click", action)
  part("scrub").addEventListener("input", (event) => {
    play(false)
    if (walk) show(Number(event.target.value))
  })
  part("speed").addEventListener("input", tellRate)
  tellRate()

  function key(event) {
    if (!root.isConnected) return window.removeEventListener("keydown", key)
    const at = event.composedPath()[0]
    const typing = at.isContentEditable || /^(TEXTAREA|SELECT)$/.test(at.tagName) ||
      (at.tagName === "INPUT" && at.type !== "range" && at.type !== "checkbox")
    if (typing || event.ctrlKey || event.metaKey || event.altKey) return
    const pressing = at.tagName === "BUTTON" || at.role === "combobox" || at.role === "tab"
    const keys = { ArrowRight: "step", ArrowLeft: "back", Home: "restart" }
    if (event.key === " " && !pressing) actions.play()
    else if (keys[event.key] && at.type !== "range" && at.role !== "tab") actions[keys[event.key]]()
    else if (/^[1-9]$/.test(event.key)) model.send_msg({ tab: Number(event.key) })
    else return
    event.preventDefault()
  }
  window.addEventListener("keydown", key)

  // A displacement field goes to and fro; the largest displacement is half a largest radius.
  function swing(now) {
    if (!scene.offset || !root.isConnected) return
    scene.offset.amplitude = scene.offset.most * Math.sin((2 * Math.PI * now) / (1000 * SWING))
    scene.repaint()
    requestAnimationFrame(swing)
  }
  function displace() {
    const field = model.displacement, was = scene.offset
    let most = 0
    for (let g = 0; g < (field?.length ?? 0); g += 2) most = Math.max(most, Math.hypot(field[g], field[g + 1]))
    scene.offset = most > 0 ? { field, most: 0.5 / most, amplitude: 0 } : null
    if (scene.offset && !was) requestAnimationFrame(swing)
    if (!scene.offset && walk) scene.changed()
  }

  const again = () => { if (walk && !playing) show(position, false) }
  const nameSource = () => { part("source").textContent = model.source }
  const showBusy = () => root.classList.toggle("busy", model.busy)
  model.on("source", nameSource)
  model.on("busy", showBusy)
  model.on("walk", load)
  model.on("exact", () => { if (walk) { loadExact(); again() } })
  model.on("between", () => { if (walk) { const k = frame(); retrack(); show(swinging() ? 0 : k) } })
  model.on("frame", () => { if (walk && !playing && !swinging() && model.frame !== frame()) show(model.frame, false) })
  model.on("palettes", () => { scene.palette = plain(model.palettes).scene; scene.changed(); again() })
  model.on("contact", () => { scene.selected = model.contact ?? null; if (style) scene.drawMarks(style) })
  model.on("displacement", displace)
  for (const name of ["colour", "thickness", "overlay", "reference", "scale", "tab"]) model.on(name, again)
  const observer = new ResizeObserver(() => scene.resize())
  observer.observe(scene.root)
  model.on("remove", () => { observer.disconnect(); window.removeEventListener("keydown", key) })
  nameSource()
  showBusy()
  load()
  displace()
  if (window.innerWidth < NARROW) {
    const models = [...view.model.document._all_models.values()]
    const page = models.find(({ data }) => data?.sidebar_open !== undefined)
    setTimeout(() => { if (page) page.data.sidebar_open = false }, 200) // when it listens
  }
  return root
}
