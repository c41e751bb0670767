// Common parts of the chapters with 400 disks: a packing, a marked contact, a picture of both.

import { createElement } from "../../browser/dom.js"
import { eased } from "../../browser/motion.js"
import { OPENS } from "../../packing/drawing/first_motion.js"
import { PackingPicture } from "../drawing/packing_picture.js"

const AT_LIMIT = 1e-4 // mean forces: distance from the limit of friction, or from no force

export class PackingExperiment {
  constructor(host, options, changed, palettes) {
    Object.assign(this, { host, options, changed, steered: true, locked: true, answered: false, seen: null, palettes })
    this.canvas = new PackingPicture(host, palettes, this)
    this.label = host.appendChild(createElement("div", { className: "label", hidden: true }))
  }

  /** Numbers of a packing that the text needs. */
  counted(packing) {
    const { contacts, free, disks, all_disks: all, mu } = packing
    return { contacts, free, disks, all, mu, equations: 2 * contacts - free }
  }

  /** The first network of a packing, in which it came to rest. */
  asPacked(packing) { return packing.normal.subarray(0, packing.contacts) }

  /** Contacts that are open, or slip, on the network on screen; null if it has no friction, before a prediction, and in a plain picture. */
  get limited() { return this.locked || !this.tangential || this.options.plain ? null : this.marks(this.network, this.tangential) }

  /** Contacts of a network that are open, or slip, as in drawLimits. */
  marks(normal, tangential) {
    const { mu } = this.packing
    return Uint8Array.from(normal, (v, c) => (v < AT_LIMIT ? OPENS : Number(mu * v - Math.abs(tangential[c]) < AT_LIMIT)))
  }

  // The hand in the picture: no effect, except in chapters that override these

  /** Whether a contact can be dragged. */
  takes() { return false }

  /** A contact is taken. */
  take() {}

  /** It is dragged: upwards by this fraction of the height of the picture since it was taken. */
  pulled() {}

  /** It is released. */
  release() {}

  /** A line of text in the picture; none if empty. */
  say(words) { Object.assign(this.label, { textContent: words, hidden: !words }) }

  /** Draw the lines on their way to the network; returns whether they have not arrived. */
  draw(dark, palettes) {
    this.palettes = palettes
    if (!this.network) return false
    this.shown = eased(this.shown, this.network)
    this.canvas.limited = this.limited
    this.canvas.draw(this.shown, this.before, palettes)
    return this.shown !== this.network
  }

  get range() { return [this.answer, this.answer] }

  /** From the least to the largest value. */
  finish({ x }) { for (const to of [x.low, x.high]) this.drag(to) }

  stop() { this.canvas.stop() }
}
