// What the chapters of 400 disks have in common: a packing, a marked contact, a picture of both.

import { PackingPicture } from "../drawing/packing_picture.js"

export class PackingExperiment {
  constructor(host, options, changed, palettes) {
    Object.assign(this, { options, changed, locked: true, found: false, seen: null, palettes })
    this.canvas = new PackingPicture(host, palettes, (part) => this.pulled(part))
  }

  /** Numbers of a packing that the words need. */
  counted(packing) {
    const { contacts, free, disks, all_disks: all, mu, spread } = packing
    return { contacts, free, disks, all, mu, spread, equations: 2 * contacts - free }
  }

  /** The first network of a packing, that it came to rest with. */
  asPacked(packing) { return packing.normal.subarray(0, packing.contacts) }

  /** The marked line is dragged in the picture: nothing, but in chapters that say so. */
  pulled() { return false }

  draw(dark, palettes) {
    this.palettes = palettes
    if (this.network) this.canvas.draw(this.network, this.before ?? null, palettes)
  }

  /** How many things were found: the words follow where it grows. */
  get finds() { return 1 }

  stop() { this.canvas.stop() }
}
