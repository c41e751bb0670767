// Replays states in the page. The frames arrive once; each painted frame redraws the chains, and
// the plots next to them follow, without telling the server.

import { actions } from "./hand/actions.js"
import { ask, knownThere, plain } from "../browser/send.js"
import { Buttons } from "./buttons.js"
import { Grab, UNCHOSEN } from "./hand/drag_force.js"
import { extend, Live, roomy } from "./replay/live.js"
import { Look } from "./drawing/chain_style.js"
import { STILL } from "../browser/motion.js"
import { Pins } from "./drawing/pins.js"
import { drawMotion } from "./drawing/first_motion.js"
import { drawThrust } from "./drawing/thrust.js"
import { Plots } from "./drawing/bokeh_plots.js"
import { Playback } from "./replay/playback.js"
import { Pushed } from "./hand/push_animation.js"
import { Replay } from "./replay/replay.js"
import { Scene } from "./drawing/scene.js"
import { Sway } from "./drawing/displacement.js"

const PLOTS_MS = 30 // shortest time between two repaints of the plots while a force is pulled
const OLD = 0.9 // opacity of outdated results, which are also grey but still legible
const NO_ERROR = "Enter an error bar of 0 or more, in mean forces; 0 holds the force exactly."
const REST_MS = 400 // after which a moved view is stored in the link
const WIDE = 1800 // px; from there on force space has its own column, see explore_page.py

class Player {
  constructor(model, page, tell) {
    this.model = model
    this.tell = tell
    this.scene = new Scene((contact) => { model.contact = contact })
    this.actions = actions(this)
    this.buttons = new Buttons(this.scene, this.actions, {
      look: (name, value) => { model[name] = value },
      open: (name, on) => {
        const others = model.opened.filter((other) => other !== name)
        if (model.opened.includes(name) !== on) model.opened = on ? [...others, name] : others
      },
    })
    this.plots = new Plots(page, () => this.again(), {
      dots: {
        take: (k, _, value) => this.hand.takeInBars(this.plots.find("bars").get_column("at")[k], value),
        move: (_, value) => this.hand.moveInBars(value),
        leave: () => this.hand.leave(),
      },
      point: {
        take: (_, x, y) => this.hand.spot.take(x, y),
        move: (x, y) => this.hand.spot.move(x, y),
        leave: () => this.hand.spot.leave(),
      },
    })
    this.replay = this.look = this.loaded = null
    this.playback = new Playback(this)
    this.live = new Live(this, tell)
    this.hand = this.scene.hand = new Grab(this, tell)
    this.pins = new Pins(this)
    this.listeners = new Set() // functions called when other numbers are on screen
    this.thrust = plain(model.thrust)
    this.scene.onMarks = (context, scene) => {
      this.drawThrust(context)
      this.drawMotion(context)
      this.pins.draw(context, scene)
      this.hand.draw(context, scene)
    }
    this.scene.onSheet = (sheet, scene) => {
      this.drawThrust(sheet)
      this.drawMotion(sheet)
      this.pins.onSheet(sheet, scene)
    }
    this.sway = new Sway(this.scene)
    this.pushed = new Pushed(this)
    this.scene.onRepaint = () => { this.buttons.count(); this.tellView() }
    this.scene.describe = {
      contact: (c) => this.look.contact(c, this.replay),
      grain: (g) => this.look.grain(g, this.replay),
      forces: (grain) => this.look.forcesOn(grain, this.replay.mixed),
    }
  }

  drawThrust(context) {
    const { replay, scene, pushed } = this // networks under a push are outside S
    if (replay && !scene.frozen && !pushed.load) drawThrust(context, scene, this.thrust, replay.mixed)
  }

  drawMotion(context) {
    const { pushed: { motion }, scene } = this
    if (motion && !scene.frozen) drawMotion(context, scene, motion)
  }

  /** Whether the tab for pushing a contact is open: playing would distract. */
  get pushes() { return this.model.tab === "perturb" }

  /** Whether a contact is to be pushed, and any other force can change. */
  get pushable() { return this.pushes && this.model.pushing === "one" && this.replay?.walk.free > 0 }

  /** Apply the open tab's settings to the packing. */
  tellTab() {
    this.buttons.root.classList.toggle("pushes", this.pushes)
    if (this.pushes && this.playing) this.play(false)
    if (this.pushable) this.pushed.begin()
    else this.pushed.leave()
  }

  /** Whether force space is in view, where the point is what can be dragged first. */
  get points() { return this.model.tab === "plane" }

  // The view

  /** Take the frames sent by the server. */
  load() {
    const { model, scene, playing } = this, walk = plain(model.walk)
    if (model.walk === this.loaded || !walk.contacts) return
    const shown = this.loaded !== null, zoom = shown ? null : model.zoom // from the link that opened the page
    this.loaded = model.walk
    const view = this.live.leave(), place = this.grownInto(walk)
    // The visitor's own choice while a walk grew outlasts it; what played by itself ends with it.
    const chosen = place !== null && !this.playback.newest, number = playing ? this.replay.walk.number[this.replay.frame] : null
    this.playback.running = false // silently: another replay replaces this one
    this.replay = new Replay(walk.room ? roomy(walk) : walk)
    this.look = new Look(model, this.replay.walk)
    this.hand.pulled = null
    this.hand.settle()
    this.tellHeld("")
    this.pushed.end()
    scene.mixed = this.replay.mixed
    this.dress()
    this.select()
    this.tellTrack()
    this.buttons.say("")
    this.showRequested()
    scene.show(this.replay.walk)
    if (zoom) scene.view = { x: zoom[0], y: zoom[1], half: zoom[2] }
    scene.resize()
    scene.repaint()
    this.live.glide(view)
    const rests = chosen ? !playing : walk.rests
    if (!shown) this.show(model.frame, false)
    else if (rests && !chosen) this.show(walk.begin, false)
    else this.show(place ?? (number === null || number > walk.states ? walk.begin : this.replay.positionOf(number)), false)
    this.playback.newest = walk.room > 0 || (this.playback.newest && place !== null && !rests)
    // After the server's `frame`, which arrives with the walk: one network for screen and address.
    const { replay } = this
    requestAnimationFrame(() => {
      if (this.replay !== replay) return
      if (chosen) this.show(place)
      if (!shown && !walk.room) this.playFirst()
      else this.play(!rests && !this.pushes)
      this.tellTab()
    })
  }

  /** Apply the colours of the theme. */
  dress() {
    const palettes = plain(this.model.palettes)
    this.scene.palette = plain(palettes.scene)
    this.plots.colours = plain(palettes.plots)
  }

  /** The position in a finished walk that corresponds to the walk in progress; null for another walk. */
  grownInto(walk) {
    const { replay } = this
    if (walk.room || !replay?.walk.numbers || replay.walk.contacts !== walk.contacts) return null
    if (replay.walk.normal.subarray(0, walk.contacts).some((value, c) => value !== walk.normal[c])) return null
    const number = replay.walk.number[replay.frame]
    return Math.max(0, walk.number.findLastIndex((other) => other <= number))
  }

  /** Add states to the walk in progress. */
  grow(states) {
    const { replay } = this
    if (!replay?.walk.numbers) return
    extend(replay.walk, states)
    this.tellTrack()
    this.look.measure()
    if (!this.playing) this.paintPlots()
  }

  tellTrack() { this.buttons.bar.showTrack(this.replay, this.grows ? 0 : this.model.keepable) }

  get speed() { return this.buttons.bar.speed }

  /** Whether the packing is on the page. */
  get shown() { return this.scene.root.isConnected }

  /** Whether more states are expected. */
  get grows() { return this.replay?.walk.room > 0 }

  showRequested() {
    const { model, live } = this, { style } = document.documentElement
    this.buttons.root.classList.toggle("moving", live.moves)
    this.buttons.showRequested(live.moves || this.grows ? "" : model.requested)
    // Neighbouring plots are dimmed or hidden by these: a style set from Python would make Bokeh
    // lay out the whole page again.
    const pale = { "--still": model.requested, "--growing": model.requested && !this.grows }
    for (const [name, old] of Object.entries(pale)) {
      style.setProperty(name, old ? OLD : 1)
      style.setProperty(`${name}-colours`, old ? "grayscale(1)" : "none")
      style.setProperty(`${name}-plots`, old ? (model.live ? 0 : OLD) : 1)
    }
    const waits = { intervals: pale["--growing"], plane: pale["--growing"], perturb: model.requested }
    style.setProperty("--waiting", model.live && waits[model.tab] ? '"Being computed …"' : "none")
  }

  select() {
    const contact = this.model.contact ?? null
    this.buttons.tellChosen(this.scene.hand && contact !== null, this.pins.has(contact))
    this.scene.selected = contact
    this.tellForce()
    this.scene.pair = (this.points || this.model.wide) ? this.plots.plane.pair ?? [] : []
  }

  tellForce() {
    const { selected } = this.scene
    if (selected !== null) this.buttons.showForce(this.pins.heldAt(selected) ?? this.replay.mixed.normal[selected])
  }

  /** Mark the selection, or another contact. */
  mark(contact = null) {
    if (!this.replay || this.live.moves) return
    this.select()
    this.scene.selected = contact ?? this.scene.selected
    this.scene.drawMarks()
  }

  paint() { this.scene.drawChains(this.look.of(this.replay.mixed)) }

  paintPlots(now = performance.now()) {
    const { model, plots, replay } = this
    clearTimeout(this.late)
    this.playback.painted = now
    if (model.tab === "intervals") plots.show(replay, model.scale)
    plots.follow(model.wide ? [model.tab, "plane"] : [model.tab], replay)
    this.buttons.read(replay)
    this.tellForce()
    for (const listener of this.listeners) listener()
  }

  /** Redraw the same network with a new look. */
  repaint() { if (!this.live.moves) this.paint() }

  /** Go to a position and paint it; tell: also tell the server. */
  show(to, tell = true) {
    this.replay.go(to)
    this.paint()
    this.paintPlots()
    if (tell) this.model.frame = this.replay.frame
  }

  /** Report the resting view, for links. */
  tellView() {
    const { scene, model } = this, { x, y, half } = scene.view, key = `${x},${y},${half}`
    if (key === this.viewed || scene.frozen) return
    this.viewed = key
    clearTimeout(this.looking)
    this.looking = setTimeout(() => {
      const whole = Object.values(scene.whole), now = [x, y, half]
      const rounded = now.map((value) => Number(value.toPrecision(5)))
      model.zoom = now.every((value, k) => Math.abs(value - whole[k]) < 1e-6) ? null : rounded
    }, REST_MS)
  }

  /** A pulled network has changed. */
  repaintHeld() {
    this.replay.mix()
    this.paint()
    const now = performance.now()
    if (now - this.playback.painted > PLOTS_MS) return this.paintPlots(now)
    this.buttons.read(this.replay)
    this.tellForce()
    clearTimeout(this.late)
    this.late = setTimeout(() => this.paintPlots(), PLOTS_MS) // where the pointer has come to rest
  }

  /** Report what led to the network on screen, for the legend: "pull", "push" or "". */
  tellHeld(cause) {
    this.buttons.tellHeld(cause === "pull")
    if (this.pulled !== cause) this.model.pulled = this.pulled = cause // reading a model is slow
  }

  again() {
    if (this.replay && !this.playing && !this.live.moves) this.show(this.replay.position, false)
  }

  /** The packing as SVG text; its caption names the push. */
  picture(caption) {
    const { pushed, replay, scene } = this, where = []
    if (pushed.held && pushed.load) where.push(`Contact ${replay.walk.backbone[this.pins.pushedContact(scene)]}: ${pushed.words}.`)
    return this.scene.picture({ ...caption, lines: [...where, ...caption.lines] })
  }

  // Playing

  get playing() { return this.playback.running }

  play(on) { this.playback.run(on) }

  /** Playing began or ended. */
  changed(playing) {
    const { replay, model } = this
    if (model.paused === playing) model.paused = !playing
    this.plots.move(playing)
    this.buttons.tellPlaying(playing)
    if (!replay) return
    if (playing) return this.say("")
    if (!this.pushed.held) model.frame = replay.frame // otherwise the server has the network of before
    this.paintPlots()
    this.mark()
  }

  /** Toggle between playing and rest. */
  toggle() {
    const { playback, buttons } = this
    playback.newest = false
    if (!playback.running) return playback.run(true)
    if (playback.resting !== null) { // resume after all
      playback.resting = null
      buttons.tellPlaying(true)
    } else if (playback.pause()) buttons.tellPlaying(false)
  }

  /** Start playing when the page opens, unless its link says otherwise or motion is reduced. */
  playFirst() {
    const { model } = this
    if (STILL.matches || model.paused || this.pulled || this.pushes) model.paused = true
    else requestAnimationFrame(() => this.play(true))
  }

  /** Select the next contact, starting with the largest force on screen. */
  choose({ mixed: { normal } }, sign) {
    const { model } = this, order = Array.from(normal.keys()).sort((a, b) => normal[b] - normal[a] || a - b)
    const at = order.indexOf(model.contact ?? -1), { length } = order
    model.contact = order[at < 0 ? (sign > 0 ? 0 : length - 1) : (at + sign + length) % length]
    const [[, contact], [, n], [, t], ...others] = this.look.contact(model.contact, this.replay)
    const intervals = others.filter(([name]) => name.startsWith("interval")).map(([name, ends]) => `; ${name.split(", ")[1]} ${ends}`)
    this.say(`contact ${contact}: fₙ ${n}, fₜ ${t}${intervals.join("")}`)
  }

  /** One line next to the number of the network; refused: shown until the next action. */
  say(words, refused = false) {
    this.refused = refused
    this.buttons.say(words)
  }

  /** An action succeeded. */
  recover() { if (this.refused) this.say("") }

  /** Declare the selected contact's force known, as it is on screen, or release a known one. */
  hold({ mixed }) {
    const { contact } = this.model, { error } = this.buttons
    if (contact === null || contact === undefined) return this.say(UNCHOSEN, true)
    if (this.grows || !this.scene.hand) return
    const known = this.pins.has(contact)
    if (!known && Number.isNaN(error)) return this.say(NO_ERROR, true)
    if (!known && this.playing) this.play(false) // at a network, which has the held force
    this.tell(known ? { release: contact } : { hold: [contact, this.hand.wanted(contact) ?? mixed.normal[contact], error] })
  }

  // Messages from the server

  /** Handlers for changes of the model's parameters. */
  changes() {
    const { model, scene, buttons } = this
    const loaded = (action) => () => { if (this.replay && !this.live.moves) action(this.replay) }
    const measure = loaded(() => { this.look.measure(); this.again() })
    return {
      legend: () => buttons.tellLegend(model.legend),
      source: () => { buttons.part("source").textContent = model.source; buttons.say("") },
      requested: () => this.showRequested(),
      opened: () => buttons.tellOpen(model.opened),
      paused: loaded(() => { if (model.paused === this.playing && this.playback.resting === null) this.play(!model.paused && !STILL.matches) }),
      live: () => { if (!model.live && this.live.moves) { this.loaded = null; this.load() } else this.showRequested() },
      busy: () => buttons.root.classList.toggle("busy", model.busy),
      walk: () => this.load(),
      keepable: loaded(() => this.tellTrack()),
      motion: () => this.pushed.tellMotion(),
      exact: measure,
      loads: measure,
      measured: measure,
      reduction: measure,
      plane: () => { this.plots.plane = plain(model.plane); this.mark(); this.again() },
      frame: loaded((replay) => {
        if (this.playing || model.frame === replay.frame) return
        this.pushed.leave()
        this.show(model.frame, false)
      }),
      palettes: loaded(() => { this.dress(); scene.changed(); this.again() }),
      thrust: loaded(() => { this.thrust = plain(model.thrust); scene.drawMarks() }),
      pins: loaded(() => { this.recover(); this.mark() }),
      contact: loaded(() => { this.recover(); buttons.typed = false; this.mark() }),
    }
  }
}

export function render({ model, view }) {
  const page = view.model.document, tell = (message) => ask(model, view, message)
  const player = new Player(model, page, tell), changes = player.changes()
  knownThere(page)
  view.model.data.player = player
  view.model.data.scene = player.scene // for code that finds the model by its name
  for (const [name, follow] of Object.entries(changes)) model.on(name, follow)
  const looks = ["most", "most_change", "colour", "thickness", "full", "stretch", "scale", "tab", "views", "wide"]
  model.on(looks, () => player.again())
  model.on("tab", () => player.showRequested())
  const renew = () => { player.again(); player.mark() }
  model.on("wide", renew)
  model.on(["tab", "pushing"], () => {
    if (!player.replay || player.live.moves) return
    player.tellTab()
    renew()
  })
  const observer = new ResizeObserver(() => player.scene.resize())
  observer.observe(player.scene.root)
  model.on("msg:custom", (message) => {
    const news = plain(message)
    if (news.number === undefined) player.hand.receive(news)
    else player.live.receive(news)
  })
  const wide = matchMedia(`(min-width: ${WIDE}px)`), tellWidth = () => tell({ wide: wide.matches })
  wide.addEventListener("change", tellWidth)
  if (wide.matches !== model.wide) tellWidth()
  model.on("remove", () => {
    wide.removeEventListener("change", tellWidth)
    observer.disconnect(); player.buttons.remove(); player.live.remove(); for (const handle of player.plots.handles) handle.remove() })
  for (const name of ["opened", "legend", "source", "busy", "requested", "plane", "walk", "motion"]) changes[name]()
  return player.buttons.root
}
