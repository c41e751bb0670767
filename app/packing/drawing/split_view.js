// Two networks side by side: the pinned state next to the one on screen, in the same view, or
// another packing that is played along with it. The pinned state is redrawn only when the view, the
// look or the pinned state changes.

import { Look } from "./chain_style.js"
import { createElement } from "../../browser/dom.js"
import { plain } from "../../browser/send.js"
import { Replay } from "../replay/replay.js"
import { Scene } from "./scene.js"

export class Split {
  constructor(player) {
    this.player = player
    const { scene, model } = player
    const twin = new Scene((contact) => { if (!this.other) model.contact = contact })
    this.twin = twin
    this.other = null // the Replay of another packing
    Object.assign(twin.root, { className: "twin", ariaLabel: "the network beside" })
    twin.changed = () => {
      if (!scene.frozen) Object.assign(scene.view, mapped(twin.view, twin.whole, scene.whole))
      scene.changed()
    }
    twin.reset = (paint = true) => { if (paint) scene.reset() }
    twin.onRepaint = () => {}
    this.captions = [twin, scene].map(({ root }) => root.appendChild(createElement("div", { className: "caption" })))
    player.buttons.scenes.prepend(twin.root)
  }

  get on() {
    const { model, replay, live } = this.player
    return Boolean(model.split && replay && (this.other || !live.moves))
  }

  /** Another packing arrived or was removed. */
  take() {
    const walk = plain(this.player.model.twin)
    this.other = walk.contacts ? new Replay(walk) : null
    this.look = null
    this.show()
  }

  /** Apply the comparison and its look. */
  show() {
    const { on, player, other } = this, { model, buttons } = player
    buttons.showSplit(Boolean(model.split), on)
    if (!on) return
    this.tell()
    if (other) this.showOther()
    else this.showPinned()
    this.paint()
  }

  tell() {
    const { captions, player, other } = this, { live, replay: { walk } } = player
    const frame = this.pinned, of = ({ mu }) => `μ = ${Number(mu.toPrecision(4))}`
    if (other) {
      captions[0].textContent = `${of(other.walk)}: ${other.title}`
      captions[1].textContent = live.moves ? "being compressed" : of(walk)
    } else {
      captions[0].textContent = frame ? `pinned: network ${walk.number[frame]}` : `pinned: ${walk.origin}`
      captions[1].textContent = "now"
    }
  }

  get pinned() { return Math.min(this.player.model.reference, this.player.replay.walk.number.length - 1) }

  showPinned() {
    const { model, replay } = this.player, { walk } = replay, { contacts } = walk
    const from = this.pinned * contacts, cut = (values) => values.slice(from, from + contacts)
    const mixed = { normal: cut(walk.normal), tangential: cut(walk.tangential) }
    this.dress(model, walk, { ...replay, mixed, passed: 0 })
  }

  showOther() {
    const { model } = this.player, { walk } = this.other
    this.other.go(this.along)
    const overrides = { exact: walk.exact, loads: null, reference: 0 }
    this.dress(new Proxy(overrides, { get: (target, name) => (name in target ? target[name] : model[name]) }), walk, this.other)
  }

  /** Make the twin show a network of a walk, as set in the model. */
  dress(model, walk, shown) {
    const { twin, player } = this
    if (this.look?.walk !== walk) {
      this.look = new Look(model, walk)
      twin.show(walk)
    }
    const { look } = this
    look.measure()
    twin.palette = player.scene.palette
    twin.describe = { contact: (c) => look.contact(c, shown), grain: (g) => look.grain(g, shown) }
    twin.style = look.of(shown.mixed)
  }

  /** The position at which another packing's walk has the state number of the one that plays. */
  get along() {
    const { walk, spot: [a, b, part] } = this.player.replay, { number } = this.other.walk
    const reached = (1 - part) * walk.number[a] + part * walk.number[b]
    const k = number.findLastIndex((other) => other <= reached)
    return k + 1 < number.length ? k + (reached - number[k]) / (number[k + 1] - number[k]) : k
  }

  /** The player advanced: so does the other packing. */
  step() {
    const { other, on, twin } = this
    if (!other || !on || !twin.style) return
    other.go(this.along)
    this.tell()
    twin.drawChains(this.look.of(other.mixed))
  }

  /** After a change of the view or the selection. */
  paint() {
    const { twin, on, player: { scene }, other } = this
    if (!on || !twin.style) return
    twin.view = mapped(scene.frozen ? scene.whole : scene.view, scene.whole, twin.whole) // a moving packing is shown whole
    twin.selected = other ? null : scene.selected
    twin.pair = other ? [] : scene.pair
    twin.resize()
    if (!twin.size) return
    twin.drawDisks()
    twin.stale = false
    twin.drawChains(twin.style)
  }
}

/** The view of one packing as that of another, which has its own box: the whole maps to the whole. */
function mapped({ x, y, half }, from, to) {
  const ratio = to.half / from.half
  return { x: to.x + (x - from.x) * ratio, y: to.y + (y - from.y) * ratio, half: half * ratio }
}
