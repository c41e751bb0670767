// The workbench of small scenes: the disks and their S side by side, friction, and the tools.

import { connectionBanner } from "../../browser/connection_lost.js"
import { saveBytes } from "../../browser/download.js"
import { sceneOptions, sceneQuery } from "../../browser/scene_options.js"
import { ask } from "../../browser/send.js"
import { Bars } from "../drawing/bars.js"
import { palette } from "../drawing/palette.js"
import { Arrows, tall } from "../drawing/scene_canvas.js"
import { Space } from "../drawing/space.js"
import { SceneInHand } from "../model/scene_in_hand.js"
import { barred, counted, forceName, legend, pictured, sentence, special, stopping } from "../model/sentences.js"
import { Address } from "./address.js"
import { Builder } from "./builder.js"
import { layout } from "./layout.js"
import { PushHand } from "./push_hand.js"
import { RandomWalk } from "./random_walk.js"
import { Axes } from "./shadow_axes.js"

const MOST_MU = 1.5 // end of the slider; larger values can be typed
const REST_MS = 150 // time after which the server's results are requested
const FEW = 12 // contacts up to which all intervals are visible at once

class Workbench {
  constructor(model, view) {
    Object.assign(this, { model, view, hand: null, next: null, requested: false, filled: false, chosenMu: false, frame: 0, resting: 0, painted: 0, written: {}, parts: {} })
    const root = this.root = document.createElement("div")
    root.className = "bench"
    root.innerHTML = layout(MOST_MU)
    this.banner = connectionBanner(view, "What is in the page still moves.")
    root.prepend(this.banner)
    this.builder = new Builder(this.part("own"), (built) => this.build(built))
    this.arrows = new Arrows(this.part("packing"), (what, given) => this.respond(what, given))
    this.space = new Space(this.part("space"), (what, given) => this.respond(what, given))
    this.bars = new Bars(this.part("bars"))
    this.axes = new Axes(this.part("plane"), (shadow) => this.cast(shadow))
    this.push = new PushHand()
    this.walk = new RandomWalk(this.part("play"), (path) => { this.hand.path = path; this.changed() })
    this.address = new Address((query) => ask(model, view, { query }), model.large)
    this.controls()
    this.follow()
    this.dress()
    this.show()
  }

  part(name) { return (this.parts[name] ??= this.root.querySelector(`.${name}`)) }

  /** Listen to the model, the window and the keys until the page is closed. */
  follow() {
    const { model, root } = this, key = (event) => this.key(event)
    const sized = new ResizeObserver(() => { this.arrows.wide = 0; this.soon() })
    for (const element of [root, this.part("packing"), this.part("space")]) sized.observe(element)
    window.addEventListener("keydown", key)
    model.on("remove", () => {
      window.removeEventListener("keydown", key)
      this.address.stop()
      sized.disconnect()
      this.walk.pause()
    })
    model.on("scene", () => this.show())
    model.on("dark", () => { this.dress(); this.soon() })
    model.on("msg:custom", (news) => this.arrived(news))
  }

  dress() { this.root.style.colorScheme = this.model.dark ? "dark" : "light" } // for the browser's own controls

  // Display

  soon() { this.frame ||= requestAnimationFrame(() => this.paint()) }

  /** Update text and pictures after a change. */
  changed() {
    this.say()
    this.soon()
  }

  paint() {
    this.frame = 0
    const { hand, root, arrows, space, builder } = this, canvas = this.part("packing")
    if (!hand || !root.isConnected) return
    const { body } = hand, buildable = body.scene.name === "own", colours = palette(this.model.dark)
    const wall = builder.held?.wall === undefined ? [] : builder.walls[builder.held.wall]
    const cursor = this.builds && root.getRootNode().activeElement === canvas ? builder.cursor : null
    const axes = new Map(space.axed.map((force, k) => [force, [colours.across, colours.up][k]]))
    const { disk, contact, side, fall, enough, lit } = hand, carried = builder.bodies[builder.held?.body], handle = buildable && builder.handle
    const look = { ...colours, carried, handle, disk, contact, side, fall, enough, contacts: hand.contacts, wall, cursor, axes, dots: this.filled && space.dots.length }
    if (body.scene !== arrows.body?.scene || arrows.wide !== canvas.clientWidth) {
      arrows.fit(body, buildable && arrows.builtWidth === canvas.clientWidth)
      arrows.builtWidth = buildable ? canvas.clientWidth : 0
      arrows.wide = canvas.clientWidth
    }
    arrows.draw({ ...look, contacts: lit })
    if (space.draw(body, look, hand.path)) this.soon()
    this.painted++
    if (!this.walk.frame || this.painted % 2) this.bars.draw(body, lit, hand.bounds) // numbers during a walk: every second frame
  }

  /** Write text into a part of the page if it differs: unchanged parts are not laid out again. */
  write(name, content, how = "textContent") {
    const one = this.hand?.scene.one ?? "disk", text = content.replaceAll("disks", one === "body" ? "bodies" : `${one}s`).replaceAll("disk", one)
    if (this.written[name] !== text) this.part(name)[how] = this.written[name] = text
  }

  say(note = this.push.note) {
    const { hand } = this, { body } = hand
    this.write("count", counted(body), "innerHTML")
    this.write("legend", legend(body))
    this.write("special", special(body))
    this.write("key", barred(body))
    this.write("what", pictured(body, { filled: this.filled }))
    this.write("says", note || sentence(body, hand.mu, { filled: this.filled, fall: hand.fall, enough: hand.enough }))
    this.write("mend", `Set μ = ${hand.enough}`)
    this.part("mend").hidden = !hand.enough
    this.part("says").classList.toggle("bad", body.empty && !body.scene.idle)
    this.tellUndo()
  }

  // Loading of scenes

  show() {
    const { model: { scene }, space, builder } = this, before = this.hand?.scene, buildable = scene.name === "own"
    this.part("own").hidden = !buildable
    this.root.classList.toggle("waiting", !scene.i)
    if (!scene.i) {
      this.part("name").value = new URLSearchParams(window.location.search).get("scene") ?? this.part("name").value
      return this.write("says", "The disks are being pressed together …")
    }
    this.walk.pause()
    this.pushes(false)
    this.hand = new SceneInHand(scene, () => this.changed())
    const { body } = this.hand
    if (buildable && this.built() && builder.read(scene.built, scene.begins)) this.arrows.builtWidth = 0
    Object.assign(space, { body, dots: [], outline: { points: [], stale: true } })
    space.shadow = this.axes.show(body, (force) => forceName(scene, force))
    if (this.filled) space.fill()
    this.part("name").value = scene.name
    this.part("ranges").open = body.count <= FEW || tall(scene)
    this.root.classList.toggle("explained", Boolean(scene.box[0]) || buildable)
    this.root.classList.toggle("building", buildable)
    this.root.classList.toggle("tall", tall(scene))
    this.address.returning = false
    if (before && !(buildable && before.name === "own")) this.address.write(this.hand)
    this.showMu()
    this.say(before ? "" : this.model.note)
    if (before && before.name !== scene.name) this.part("asked").textContent = ""
    this.rest()
    this.soon()
  }

  /** The two forces onto which S is projected. */
  cast(shadow) {
    Object.assign(this.space, { shadow, outline: { points: [], stale: true }, sceneDrawn: null })
    this.changed()
    this.measure()
  }

  /** A built scene: one is requested at a time; of those built meanwhile, only the last one. */
  build(built) {
    this.next = built
    if (!this.requested) this.askNext()
  }

  askNext() {
    const { model, view, next: built } = this
    Object.assign(this, { requested: true, next: null })
    ask(model, view, { built, mu: this.hand.mu })
  }

  /** The requested scene arrived or failed; returns whether the visitor has not changed it since. */
  built() {
    this.requested = false
    const last = this.next === null
    if (!last) this.askNext()
    return last
  }

  // Friction

  showMu() {
    this.part("range").value = Math.min(this.hand.mu, MOST_MU)
    this.part("typed").value = String(Number(this.hand.mu.toPrecision(4)))
  }

  setMu(mu) {
    this.chosenMu = true
    this.cut(() => this.hand.cut(mu))
    this.showMu()
  }

  /** S has changed: its random points are drawn again, and the server's results are requested once dragging stops. */
  cut(act) {
    const { space } = this
    space.outline.stale = true
    act()
    if (this.filled && this.hand.body.whole) space.fill()
    else space.dots = [] // many dimensions take time: after friction has come to rest
    this.rest()
    this.soon()
  }

  rest() {
    clearTimeout(this.resting)
    this.resting = setTimeout(() => this.rested(), REST_MS)
  }

  rested() {
    const { hand, space } = this, { body } = hand, fails = body.empty && !body.scene.idle
    this.address.write(hand) // first, because a request fails without a server
    if (!body.empty && this.filled && !space.dots.length && body.bounded) { space.fill(); this.soon() }
    if (fails && !hand.enough) { hand.enough = body.enough(MOST_MU); this.changed() }
    if (fails) this.find("fall")
    this.measure()
    if (this.push.size && !body.scene.box[0]) this.find("limit")
  }

  // Results from the server

  /** Request a file, the falling motion, or exact results, for the present scene. */
  find(what) {
    const { model, view, hand: { scene: { name: scene, built }, mu, body, S } } = this
    ask(model, view, { find: what, S, scene, built, mu, load: [...body.load], plane: this.space.shadow })
  }

  /** Above three dimensions, results that need linear programs. */
  measure() {
    const { body } = this.hand
    if (!body.empty && !body.whole) this.find("measured")
  }

  arrived(news) {
    const { hand, space, push } = this
    if (news.error) return this.refused(news.error)
    if (news.file) return saveBytes(news.file, `${hand.scene.name}.npz`)
    if (news.S !== hand.S) return
    if (news.limit !== undefined && push.size) push.tell(hand, (news.limit ?? Infinity) * push.size)
    if (news.fall) {
      hand.fall = news.fall.length ? news.fall : null
      this.changed()
    }
    if (news.measured) {
      const { bounds = null, outline, most = null } = news.measured
      hand.bounds = bounds
      Object.assign(hand.body, { bounded: most === null, most })
      if (most !== null) space.dots = []
      if (news.plane.join() === space.shadow.join()) space.outline = { points: outline, stale: false }
      this.changed()
    }
  }

  refused(error) {
    if (!this.hand) return this.write("says", error)
    this.address.returning = false
    this.built()
    this.part("name").value = this.hand.scene.name
    this.say(error)
  }

  // Dragging

  get builds() { return this.hand?.scene.name === "own" && !this.push.on }

  /** Handle pointer events in a picture. */
  respond(what, given) {
    const { hand } = this
    if (what === "words") return stopping(hand.body, given)
    if (what === "press") return this.press(given)
    if (what === "go" || what === "pull") this.walk.pause()
    if (what === "hover") hand.point(given)
    else if (what === "select") hand.select(given)
    else if (what === "point") hand.readBy(given)
    else if (what === "side") hand.lookAt(given)
    else if (what === "begin") hand.remember()
    else if (what === "go") hand.goTo(given)
    else if (what === "pull") hand.pull(given.contact, given.normal, given.tangential)
    else if (what === "carry") this.carry(given.at)
    else if (what === "release" && this.builds) this.builder.release()
    this.tellUndo()
    this.soon()
  }

  press({ target, at }) {
    if (this.builds) return this.builder.press(at, this.arrows.unit)
    if (!this.push.on || target?.disk === undefined) return false
    this.walk.pause()
    this.push.take(target.disk, at, this.arrows.forceUnit)
    return true
  }

  carry(at) {
    if (this.builds) this.builder.carry(at)
    else this.cut(() => this.push.carry(this.hand, at))
  }

  /** Begin or end test pushes. */
  pushes(on) {
    const { push, hand } = this, pushed = push.disk !== null
    if (on) push.start()
    else push.stop()
    this.part("push").classList.toggle("on", on)
    this.part("push").setAttribute("aria-pressed", on)
    if (pushed && hand) this.cut(() => hand.load(hand.scene.load))
  }

  key(event) {
    const { key } = event, { hand } = this, over = (names) => event.composedPath().some((node) => node.matches?.(names))
    if (event.metaKey || event.ctrlKey || !hand || !this.root.isConnected) return
    if (over("input, select, textarea, dialog") || (key === " " && over("button, summary, a"))) return
    if (this.pushKey(key) || (this.builds && over(".packing") && this.builder.key(key, this.arrows.middle)) || this.sceneKey(key.toLowerCase())) {
      event.preventDefault()
      this.soon()
    }
  }

  pushKey(key) {
    let pushed = false
    if (this.push.on && key.startsWith("Arrow")) this.cut(() => { pushed = this.push.key(this.hand, key) })
    return pushed
  }

  /** Handle a key that acts on the scene; returns whether it did. */
  sceneKey(key) {
    const { hand } = this
    if (key === "z") this.undo()
    else if (key === " ") this.walk.toggle(hand.body)
    else if (key === "escape") { hand.choose(null); hand.chosen = false }
    else if (key === "[" || key === "]") hand.nudge(key === "]" ? 1 : -1)
    else if (key === "n" && this.push.on) hand.disk = ((hand.disk ?? -1) + 1) % hand.scene.r.length
    else if (key === "n") hand.next()
    else return false
    return true
  }

  undo() {
    this.walk.pause()
    if (this.hand.undos.length) this.hand.undo()
    else if (this.rebuilds) this.builder.undo()
    this.tellUndo()
  }

  /** Whether Undo returns to the scene before the last change of bodies or walls. */
  get rebuilds() { return this.builds && this.builder.undos.length > 0 }

  tellUndo() { this.part("undo").disabled = !this.hand.undos.length && !this.rebuilds }

  // Controls

  controls() {
    const does = (name, act, event = "click") => this.part(name).addEventListener(event, act)
    this.part("name").innerHTML = sceneOptions(this.model.titles, "Learn")
    does("name", (event) => this.open(event.target), "change")
    does("range", (event) => this.setMu(Number(event.target.value)), "input")
    does("typed", (event) => this.type(event.target.value), "change")
    does("play", () => { this.walk.toggle(this.hand.body); this.soon() })
    does("fill", () => this.fill())
    does("undo", () => this.undo())
    does("push", () => { this.pushes(!this.push.on); this.changed() })
    does("save", () => this.find("file"))
    does("mend", () => this.setMu(this.hand.enough))
    does("bars", (event) => {
      const row = event.target.closest("[data-contact]")
      if (row) { this.hand.choose(Number(row.dataset.contact)); this.soon() }
    }, "pointerover")
    does("bars", () => { if (!this.hand.chosen) { this.hand.choose(null); this.soon() } }, "pointerleave")
  }

  fill() {
    this.filled = !this.filled
    if (this.filled) this.space.fill()
    this.part("fill").classList.toggle("on", this.filled)
    this.changed()
  }

  type(text) {
    const mu = Number(text.replace(",", "."))
    if (text.trim() && Number.isFinite(mu) && mu >= 0) return this.setMu(mu)
    this.say("μ is a number from 0 on")
    this.showMu()
  }

  /** Another scene, from the list. */
  open({ value: scene, selectedOptions: [option] }) {
    const { model, view, chosenMu, hand: { mu } } = this
    if (model.large.includes(scene)) {
      clearTimeout(this.resting)
      return window.location.assign(sceneQuery(scene, chosenMu ? Number(mu.toPrecision(6)) : null))
    }
    if (!this.banner.hidden) { // the page reloads its address once the server is back
      window.history.pushState(null, "", `?scene=${scene}`)
      return this.say("This scene opens once the connection is back.")
    }
    this.write("says", `Making “${option.textContent}” …`)
    ask(model, view, chosenMu ? { scene, mu } : { scene })
  }
}

export function render({ model, view }) { return new Workbench(model, view).root }
