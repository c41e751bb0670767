// Marks of known forces: a pin on each held contact, hollow if it has an error bar; numbers on the
// contacts most worth measuring, the best first; and arrows where a contact is pushed.

import { arrow, circle, font } from "../../browser/canvas_paths.js"
import { markSelected } from "./marks.js"
import { plain } from "../../browser/send.js"

const PIN = 17 // px, its height
const ARROW_PX = 10, GROWN_PX = 100 // length beyond the edge of the pushed disk: least, and the largest addition
const COPY = 0.35 // opacity of the arrows at a periodic copy
const SPOT = 0.22 // largest radii, of the spot that replaces it in exported pictures

export class Pins {
  constructor(player) {
    this.player = player
    this.model = player.model
  }

  get pins() { return plain(this.model.pins ?? {}) }

  /** Whether the force of a contact is known. */
  has(contact) { return [...(this.pins.contacts ?? [])].includes(contact) }

  /** The force at which a contact is held; undefined if it is not. */
  heldAt(contact) {
    const { contacts = [], values } = this.pins
    return values?.[contacts.indexOf(contact)]
  }

  draw(context, scene) {
    const { contacts = [], exact = [], ranked = [] } = this.pins
    if (this.player.pushable && !scene.frozen) {
      context.save()
      if (scene.selected === null) markSelected(context, scene, this.pushedContact(scene))
      this.push(context, scene)
      context.restore()
    }
    if (this.player.pushes) return // which ignores held forces
    if (!contacts.length && !ranked.length) return
    const held = new Map(), rank = new Map(), { ratio } = scene
    for (let k = 0; k < contacts.length; k++) held.set(contacts[k], exact[k])
    for (let k = 0; k < ranked.length; k++) rank.set(ranked[k], k + 1)
    context.save()
    context.setTransform(ratio, 0, 0, ratio, 0, 0)
    for (const { contact: c, middle } of scene.segments((c) => held.has(c) || rank.has(c))) {
      const place = scene.toPixel(...middle)
      if (held.has(c)) this.pin(context, scene.palette, place, held.get(c))
      else this.badge(context, scene.palette, place, rank.get(c))
    }
    context.restore()
  }

  /** The contact to push: the selected or the highlighted one. */
  pushedContact(scene) {
    const { walk } = this.player.replay
    return scene.selected ?? walk.inviting ?? -1
  }

  /** The two forces that push the disks of a contact apart; faint at its periodic copies. */
  push(context, scene) {
    const { geometry, palette, scale } = scene, contact = this.pushedContact(scene)
    const first = geometry.contact.indexOf(contact), beyond = (ARROW_PX + GROWN_PX * this.player.pushed.part) / scale
    context.lineCap = context.lineJoin = "round"
    for (const { k, a, b } of scene.segments((each) => each === contact)) {
      const far = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1, u = [(b[0] - a[0]) / far, (b[1] - a[1]) / far]
      context.globalAlpha = k === first ? 1 : COPY
      context.beginPath()
      for (const [from, grain, way] of [[a, geometry.i[k], -1], [b, geometry.j[k], 1]]) {
        const edge = scene.outline(grain) ? geometry.unit / 2 : geometry.radius[grain]
        const long = way * (edge + beyond)
        arrow(context, from, from.map((v, d) => v + long * u[d]), 12 / scale, 0.7)
      }
      for (const [width, colour] of [[9, palette.halo], [4, palette.selected]]) {
        context.lineWidth = width / scale
        context.strokeStyle = colour
        context.stroke()
      }
    }
    context.globalAlpha = 1
  }

  /** In an exported picture: the push, or a spot on each known contact, hollow with an error bar. */
  onSheet(sheet, scene) {
    if (this.player.pushed.held) return this.push(sheet, scene)
    const { contacts = [], exact = [] } = this.pins, { known, halo } = scene.palette
    for (const [n, held] of [...contacts].entries()) {
      for (const { middle } of scene.segments((contact) => contact === held)) {
        circle(sheet, middle, SPOT * scene.geometry.unit)
        sheet.strokeStyle = known
        sheet.lineWidth = (SPOT * scene.geometry.unit) / 2
        sheet.stroke()
        sheet.fillStyle = exact[n] ? known : halo
        sheet.fill()
      }
    }
  }

  pin(context, { known, halo }, [x, y], exact) {
    const r = PIN / 3, top = y - PIN + r
    context.beginPath()
    context.arc(x, top, r, 0.85 * Math.PI, 0.15 * Math.PI)
    context.lineTo(x, y)
    context.closePath()
    for (const [width, colour] of [[4, halo], [2, known]]) {
      context.lineWidth = width
      context.strokeStyle = colour
      context.stroke()
    }
    context.fillStyle = exact ? known : halo
    context.fill()
  }

  badge(context, { known, halo }, [x, y], number) {
    circle(context, [x, y], 9)
    context.fillStyle = halo
    context.fill()
    context.lineWidth = 2
    context.strokeStyle = context.fillStyle = known
    context.stroke()
    context.font = font("bold 11px")
    context.textAlign = "center"
    context.textBaseline = "middle"
    context.fillText(number, x, y + 0.5)
  }
}
