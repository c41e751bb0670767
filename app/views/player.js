// Replays a random walk in the page. The frames come once; per frame a few numeric columns of the
// plots are rewritten in place. `source.change.emit()` paints them without telling the server.

const WIDTH = 0.23 // of a chain that carries the mean normal force, in largest radii
const LEAST = 0.35 // px, of the thinnest chain that is drawn
const CARRYING = 1e-6 // in ⟨fₙ⟩; less is not drawn
const NEUTRAL = 2 // beyond the scale of mobilisation: the neutral colour, for μ = 0

const ICONS = {
  restart: "M6 5h2v14H6zM20 5v14L9 12z",
  back: "M18 5v14L8 12z",
  play: "M7 4v16l13-8z",
  pause: "M6 5h4v14H6zM14 5h4v14h-4z",
  step: "M6 5v14l10-7zM17 5h2v14h-2z",
}

/** What the walk has shown up to a frame: the range of every component, and η3. */
class Seen {
  constructor(walk) {
    this.walk = walk
    this.eta3 = new Float32Array(walk.number.length)
    this.restart()
  }

  restart() {
    const size = this.walk.contacts
    const filled = (value) => new Float32Array(size).fill(value)
    this.last = 0 // the original network (frame 0) is no state of the walk
    this.low = [filled(Infinity), filled(Infinity)]
    this.high = [filled(-Infinity), filled(-Infinity)]
    this.eta3[0] = 0
  }

  /** Going on costs one frame; going back begins anew. */
  until(frame) {
    if (frame < this.last) this.restart()
    while (this.last < frame) this.add(++this.last)
  }

  add(frame) {
    const { contacts, normal, tangential } = this.walk
    let extent = 0, middle = 0
    for (const [k, values] of [normal, tangential].entries()) {
      const low = this.low[k], high = this.high[k], begin = frame * contacts
      for (let c = 0; c < contacts; c++) {
        const value = values[begin + c]
        if (value < low[c]) low[c] = value
        if (value > high[c]) high[c] = value
        extent += high[c] - low[c]
        middle += (high[c] + low[c]) / 2
      }
    }
    this.eta3[frame] = extent / middle
  }
}

/** Writes one frame into the columns of the plots. */
class Stage {
  constructor(document) {
    this.figure = document.get_model_by_name("packing")
    this.links = document.get_model_by_name("links")
    this.bars = document.get_model_by_name("bars")
    this.growth = document.get_model_by_name("growth")
  }

  /** Whether the plots hold the geometry of this walk already. */
  fits(walk) {
    const rank = this.bars.get_column("rank"), state = this.growth.get_column("state")
    return rank?.length === walk.contacts && state?.length === walk.number.length
  }

  show(walk, seen, frame) {
    this.showChains(walk, seen, frame)
    this.showBars(walk, seen, frame)
    const eta3 = this.growth.get_column("eta3")
    for (let k = 0; k < eta3.length; k++) eta3[k] = k <= frame ? seen.eta3[k] : NaN
    this.growth.change.emit()
  }

  /** px per largest radius: chains keep their width on the grains when zoomed. */
  scale() {
    const { start, end } = this.figure.x_range
    return this.figure.inner_width / (end - start)
  }

  showChains(walk, seen, frame) {
    const column = (name) => this.links.get_column(name)
    const contact = column("contact"), width = column("width"), colour = column("colour")
    const f_n = column("f_n"), f_t = column("f_t"), mobilised = column("mobilised")
    const low = column("low"), high = column("high")
    const begin = frame * walk.contacts, unit = WIDTH * this.scale()
    for (let k = 0; k < contact.length; k++) {
      const c = contact[k], n = walk.normal[begin + c], t = walk.tangential[begin + c]
      const carries = n > CARRYING
      const part = carries && walk.mu > 0 ? Math.max(-1, Math.min(1, t / (walk.mu * n))) : 0
      f_n[k] = n
      f_t[k] = t
      mobilised[k] = part
      colour[k] = walk.mu > 0 ? part : NEUTRAL
      width[k] = carries ? Math.max(LEAST, unit * n) : 0
      low[k] = frame ? seen.low[0][c] : n
      high[k] = frame ? seen.high[0][c] : n
    }
    this.links.change.emit()
  }

  showBars(walk, seen, frame) {
    const low = this.bars.get_column("low"), high = this.bars.get_column("high")
    const now = this.bars.get_column("now"), begin = frame * walk.contacts
    for (let k = 0; k < now.length; k++) {
      const c = walk.order[k]
      now[k] = walk.normal[begin + c]
      low[k] = frame ? seen.low[0][c] : now[k]
      high[k] = frame ? seen.high[0][c] : now[k]
    }
    this.bars.change.emit()
  }
}

function icon(name) {
  return `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${ICONS[name]}"/></svg>`
}

function controls() {
  const root = document.createElement("div")
  const button = (name, title) =>
    `<button class="${name}" title="${title}" aria-label="${title}">${icon(name)}</button>`
  root.innerHTML = `
    <div class="bar">
      ${button("restart", "restart at the original network")}
      ${button("back", "one state back")}
      ${button("play", "play")}
      ${button("step", "one state on")}
      <input class="scrub" type="range" min="0" value="0" step="1" aria-label="state">
      <label><input class="speed" type="range" min="0" max="6" step="0.25" value="3"
        aria-label="speed"><span class="rate"></span></label>
    </div>
    <div class="read">
      <span>state <b class="state"></b></span>
      <span>η3 seen <b class="eta3"></b></span>
      <span>from the centre <b class="distance"></b> ⟨fₙ⟩</span>
      <span>residual <b class="residual"></b></span>
    </div>`
  const part = (name) => root.querySelector(`.${name}`)
  return { root, part }
}

/** Takes what the server sent, a Map or a plain object, as a plain object. */
function plain(walk) {
  return walk instanceof Map ? Object.fromEntries(walk) : walk
}

export function render({ model, view }) {
  const { root, part } = controls()
  const stage = new Stage(view.model.document)
  let loaded = null, walk = null, seen = null, frame = 0, playing = false, due = 0, before = 0

  const speed = () => 2 ** Number(part("speed").value) // states per second
  const last = () => walk.number.length - 1

  function show(to) {
    frame = Math.max(0, Math.min(last(), to))
    seen.until(frame)
    stage.show(walk, seen, frame)
    part("scrub").value = frame
    const residual = walk.residual[frame]
    part("state").textContent = frame ? `${walk.number[frame]} of ${walk.states}` : "original"
    part("eta3").textContent = seen.eta3[frame].toFixed(3)
    part("distance").textContent = walk.distance[frame].toFixed(2)
    part("residual").textContent = Number.isFinite(residual) ? residual.toExponential(0) : "–"
  }

  function play(on) {
    playing = on && walk !== null
    part("play").innerHTML = icon(playing ? "pause" : "play")
    part("play").title = playing ? "pause" : "play"
    part("play").setAttribute("aria-label", part("play").title)
    if (!playing) return
    if (frame === last()) show(0)
    due = 0
    before = performance.now()
    requestAnimationFrame(tick)
  }

  function tick(now) {
    if (!playing || !root.isConnected) return
    due += (Math.max(0, now - before) / 1000) * speed()
    before = now
    const steps = Math.floor(due)
    due -= steps
    if (steps > 0) show(frame + steps)
    if (frame === last()) play(false)
    else requestAnimationFrame(tick)
  }

  // Plots and frames come in separate messages, and the frames of one walk on the contacts of
  // another would be nonsense: begin when both are there.
  function load() {
    const given = model.walk, asked = plain(given)
    if (given === loaded || !asked.contacts || !stage.fits(asked)) return
    loaded = given
    const wasPlaying = playing
    playing = false
    walk = asked
    seen = new Seen(walk)
    part("scrub").max = last()
    show(0)
    if (wasPlaying) requestAnimationFrame(() => play(true))
  }

  function tellRate() {
    const rate = speed()
    part("rate").textContent = `${rate < 10 ? rate.toFixed(1) : rate.toFixed(0)} states/s`
  }

  const onClick = (name, action) => part(name).addEventListener("click", () => walk && action())
  onClick("play", () => play(!playing))
  onClick("step", () => { play(false); show(frame + 1) })
  onClick("back", () => { play(false); show(frame - 1) })
  onClick("restart", () => { play(false); show(0) })
  part("scrub").addEventListener("input", (event) => {
    play(false)
    if (walk) show(Number(event.target.value))
  })
  part("speed").addEventListener("input", tellRate)
  tellRate()

  // Chains keep their width relative to the grains when the plot is zoomed or resized.
  const rescale = () => walk && !playing && stage.fits(walk) && show(frame)
  stage.figure.x_range.change.connect(rescale)
  stage.figure.properties.inner_width.change.connect(rescale)

  model.on("walk", load)
  for (const source of [stage.bars, stage.growth]) source.properties.data.change.connect(load)
  load()
  return root
}
