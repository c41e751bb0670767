// A small scene while it is played with: its S, the network on screen, what is looked at, and what was pulled.

import { Body } from "./polytope.js"
import { middleOf } from "./middle.js"

const PULLS = 100 // that can be undone

export class SceneInHand {
  /** scene: as small_scenes.drawn; changed(): there is something new to be said and painted. */
  constructor(scene, changed) {
    Object.assign(this, { scene, changed, mu: scene.mu, undos: [], path: [] })
    Object.assign(this, { contact: null, disk: null, side: null, contacts: new Set(), read: [], chosen: false })
    this.forget()
    const body = this.body = new Body(scene).cut(scene.mu)
    if (body.whole && !body.empty) body.u = [...body.middle]
    else if (!body.empty && !body.goInside()) body.empty = true
    if (!body.whole) body.u = middleOf(body)
  }

  /** What the server tells of one friction and load: a motion in which disks fall, bounds; and a friction that is enough. */
  forget() { Object.assign(this, { fall: null, bounds: null, enough: null }) }

  /** Contacts that light up: those looked at, and those the point is read by. */
  get lit() { return new Set([...this.contacts, ...this.read]) }

  /** Cones of another μ, or other loads, on the same disks: S is cut anew, the point stays if it can. */
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

  /** The hand is over something in the picture of the disks: {contact, disk, loose}, or nothing. */
  point(found) {
    this.disk = found ? found.disk : null
    if (!this.chosen) this.choose(found && !found.loose ? found.contact : null)
    this.side = null
  }

  /** The same, taken in hand. */
  select(found) {
    this.chosen = Boolean(found && !found.loose)
    this.disk = found ? found.disk : null
    this.choose(this.chosen ? found.contact : null)
    this.side = null
    if (this.chosen) this.remember()
  }

  /** A side of S is looked at: what stops there. */
  lookAt(side) {
    this.read = []
    this.side = side ? side.corners.join() : null
    this.contacts = new Set(side ? side.stops.map(([c]) => c) : this.contact === null ? [] : [this.contact])
  }

  /** The point is looked at: the contacts by which it is read. */
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

  /** Pull the chosen contact by a step of the keyboard. */
  nudge(sign) {
    const { body } = this, contact = this.contact ?? 0, F = body.forces()
    if (body.empty || !body.count) return
    this.choose(contact)
    this.chosen = true
    this.remember()
    this.pull(contact, F[2 * contact] + sign * 0.05 * body.scaleOf(), F[2 * contact + 1])
  }

  /** Choose the next contact. */
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
