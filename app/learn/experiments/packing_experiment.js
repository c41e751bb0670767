// Common parts of the chapters with 400 disks: a packing, a marked contact, a picture of both.

import { createElement } from "../../browser/dom.js"
import { PackingPicture } from "../drawing/packing_picture.js"

export class PackingExperiment {
  constructor(host, options, changed, palettes) {
    Object.assign(this, { host, options, changed, locked: true, found: false, seen: null, palettes })
    this.canvas = new PackingPicture(host, palettes, this)
    this.label = host.appendChild(createElement("div", { className: "label", hidden: true }))
  }

  /** Numbers of a packing that the text needs. */
  counted(packing) {
    const { contacts, free, disks, all_disks: all, mu, spread } = packing
    return { contacts, free, disks, all, mu, spread, equations: 2 * contacts - free }
  }

  /** The first network of a packing, in which it came to rest. */
  asPacked(packing) { return packing.normal.subarray(0, packing.contacts) }

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

  draw(dark, palettes) {
    this.palettes = palettes
    if (this.network) this.canvas.draw(this.network, this.before ?? null, palettes)
  }

  /** Number of results found: the text is updated when it grows. */
  get finds() { return 1 }

  stop() { this.canvas.stop() }
}
