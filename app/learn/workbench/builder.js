// Build your own: disks, blocks and walls are placed, moved, turned and removed; nearby bodies snap into contact.

import { beside, contactCurves, foot, gap, meet, shape } from "../model/contact_curves.js"

const NEAR = 0.45 // within which a body snaps into contact
const FLAT = 5 // degrees within which a block that is moved or turned by hand aligns with an edge
const STEP = 5 // degrees per key press
const MOST_BODIES = 30, MOST_WALLS = 12
const GRIP = 16, LEVER = 30 // px: reach and length of the handle of a block
const SIZES = [0.1, 12] // of the sides of a block
// One body on the floor, under gravity or under a pressing wall.
const BARE = {
  disk: ["2,1,1|0,0,4,0", "2,1,1|0,0,4,0;0.4,2,3.6,2|p1"],
  block: ["4,0.5,2,1,0|0,0,8,0", "4,0.5,2,1,0|0,0,8,0;2.4,1,5.6,1|p1"],
}
// The initial scene with pressing walls: three disks under a pressing wall.
const UNDER_PRESS = "1,1,1;3,1,1;2,2.732050807569,1|0,0,4,0;0.4,3.732050807569,3.6,3.732050807569|p1"

// The explanation of each tool.
const HOW = {
  disk: "Click an empty place to add a disk; drag a body to move it.",
  block: "Click an empty place to add a block; drag a body to move it; drag the round handle, or press Q or E, to turn it.",
  wall: "Drag from one end of the wall to the other.",
  press: "Click a wall: it presses, or no longer does.",
  remove: "Click a body or a wall.",
  pull: "Drag the tip of an arrow: all forces follow.",
}

export class Builder {
  /** changed(text): called with another scene, or empty for the initial one. */
  constructor(host, changed) {
    this.changed = changed
    this.tool = "disk"
    this.sizes = { disk: [1], block: [2, 1, 0] } // of new bodies: radius; width, height, degrees
    this.bodies = [] // rows, see shape
    this.walls = []
    this.held = null
    this.chosen = null // number of the body that was placed or moved last
    this.unit = 1 // px
    this.cursor = null // of the keyboard
    this.pressure = false // instead of gravity
    this.pressing = new Set() // numbers of walls
    this.untouched = true // the scene is an initial one
    this.undos = [] // texts of earlier scenes
    this.host = host
    host.innerHTML = `
      <span role="radiogroup" aria-label="What presses the bodies">
        <button type="button" class="soft" role="radio" data-load="gravity">Gravity</button>
        <button type="button" class="soft" role="radio" data-load="pressure">Pressure</button>
      </span>
      <span role="radiogroup" aria-label="What the hand does">
        <button type="button" class="soft" role="radio" data-tool="disk">Disks</button>
        <button type="button" class="soft" role="radio" data-tool="block">Blocks</button>
        <button type="button" class="soft" role="radio" data-tool="wall">Draw a wall</button>
        <button type="button" class="soft" role="radio" data-tool="press" title="Click a wall: it presses, or no longer does">Make a wall press</button>
        <button type="button" class="soft" role="radio" data-tool="remove">Remove</button>
        <button type="button" class="soft" role="radio" data-tool="pull">Drag arrows</button>
      </span>
      <label data-for="disk">radius <input class="size" type="range" min="0.4" max="1" step="0.1" value="1" aria-label="radius of new disks"></label>
      ${["width", "height", "degrees"].map((name, k) => `<label data-for="block">${name} <input class="side" data-side="${k}" inputmode="decimal"></label>`).join("")}
      <button type="button" class="soft anew" title="Begin anew, with one body on the floor">Clear</button>
      <span class="how" role="status"></span>
      <span class="presses">No gravity. A pressing wall pushes with a force equal to its length.</span>`
    host.addEventListener("click", (event) => {
      const { tool, load } = event.target.dataset
      if (tool) { this.tool = tool; this.tell() }
      if (load) this.choose(load === "pressure")
      if (event.target.classList.contains("anew")) this.begin((BARE[this.tool] ?? BARE.disk)[Number(this.pressure)])
    })
    host.querySelector(".size").addEventListener("input", (event) => { this.sizes.disk = [Number(event.target.value)] })
    host.addEventListener("change", ({ target: { dataset: { side }, value } }) => { if (side) this.size(Number(side), value) })
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
    for (const label of this.host.querySelectorAll("[data-for]")) label.hidden = label.dataset.for !== this.tool
    for (const field of this.host.querySelectorAll(".side")) field.value = String(Number((this.block?.slice(2) ?? this.sizes.block)[field.dataset.side].toFixed(2)))
  }

  /** The chosen body if it is a block, while blocks are placed. */
  get block() {
    const body = this.tool === "block" ? this.bodies[this.chosen] : undefined
    return body?.length > 3 ? body : undefined
  }

  /** Typed width, height or degrees (side 0, 1, 2) of new blocks, and of the chosen one if there is room. */
  size(side, text) {
    const value = Number(text.replace(",", ".")), { block, sizes } = this
    const changed = (block?.slice(2) ?? sizes.block).with(side, side < 2 ? Math.min(SIZES[1], Math.max(SIZES[0], value)) : value % 360)
    const valid = text.trim() && Number.isFinite(value), fits = valid && (!block || this.reshape(this.chosen, changed))
    if (fits) sizes.block = changed
    this.tell()
    if (!fits) this.refuse(valid ? "There is no room to change the block like this." : "Type a number.")
  }

  /** Say why nothing changes, in place of the explanation of the tool. */
  refuse(words) { this.host.querySelector(".how").textContent = words }

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
    this.undos.push(this.text)
    this.load(text)
  }

  undo() { this.load(this.undos.pop()) }

  load(text) {
    this.text = null // accept any scene that arrives
    this.changed(text)
  }

  /** Load a scene from its text, unless the visitor has already changed it; returns whether it is another one. */
  read(text, begins) {
    if (text === this.text || this.held) return false
    this.untouched = begins || text === UNDER_PRESS
    const rows = (part) => (part ?? "").split(";").filter(Boolean).map((row) => row.split(",").map(Number))
    const [bodies, walls, press] = text.split("|")
    Object.assign(this, { chosen: null, bodies: rows(bodies), walls: rows(walls), text, pressure: press !== undefined })
    if (this.tool === "disk" && this.bodies.every((body) => body.length > 3)) this.tool = "block"
    this.pressing = new Set((press ?? "").slice(1).split(",").filter(Boolean).map((k) => this.walls[k]))
    this.tell()
    return true
  }

  publish() {
    const spelled = (rows) => rows.map((row) => row.map((v) => Number(v.toFixed(12))).join()).join(";")
    const press = this.walls.flatMap((wall, k) => (this.pressing.has(wall) ? [k] : [])).join()
    this.untouched = false
    if (!this.held?.moved) this.undos.push(this.text) // a drag is one step
    if (this.held) this.held.moved = true
    this.text = `${spelled(this.bodies)}|${spelled(this.walls)}${this.pressure ? `|p${press}` : ""}`
    this.changed(this.text)
  }

  /** Whether the builder handles the press at this position; unit: px. */
  press(at, unit = this.unit) {
    this.unit = unit
    if (this.tool === "pull") return false
    const point = shape([...at, 0]), index = this.bodies.findIndex((body) => gap(shape(body), point) < 0)
    if (this.tool === "remove") return this.remove(index, at)
    if (this.tool === "press") return this.switchWall(at)
    if (this.tool === "wall") {
      if (this.walls.length >= MOST_WALLS) { this.refuse(`A scene has ${MOST_WALLS} walls at most.`); return true }
      this.walls.push([...at, ...at])
      this.held = { wall: this.walls.length - 1 }
      return true
    }
    if (this.block && Math.hypot(...this.handle[1].map((v, k) => v - at[k])) < GRIP / unit) this.held = { body: this.chosen, turns: true }
    else if (index >= 0) this.take(index, at)
    else if (this.bodies.length < MOST_BODIES) this.add(at)
    else this.refuse(`A scene has ${MOST_BODIES} bodies at most.`)
    return true
  }

  take(index, at) {
    const [x, y] = this.bodies[index]
    this.chosen = index
    this.held = { body: index, grip: [x - at[0], y - at[1]] }
  }

  /** Add a body; a block lies flat on the nearest edge. */
  add(at) {
    const row = this.placed([...at, ...this.sizes[this.tool]], -1, 45)
    if (!row) return this.refuse("There is no room here: bodies and walls may touch, but not overlap.")
    this.take(this.bodies.push(row) - 1, at)
    this.publish()
  }

  remove(index, at) {
    const wall = this.wallAt(at)
    if (index >= 0) this.bodies.splice(index, 1)
    else if (wall >= 0) this.walls.splice(wall, 1)
    this.chosen = null
    if (index >= 0 || wall >= 0) this.publish()
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
    const far = this.walls.map((wall) => gap(shape(wall), shape([...at, 0]))), least = Math.min(...far)
    return least < 0.4 ? far.indexOf(least) : -1
  }

  carry(at) {
    const { held } = this
    if (!held) return
    if (held.wall !== undefined) {
      this.walls[held.wall] = [...this.walls[held.wall].slice(0, 2), ...this.straight(this.walls[held.wall], at)]
      return
    }
    const body = this.bodies[held.body], [x, y] = body
    if (held.turns) {
      const degrees = Math.round((Math.atan2(at[1] - y, at[0] - x) * 180) / Math.PI - 90)
      this.reshape(held.body, body.slice(2).with(2, this.flat(body.with(4, degrees), held.body, FLAT)))
    } else {
      const row = this.placed([at[0] + held.grip[0], at[1] + held.grip[1], ...body.slice(2)], held.body, FLAT)
      if (row) this.replace(held.body, row)
      else this.refuse("There is no room there.")
    }
  }

  /** Give a body another size or turn, and move it as far as contacts need; returns whether there is room. */
  reshape(index, size) {
    const row = [...this.bodies[index].slice(0, 2), ...size], at = this.settled(row, index) ?? this.settled(row, index, Math.hypot(...size.slice(0, 2)) / 2)
    if (at) this.replace(index, [...at, ...size])
    return Boolean(at)
  }

  /** Put another row in place of a body, if it differs. */
  replace(index, row) {
    if (row.every((v, k) => v === this.bodies[index][k])) return
    this.bodies[index] = row
    this.tell()
    this.publish()
  }

  /** Turn the chosen block by an angle. */
  turn(degrees) {
    if (!this.block) return false
    const size = this.block.slice(2)
    this.reshape(this.chosen, size.with(2, size[2] + degrees))
    return true
  }

  /** The handle of the chosen block, above its middle: from its edge to its end; null if there is none. */
  get handle() {
    if (!this.block) return null
    const [x, y, , high, degrees] = this.block, turn = (degrees * Math.PI) / 180
    return [high / 2, high / 2 + LEVER / this.unit].map((far) => [x - far * Math.sin(turn), y + far * Math.cos(turn)])
  }

  release() {
    const { held } = this
    this.held = null
    if (held?.body !== undefined) { // only now, because it can move the picture
      this.tool = this.bodies[held.body].length > 3 ? "block" : "disk"
      this.tell()
    }
    if (held?.wall === undefined) return
    const [a, b, c, d] = this.walls[held.wall], short = Math.hypot(a - c, b - d) < 0.3
    if (!short && this.bodies.every((body) => gap(shape(body), shape([a, b, c, d])) >= -1e-9)) return this.publish()
    this.walls.splice(held.wall, 1)
    this.refuse(short ? "This wall is too short: drag from one end to the other." : "No wall here: it would cut a body.")
  }

  /** By keyboard: arrow keys move a cursor from the position `from`, Enter takes and releases, Q and E turn a block. */
  key(key, from) {
    const turn = { q: STEP, e: -STEP }[key.toLowerCase()]
    if (turn) return this.turn(turn)
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

  /** A row at the nearest position in contact, a block after turning by up to `most` degrees onto an edge; null if there
   * is no room. */
  placed(row, index, most) {
    const turned = row.length > 3 ? row.with(4, this.flat(row, index, most)) : row, at = this.settled(turned, index)
    if (at) return [...at, ...turned.slice(2)]
    return turned[4] === row[4] ? null : this.placed(row, index, 0)
  }

  /** Degrees of a block that lies flat on the nearest edge, if it turns by `most` at most. */
  flat(row, index, most) {
    const edges = this.others(index).filter((other) => other.length > 3).map((other) => {
      const angle = other[4] ?? (Math.atan2(other[3] - other[1], other[2] - other[0]) * 180) / Math.PI
      const turned = angle - 90 * Math.round((angle - row[4]) / 90)
      return { turned, far: gap(shape(row.with(4, turned)), shape(other)) }
    })
    const [nearest] = edges.filter(({ far, turned }) => far < NEAR && Math.abs(turned - row[4]) <= most).sort((a, b) => a.far - b.far)
    return nearest?.turned ?? row[4]
  }

  others(index) { return [...this.bodies.filter((_, k) => k !== index), ...this.walls] }

  /** The nearest position where a body touches two others, one, or none; null if there is none. */
  settled([x, y, ...size], index, near = NEAR) {
    const others = this.others(index).map(shape), moved = shape([0, 0, ...size])
    const far = (place) => Math.hypot(place[0] - x, place[1] - y)
    const free = (place) => { const body = shape([...place, ...size]); return others.every((other) => gap(body, other) > -1e-9) }
    const curves = others.flatMap((other) => contactCurves(moved, other)).filter((curve) => far(foot(curve, [x, y])) < near)
    const feet = curves.filter((curve) => beside(curve, [x, y])).map((curve) => foot(curve, [x, y]))
    const twice = curves.flatMap((curve, k) => curves.slice(k + 1).flatMap((other) => meet(curve, other)))
    for (const places of [twice, feet, [[x, y]]]) {
      const nearest = places.filter((place) => far(place) < 1.5 * near).sort((a, b) => far(a) - far(b)).find(free)
      if (nearest) return nearest
    }
    return null
  }
}
