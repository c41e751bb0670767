// Spot the difference: the pinned network beside another one, both without colour. Where do they differ
// most? A click, or N by keyboard, is an answer; what was found is ringed, and at the end colours tell all.

import { CARRYING } from "../packing/drawing/chain_style.js"

const TO_FIND = 5 // contacts, those whose fₙ differs most
const RING = 0.8 // radius, in largest radii

export class Difference {
  constructor(player) {
    this.player = player
    this.on = false
    this.found = new Set()
  }

  begin(replay) {
    const { player } = this, { model, split } = player
    model.beside = model.contact = null
    if (!replay.held && replay.frame === split.pinned) player.show(this.farthest(replay.walk, split.pinned))
    const { normal } = replay.mixed, { contacts } = replay.walk
    this.change = normal.map((value, c) => value - replay.walk.normal[split.pinned * contacts + c])
    const order = Array.from(normal.keys()).sort((a, b) => Math.abs(this.change[b]) - Math.abs(this.change[a]))
    this.wanted = new Set(order.slice(0, TO_FIND))
    if (!(Math.abs(this.change[order[0]]) > CARRYING)) return player.say("There is one network only: nothing differs.")
    this.on = true
    this.found.clear()
    model.split = true
    this.player.dress(true)
    this.tell(`Two force networks in the same disks. Click the ${this.wanted.size} lines that differ most.`)
  }

  /** The state whose forces differ most from a frame. */
  farthest({ normal, contacts, number }, from) {
    let best = from, most = 0
    for (let k = 0; k < number.length; k++) {
      let sum = 0
      for (let c = 0; c < contacts; c++) sum += Math.abs(normal[k * contacts + c] - normal[from * contacts + c])
      if (sum > most) [best, most] = [k, sum]
    }
    return best
  }

  /** A contact was chosen. */
  guess(contact) {
    if (!this.on || contact === null || contact === undefined) return
    const by = this.change[contact], left = () => this.wanted.size - this.found.size
    const told = `This line carries ${Math.abs(by).toFixed(2)} × the mean force ${by > 0 ? "more" : "less"} at the right`
    const already = this.found.has(contact)
    if (this.wanted.has(contact)) this.found.add(contact)
    if (!left()) return this.end(`${told}. That was the last one: now colours show where the two differ.`)
    const judged = already ? "found before" : this.wanted.has(contact) ? "found" : "others differ more"
    this.tell(`${told}: ${judged}. ${this.found.size} of ${this.wanted.size} found.`)
  }

  end(words = "") {
    if (!this.on && !this.told) return
    const was = this.on
    this.on = false
    this.tell(words)
    if (was) this.player.dress(false)
  }

  tell(words) {
    this.told = Boolean(words)
    this.player.buttons.part("quiz").textContent = words
    this.player.buttons.part("differ").classList.toggle("on", this.on)
    this.player.buttons.root.classList.toggle("quizzed", this.on) // what is under the pointer would tell
  }

  draw(context, scene) {
    if (!this.on || !this.found.size) return
    const { geometry, palette, scale } = scene, size = RING * Math.max(...geometry.radius)
    context.strokeStyle = palette.known
    context.lineWidth = 4 / scale
    context.beginPath()
    for (const { middle: [x, y] } of scene.segments((contact) => this.found.has(contact))) {
      context.moveTo(x + size, y)
      context.arc(x, y, size, 0, 2 * Math.PI)
    }
    context.stroke()
  }
}
