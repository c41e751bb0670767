// A small scene in use: its S, the network on screen, the highlighted parts, and the pulls.

import { Body } from "./polytope.js"
import { middleOf } from "./middle.js"

const PULLS = 100 // undo steps
let cuts = 0 // of all scenes since the page was opened

export class SceneInHand {
  /** scene: as from small_scenes.drawn; changed(): called when text and picture have to be updated. */
  constructor(scene, changed) {
    Object.assign(this, { scene, changed, mu: scene.mu, undos: [], path: [] })
    Object.assign(this, { contact: null, disk: null, side: null, contacts: new Set(), read: [], chosen: false })
    this.forget()
    const body = this.body = new Body(scene).cut(scene.mu)
    if (body.whole && !body.empty) body.u = [...body.middle]
    else if (!body.empty && !body.goInside()) body.empty = true
    if (!body.whole) body.u = middleOf(body)
  }

  /**
   * Drop the server's results for one friction and load: a falling motion, bounds, and a sufficient friction. Requests
   * carry the number `S`, and answers with another one are dropped.
   */
  forget() { Object.assign(this, { fall: null, bounds: null, enough: null, S: ++cuts }) }

  /** Highlighted contacts: the selected ones, and those read from the point. */
  get lit() { return new Set([...this.contacts, ...this.read]) }

  /** Cones of another μ, or other loads, on the same disks: S is cut again, and the point stays if possible. */
  cut(mu = this.mu) {
    const { body } = this
    this.mu = mu
    body.cut(mu)
    this.forget()
    if (!body.empty && !body.goTo(body.u)) body.empty = true
    if (!body.empty && body.whole && !Number.isFinite(body.u[0] ?? 0)) body.u = body.middle
    this.path = []
    this.changed()
  }

  /** Other loads on the disks. */
  load(loads) {
    this.body.load = Float64Array.from(loads)
    this.body.reload()
    this.cut()
  }

  choose(contact) {
    this.contact = contact
    this.contacts = new Set(contact === null ? [] : [contact])
  }

  /** The pointer is over {contact, disk, loose} in the picture of the disks, or over nothing. */
  point(target) {
    this.disk = target ? target.disk : null
    if (!this.chosen) this.choose(target && !target.loose ? target.contact : null)
    this.side = null
  }

  /** The same, on pressing. */
  select(target) {
    this.chosen = Boolean(target && !target.loose)
    this.disk = target ? target.disk : null
    this.choose(this.chosen ? target.contact : null)
    this.side = null
    if (this.chosen) this.remember()
  }

  /** Highlight a side of S and the contacts that limit it. */
  lookAt(side) {
    this.read = []
    this.side = side ? side.corners.join() : null
    this.contacts = new Set(side ? side.stops.map(([c]) => c) : this.contact === null ? [] : [this.contact])
  }

  /** Highlight the point and the contacts read from it. */
  readBy(contacts) {
    Object.assign(this, { side: null, read: contacts, contacts: new Set(this.contact === null ? [] : [this.contact]) })
  }

  goTo(u) {
    this.body.goTo(u)
    this.changed()
  }

  pull(contact, normal, tangential) {
    this.body.pull(contact, normal, tangential)
    this.changed()
  }

  /** Pull the selected contact by a keyboard step. */
  nudge(sign) {
    const { body } = this, contact = this.contact ?? 0, F = body.forces()
    if (body.empty || !body.count) return
    this.choose(contact)
    this.chosen = true
    this.remember()
    this.pull(contact, F[2 * contact] + sign * 0.05 * body.scaleOf(), F[2 * contact + 1])
  }

  /** Select the next contact. */
  next() {
    this.choose(this.body.count ? ((this.contact ?? -1) + 1) % this.body.count : null)
    this.chosen = true
  }

  remember() {
    this.undos.push([...this.body.u])
    if (this.undos.length > PULLS) this.undos.shift()
  }

  undo() {
    const u = this.undos.pop()
    if (u) this.goTo(u)
  }
}
