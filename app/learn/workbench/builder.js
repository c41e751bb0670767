// Build your own: disks and walls are placed, moved and removed; nearby disks snap into contact.

import { distance, solve } from "../model/polytope.js"

const NEAR = 0.45 // of the largest radius, within which a disk snaps into contact
const MOST_DISKS = 30, MOST_WALLS = 12
// One disk on the floor, under gravity or under a pressing wall.
const BARE = "2,1,1|0,0,4,0", BARE_UNDER_PRESS = "2,1,1|0,0,4,0;0.4,2,3.6,2|p1"
// The initial scene with pressing walls: three disks under a pressing wall.
const UNDER_PRESS = "1,1,1;3,1,1;2,2.732050807569,1|0,0,4,0;0.4,3.732050807569,3.6,3.732050807569|p1"

// The explanation of each tool.
const HOW = {
  disk: "Click an empty place to add a disk; drag a disk to move it.",
  wall: "Drag from one end of the wall to the other.",
  press: "Click a wall: it presses, or no longer does.",
  remove: "Click a disk or a wall.",
  pull: "Drag the tip of an arrow: all forces follow.",
}

export class Builder {
  /** changed(text): called with another scene, or empty for the initial one. */
  constructor(host, changed) {
    this.changed = changed
    this.tool = "disk"
    this.size = 1
    this.disks = []
    this.walls = []
    this.held = null
    this.cursor = null // of the keyboard
    this.pressure = false // instead of gravity
    this.pressing = new Set() // numbers of walls
    this.untouched = true // the scene is an initial one
    this.host = host
    host.innerHTML = `
      <span role="radiogroup" aria-label="What presses the disks">
        <button type="button" class="soft" role="radio" data-load="gravity">Gravity</button>
        <button type="button" class="soft" role="radio" data-load="pressure">Pressure</button>
      </span>
      <span role="radiogroup" aria-label="What the hand does">
        <button type="button" class="soft" role="radio" data-tool="disk">Add or move</button>
        <button type="button" class="soft" role="radio" data-tool="wall">Draw a wall</button>
        <button type="button" class="soft" role="radio" data-tool="press" title="Click a wall: it presses, or no longer does">Make a wall press</button>
        <button type="button" class="soft" role="radio" data-tool="remove">Remove</button>
        <button type="button" class="soft" role="radio" data-tool="pull">Drag arrows</button>
      </span>
      <label>radius <input class="size" type="range" min="0.4" max="1" step="0.1" value="1" aria-label="radius of new disks"></label>
      <button type="button" class="soft anew" title="Begin anew, with one disk on the floor">Clear</button>
      <span class="how"></span>
      <span class="presses">No gravity. A pressing wall pushes with a force equal to its length.</span>`
    host.addEventListener("click", (event) => {
      const { tool, load } = event.target.dataset
      if (tool) { this.tool = tool; this.tell() }
      if (load) this.choose(load === "pressure")
      if (event.target.classList.contains("anew")) this.begin(this.pressure ? BARE_UNDER_PRESS : BARE)
    })
    host.querySelector(".size").addEventListener("input", (event) => { this.size = Number(event.target.value) })
    this.tell()
  }

  tell() {
    const chosen = [this.tool, this.pressure ? "pressure" : "gravity"]
    for (const button of this.host.querySelectorAll("[role=radio]")) {
      const on = chosen.includes(button.dataset.tool ?? button.dataset.load)
      button.classList.toggle("on", on)
      button.setAttribute("aria-checked", on)
    }
    this.host.querySelector(".how").textContent = HOW[this.tool]
    for (const name of ["[data-tool=press]", ".presses"]) this.host.querySelector(name).hidden = !this.pressure
  }

  /** Choose pressure or gravity. */
  choose(pressure) {
    if (pressure === this.pressure) return
    this.pressure = pressure
    if (!pressure && this.tool === "press") this.tool = "disk"
    this.tell()
    if (this.untouched) this.begin()
    else this.publish()
  }

  /** Load another scene, by default the initial one with the chosen kind of load. */
  begin(text = this.pressure ? UNDER_PRESS : "") {
    this.text = null // accept any scene that arrives
    this.changed(text)
  }

  /** Load a scene from its text, unless the visitor has already changed it; returns whether it is another one. */
  read(text, begins) {
    if (text === this.text || this.held) return false
    this.untouched = begins || text === UNDER_PRESS
    const rows = (part) => (part ?? "").split(";").filter(Boolean).map((row) => row.split(",").map(Number))
    const [disks, walls, press] = text.split("|")
    Object.assign(this, { disks: rows(disks), walls: rows(walls), text, pressure: press !== undefined })
    this.pressing = new Set((press ?? "").slice(1).split(",").filter(Boolean).map((k) => this.walls[k]))
    this.tell()
    return true
  }

  publish() {
    const spelled = (rows) => rows.map((row) => row.map((v) => Number(v.toFixed(12))).join()).join(";")
    const press = this.walls.flatMap((wall, k) => (this.pressing.has(wall) ? [k] : [])).join()
    this.untouched = false
    this.text = `${spelled(this.disks)}|${spelled(this.walls)}${this.pressure ? `|p${press}` : ""}`
    this.changed(this.text)
  }

  /** Whether the builder handles the press at this position. */
  press(at) {
    if (this.tool === "pull") return false
    const own = this.disks.findIndex(([x, y, r]) => Math.hypot(at[0] - x, at[1] - y) < r)
    if (this.tool === "remove") return this.remove(own, at)
    if (this.tool === "press") return this.switchWall(at)
    if (this.tool === "wall") {
      if (this.walls.length >= MOST_WALLS) return true
      this.walls.push([...at, ...at])
      this.held = { wall: this.walls.length - 1 }
      return true
    }
    if (own < 0 && this.disks.length >= MOST_DISKS) return true
    this.held = { disk: own < 0 ? this.disks.length : own }
    if (own < 0) {
      const put = this.snapped(at, this.size, -1)
      if (!put) { this.held = null; return true }
      this.disks.push([...put, this.size])
      this.publish()
    }
    return true
  }

  remove(own, at) {
    const wall = this.wallAt(at)
    if (own >= 0) this.disks.splice(own, 1)
    else if (wall >= 0) this.walls.splice(wall, 1)
    if (own >= 0 || wall >= 0) this.publish()
    return true
  }

  /** Toggle whether the wall at this position presses. */
  switchWall(at) {
    const wall = this.walls[this.wallAt(at)]
    if (!wall) return true
    if (!this.pressing.delete(wall)) this.pressing.add(wall)
    this.publish()
    return true
  }

  /** Number of the wall at this position, −1 if none. */
  wallAt(at) {
    const far = this.walls.map(([a, b, c, d]) => distance([a, b], [c, d], ...at)), least = Math.min(...far)
    return least < 0.4 ? far.indexOf(least) : -1
  }

  carry(at) {
    const { held } = this
    if (!held) return
    if (held.wall !== undefined) {
      this.walls[held.wall] = [...this.walls[held.wall].slice(0, 2), ...this.straight(this.walls[held.wall], at)]
      return
    }
    const [, , r] = this.disks[held.disk], put = this.snapped(at, r, held.disk)
    if (!put) return
    if (put.every((v, k) => v === this.disks[held.disk][k])) return
    this.disks[held.disk] = [...put, r]
    this.publish()
  }

  release() {
    const { held } = this
    this.held = null
    if (held?.wall === undefined) return
    const [a, b, c, d] = this.walls[held.wall], short = Math.hypot(a - c, b - d) < 0.3
    const through = this.disks.some(([x, y, r]) => distance([a, b], [c, d], x, y) < r - 1e-9)
    if (short || through) this.walls.splice(held.wall, 1)
    else this.publish()
  }

  /** By keyboard: arrow keys move a cursor from the position `from`, Enter takes and releases. */
  key(key, from) {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[key]
    if (!step && key !== "Enter") return false
    this.cursor ??= from
    if (step) {
      this.cursor = this.cursor.map((v, k) => v + 0.25 * step[k])
      this.carry(this.cursor)
    } else if (this.held) this.release()
    else this.press(this.cursor)
    return true
  }

  /** Make walls that are nearly level or upright exactly so. */
  straight([a, b], [x, y]) {
    if (Math.abs(y - b) < 0.12 * Math.abs(x - a)) return [x, b]
    if (Math.abs(x - a) < 0.12 * Math.abs(y - b)) return [a, y]
    return [x, y]
  }

  /** The nearest position where a disk touches two others, one, or none; null if there is none. */
  snapped([x, y], r, own) {
    const curves = []
    this.disks.forEach(([a, b, R], k) => { if (k !== own) curves.push({ centre: [a, b], reach: R + r }) })
    for (const [a, b, c, d] of this.walls) {
      const size = Math.hypot(c - a, d - b), [nx, ny] = [-(d - b) / size, (c - a) / size]
      for (const side of [r, -r]) curves.push({ from: [a + side * nx, b + side * ny], along: [(c - a) / size, (d - b) / size] })
      for (const end of [[a, b], [c, d]]) curves.push({ centre: end, reach: r })
    }
    const near = curves.filter((curve) => away(curve, [x, y]) < NEAR)
    const twice = near.flatMap((one, k) => near.slice(k + 1).flatMap((other) => meet(one, other)))
    for (const [places, reach] of [[twice, NEAR * 1.5], [near.map((curve) => foot(curve, [x, y])), NEAR * 1.5], [[[x, y]], 1]]) {
      const there = places.filter((p) => Math.hypot(p[0] - x, p[1] - y) < reach && this.free(p, r, own))
      if (there.length) return there.sort((p, q) => Math.hypot(p[0] - x, p[1] - y) - Math.hypot(q[0] - x, q[1] - y))[0]
    }
    return null
  }

  free([x, y], r, own) {
    return this.disks.every(([a, b, R], k) => k === own || Math.hypot(a - x, b - y) > R + r - 1e-9) &&
      this.walls.every(([a, b, c, d]) => distance([a, b], [c, d], x, y) > r - 1e-9)
  }
}

/** Centres are on circles around disks and ends of walls, and on lines parallel to walls. */
function foot(curve, [x, y]) {
  if (curve.along) {
    const s = (x - curve.from[0]) * curve.along[0] + (y - curve.from[1]) * curve.along[1]
    return [curve.from[0] + s * curve.along[0], curve.from[1] + s * curve.along[1]]
  }
  const [dx, dy] = [x - curve.centre[0], y - curve.centre[1]], size = Math.hypot(dx, dy) || 1
  return [curve.centre[0] + (curve.reach * dx) / size, curve.centre[1] + (curve.reach * dy) / size]
}

function away(curve, at) {
  const [x, y] = foot(curve, at)
  return Math.hypot(x - at[0], y - at[1])
}

function meet(one, other) {
  if (one.along && other.along) {
    const s = solve([[one.along[0], -other.along[0]], [one.along[1], -other.along[1]]],
      [other.from[0] - one.from[0], other.from[1] - one.from[1]])
    return s ? [[one.from[0] + s[0] * one.along[0], one.from[1] + s[0] * one.along[1]]] : []
  }
  if (other.along) return meet(other, one)
  if (one.along) {
    const base = foot(one, other.centre), gap = Math.hypot(base[0] - other.centre[0], base[1] - other.centre[1])
    const half = Math.sqrt(Math.max(0, other.reach ** 2 - gap ** 2))
    return gap > other.reach ? [] : [-half, half].map((s) => [base[0] + s * one.along[0], base[1] + s * one.along[1]])
  }
  const [dx, dy] = [other.centre[0] - one.centre[0], other.centre[1] - one.centre[1]], far = Math.hypot(dx, dy)
  if (!far || far > one.reach + other.reach || far < Math.abs(one.reach - other.reach)) return []
  const s = (far ** 2 + one.reach ** 2 - other.reach ** 2) / (2 * far), half = Math.sqrt(Math.max(0, one.reach ** 2 - s ** 2))
  return [-half, half].map((t) => [one.centre[0] + (s * dx - t * dy) / far, one.centre[1] + (s * dy + t * dx) / far])
}
