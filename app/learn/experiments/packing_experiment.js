// Common parts of the chapters with 400 disks: a packing, a marked contact, a picture of both.

import { PackingPicture } from "../drawing/packing_picture.js"

export class PackingExperiment {
  constructor(host, options, changed, palettes) {
    Object.assign(this, { host, options, changed, locked: true, found: false, seen: null, palettes })
    this.canvas = new PackingPicture(host, palettes, (part) => this.pulled(part))
  }

  /** Numbers of a packing that the text needs. */
  counted(packing) {
    const { contacts, free, disks, all_disks: all, mu, spread } = packing
    return { contacts, free, disks, all, mu, spread, equations: 2 * contacts - free }
  }

  /** The first network of a packing, in which it came to rest. */
  asPacked(packing) { return packing.normal.subarray(0, packing.contacts) }

  /** The marked contact is dragged in the picture: no effect, except in chapters that override this. */
  pulled() { return false }

  draw(dark, palettes) {
    this.palettes = palettes
    if (this.network) this.canvas.draw(this.network, this.before ?? null, palettes)
  }

  /** Number of results found: the text is updated when it grows. */
  get finds() { return 1 }

  stop() { this.canvas.stop() }
}
