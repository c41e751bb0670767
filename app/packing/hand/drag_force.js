// Dragging of a force. A dragged contact stays between its exact bounds, on a rail of networks from
// the server; between two of them the straight line is shown, which is also admissible. After
// release the force stays: the next pull starts there.

import { CARRYING } from "../drawing/chain_style.js"
import { circle, font, line } from "../../browser/canvas_paths.js"
import { plain } from "../../browser/send.js"
import { PointHand } from "./drag_point.js"
import { networkAt } from "../replay/replay.js"

const RAIL = 190 // px, largest length
const EDGE = 14 // px between a rail and the edge of the picture
const AT_END = 2e-3 // fraction of a rail that counts as its end
const FINDING = "Finding how far it can be pulled …"
export const UNCHOSEN = "Select a contact first: click it, or press N for the next one."
const KNOWN = "This force is held: release it (press H) before you pull it."
const NUMBER_LINE = 14 // px, height of a line of numbers next to it
const NUDGE = 1 / 40 // of a rail, per key press
const REST = 600 // ms after the last key press until the force is released
const ROUNDED = 1e-6 // in ⟨fₙ⟩, error of bounds in the page
const HALF_DIGIT = 5e-4 // of the last digit of a typed force
const FADE_MS = 1000 // ms for which its rail stays visible after release

export class Grab {
  /** tell(message): send to the server, see player.py. */
  constructor(player, tell) {
    Object.assign(this, { player, tell })
    this.rail = this.contact = this.value = this.before = null
    this.moved = this.released = false // whether it moved, and whether it was released before its rail arrived
    this.pulled = null // the network after all pulls, as the server has it
    this.aim = null // contact and value of a pull whose network has not arrived
    this.fading = 0
    this.frames = 0
    this.spot = new PointHand(this)
  }

  get replay() { return this.player.replay }

  /** Whether a contact is being dragged. */
  get active() { return this.contact !== null || this.spot.active }

  // Dragging

  /** Take a contact; place: position of the pointer on its rail, given the rail. */
  take(contact, place) {
    const { player } = this
    if (!this.begin()) return
    this.contact = contact
    this.moved = this.released = false
    this.place = place
    player.scene.selected = contact
    player.scene.closeTip()
    this.tell({ grab: contact }) // the server also selects it
    player.paint()
  }

  /** Come to rest at a network with a name; returns whether there is one to drag. */
  begin() {
    const { player } = this
    if (!this.replay || player.live.moves || player.grows || this.spot.active) return false
    player.playback.newest = false
    player.pushed.leave()
    if (player.playing) player.play(false)
    if (this.replay.position % 1) player.show(Math.round(this.replay.position))
    this.settle()
    player.plots.move(true)
    const messageLine = player.buttons.part("message")
    if (messageLine.textContent !== FINDING) this.messageBefore = messageLine.textContent
    messageLine.textContent = FINDING
    return true
  }

  /** The pointer has moved. */
  move(place) {
    this.moved = true
    this.place = place ?? this.place
    if (this.rail && this.contact !== null) this.set(this.place(this.rail))
  }

  /** Release: the force stays. */
  leave() {
    const { contact, rail, value } = this
    if (contact === null) return
    clearTimeout(this.resting)
    this.released = !rail && this.moved
    if (this.released) return // applied when its rail arrives
    this.contact = null
    if (rail && Math.abs(value - this.begun) > 1e-6 * (rail.upper - rail.lower)) {
      this.tell({ pull: [contact, value] })
    }
    if (rail) this.fadeLater()
    this.still()
  }

  /** Nothing is being dragged any more. */
  still() {
    this.restoreMessage()
    this.player.plots.move(false)
    this.player.paint()
    this.player.paintPlots()
  }

  /** Keep the rail's message for a while after release. */
  fadeLater() {
    clearTimeout(this.fading)
    this.fading = setTimeout(() => { this.fading = 0; this.player.repaint() }, FADE_MS)
  }

  /** If nothing was pulled, restore the previous message. */
  restoreMessage() {
    const messageLine = this.player.buttons.part("message")
    if (messageLine.textContent === FINDING) messageLine.textContent = this.messageBefore
  }

  /** A key moves the force of the selected contact. */
  nudge(sign) {
    const { contact } = this.player.model
    if (contact === null || contact === undefined) return this.player.say(UNCHOSEN, true)
    if (this.player.pins.has(contact)) return this.player.say(KNOWN, true)
    this.grip = null
    if (this.contact !== contact) {
      this.steps = 0
      this.take(contact, (rail) => this.begun + this.steps * NUDGE * (rail.upper - rail.lower))
    }
    this.steps += sign
    this.move()
    clearTimeout(this.resting)
    this.resting = setTimeout(() => this.rest(), REST)
  }

  /** Pull the selected contact to a value, or to the end of its interval that the value passes. */
  pullTo(value) {
    const { player } = this, { contact } = player.model
    if (player.grows || this.active || Number.isNaN(value)) return
    const [low, high] = player.look.boundsOf(contact)
    this.aim = { contact, value: Math.max(low + ROUNDED, Math.min(high - ROUNDED, value)) } // rounded ends can lie outside
    if (value <= low + HALF_DIGIT || value >= high - HALF_DIGIT) return this.pullToEnd(Math.sign(2 * value - low - high))
    if (player.playing) player.play(false)
    this.before = this.replay.mixed.normal.slice()
    this.tell({ pull: [contact, this.aim.value] })
  }

  /** Pull the selected contact to its least (−1) or largest (1) value. */
  pullToEnd(sign) {
    this.grip = null
    this.take(this.player.model.contact, ({ lower, upper }) => (sign > 0 ? upper : lower))
    this.move()
    this.leave()
  }

  /** The value to which a contact is being pulled, until its network arrives. */
  wanted(contact) { return this.aim?.contact === contact ? this.aim.value : null }

  rest() {
    if (this.rail) this.leave()
    else if (this.contact !== null) this.resting = setTimeout(() => this.rest(), REST)
  }

  /** Return to the states and drop all pulls. */
  free() {
    if (this.active) this.player.plots.move(false)
    this.contact = null
    this.spot.drop()
    this.player.pushed.leave()
    if (!this.replay?.held) return
    this.tell({ free: true })
    this.forget()
  }

  /** Show what the server has: a state, or the network after the pulls. */
  restore() {
    const { player, replay } = this
    replay.held = null
    player.show(player.model.frame, false)
    this.keep(this.pulled)
  }

  forget() {
    this.pulled = null
    if (this.replay) this.replay.held = null
    this.player.pushed.end()
    this.settle()
    this.player.tellHeld("")
    this.player.say("")
    this.player.again()
  }

  settle() {
    clearTimeout(this.fading)
    this.fading = 0
    this.rail = this.value = null
    if (this.player.look) this.player.look.before = this.replay?.held ? this.before : null
  }

  // Messages from the server

  receive({ rail, fan, held }) {
    this.aim = null
    if (rail !== undefined) this.takeRail(rail && plain(rail))
    if (fan !== undefined) this.spot.spread(fan && plain(fan))
    if (held === undefined || this.active) return
    if (this.player.pushed.held) this.pulled = held && plain(held) // shown after the push
    else this.keep(held && plain(held))
  }

  takeRail(rail) {
    if (!rail) { this.contact = null; this.restoreMessage(); this.player.plots.move(false); return this.player.again() }
    if (rail.contact !== this.contact) return
    const more = this.rail !== null // the ends of a rail that was there in part
    this.rail = rail
    if (more) return this.arrived()
    this.begun = this.replay.mixed.normal[this.contact]
    this.remember()
    this.arrived()
  }

  /** Continue the drag along a rail that arrived; after an early release, move to the target. */
  arrived() {
    this.move()
    if (this.released && this.rail.whole) this.leave()
  }

  /** Changes are coloured relative to the network on screen. */
  remember() { this.before = this.player.look.before = this.replay.mixed.normal.slice() }

  /** The network after the pulls. */
  keep(held) {
    const { player, replay } = this
    if (!replay) return
    if (!held) return this.forget()
    if (held.normal.length !== replay.walk.contacts) return
    this.pulled = held
    const from = replay.frame * replay.walk.contacts
    this.before ??= replay.walk.normal.slice(from, from + replay.walk.contacts)
    replay.held = held
    player.look.before = this.before
    if (held.pull.length > 2) this.spot.describe(...held.pull.slice(1))
    else this.describe(...held.pull)
    player.tellHeld("pull")
    player.again()
  }

  /** The network with this value, by linear interpolation on the rail. */
  set(value) {
    const { rail } = this, { values } = rail
    this.value = Math.max(values[0], Math.min(values[values.length - 1], value))
    this.describe(this.contact, this.value)
    this.show(networkAt(rail, this.value))
  }

  /** Show a network with the next painted frame. */
  show(held) {
    const { replay, player } = this
    replay.held = held
    player.tellHeld(held.place ? "push" : "pull")
    if (this.pendingFrame) return
    this.pendingFrame = requestAnimationFrame(() => {
      this.pendingFrame = 0
      this.frames++
      if (this.replay === replay && replay.held) player.repaintHeld()
    })
  }

  /** −1 or 1 at the lower or upper end of the rail, otherwise 0. */
  get end() {
    if (!this.rail) return 0
    const { lower, upper } = this.rail, near = AT_END * (upper - lower)
    return this.value >= upper - near ? 1 : this.value <= lower + near ? -1 : 0
  }

  /** Contacts that are open or slide at the present end of the rail, and did not before any pull. */
  get holding() {
    const { rail, end } = this, { frame, walk } = this.replay, size = walk.contacts
    const from = end > 0 ? size : 0
    const opened = [], sliding = []
    for (let c = 0; end && c < size; c++) {
      const normal = walk.normal[frame * size + c], most = walk.friction[c] * normal
      if (rail.opened[from + c] && normal > CARRYING) opened.push(c)
      if (rail.sliding[from + c] && Math.abs(walk.tangential[frame * size + c]) < 0.999 * most) sliding.push(c)
    }
    return { opened, sliding }
  }

  describe(contact, value) {
    const { rail, end, replay: { walk } } = this, named = `Contact ${walk.backbone[contact]}`
    if (!rail || !end) {
      const possible = rail ? ` (exact ${rail.lower.toFixed(3)} to ${rail.upper.toFixed(3)})` : ""
      return this.player.say(`${named} pulled to ${value.toFixed(3)}${possible} × the mean force`)
    }
    const { opened: { length }, sliding } = this.holding
    this.player.say(`${named} pulled to its ${end > 0 ? "largest" : "least"} force, ${value.toFixed(3)}: ` +
      `it stops because ${length} contact${length === 1 ? "" : "s"} opened and ${sliding.length} began to slide`)
  }

  // In the intervals

  /** Take a contact by its dot: it follows a pointer at this height, in the units of the plot. */
  takeInBars(contact, value) {
    this.height = value
    this.grip = null
    this.take(contact, () => this.heightOf(contact))
  }

  moveInBars(value) {
    this.height = value
    this.move()
  }

  heightOf(contact) {
    return this.player.model.scale === "own" ? this.height * this.replay.walk.normal[contact] : this.height
  }

  // In the packing

  /** Take the contact under a point of the scene, on a vertical rail through the point. */
  takeInScene(contact, px, py) {
    this.point = [px, py]
    this.grip = [px, py]
    this.take(contact, () => this.valueAt(this.point[1]))
  }

  moveInScene(px, py) {
    this.point = [px, py]
    this.move()
  }

  /** Ends of the rail in the scene, px from the top. */
  ends() {
    const { rail, begun, grip } = this, { size } = this.player.scene
    const part = (begun - rail.lower) / (rail.upper - rail.lower || 1)
    const room = Math.min((grip[1] - EDGE) / (1 - part || 1e-9), (size - EDGE - grip[1]) / (part || 1e-9))
    const length = Math.max(60, Math.min(RAIL, room))
    return [grip[1] + part * length, grip[1] - (1 - part) * length]
  }

  valueAt(py) {
    const { lower, upper } = this.rail, [bottom, top] = this.ends()
    return lower + ((bottom - py) / (bottom - top)) * (upper - lower)
  }

  /** Rail, handle and limiting contacts, on the canvas of marks. */
  draw(context, scene) {
    if (this.contact === null && !this.fading) return
    const { palette, ratio } = scene
    const { opened, sliding } = this.rail ? this.holding : { opened: [], sliding: [] }
    this.drawHolding(context, scene, opened, true)
    this.drawHolding(context, scene, sliding, false)
    if (!this.grip) return
    context.setTransform(ratio, 0, 0, ratio, 0, 0)
    context.strokeStyle = context.fillStyle = palette.selected
    context.lineCap = "round"
    const [x, y] = this.grip
    if (this.rail) {
      const [bottom, top] = this.ends(), { lower, upper } = this.rail
      const at = bottom - ((this.value - lower) / (upper - lower || 1)) * (bottom - top)
      for (const [width, colour] of [[9, palette.halo], [3, palette.selected]]) {
        context.lineWidth = width
        context.strokeStyle = colour
        line(context, [x, bottom], [x, top])
      }
      context.lineWidth = 2
      for (const end of [bottom, top, y]) line(context, [x - 7, end], [x + 7, end])
      context.font = font("12px")
      context.textBaseline = "middle"
      const side = x > scene.size - 70 ? -1 : 1
      context.textAlign = side > 0 ? "left" : "right"
      const ends = [[lower, bottom], [upper, top]].filter(([, py]) => Math.abs(py - at) > NUMBER_LINE)
      for (const [value, py] of [...ends, [this.value, at]]) {
        context.lineWidth = 4
        context.strokeStyle = palette.halo
        context.strokeText(value.toFixed(2), x + 16 * side, py)
        context.fillText(value.toFixed(2), x + 16 * side, py)
      }
      circle(context, [x, at], 8)
      context.fill()
    } else circle(context, [x, y], 8)
    context.lineWidth = 2
    context.stroke()
  }

  /** Contacts at a limit: open ones as rings, sliding ones as squares. */
  drawHolding(context, scene, contacts, opened) {
    if (!contacts.length) return
    const chosen = new Set(contacts), { scale, palette } = scene, r = 4.5 / scale
    context.beginPath()
    for (const { middle: [x, y] } of scene.segments((contact) => chosen.has(contact))) {
      if (opened) { context.moveTo(x + r, y); context.arc(x, y, r, 0, 2 * Math.PI) }
      else context.rect(x - r / 2, y - r / 2, r, r)
    }
    context.lineWidth = 1.6 / scale
    context.strokeStyle = palette.selected
    context.stroke()
  }
}
