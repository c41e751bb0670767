// S of a small scene, cut out of all balanced networks for every μ and every load: corners where
// sides meet, the nearest network to any other, and a walk through it.

const FAR = [1e4, 1e8] // bounds added to an apparently unbounded S, to find rays along which it is unbounded
const SMALL = 1e-9
const STEERED = 12 // most projections onto S during dragging
export const OPENS = 0 // f_n = 0; 1 and −1: f_t = μ f_n and −μ f_n

/** Distance from the segment between two points to a third. */
export function distance([ax, ay], [bx, by], px, py) {
  const [dx, dy] = [bx - ax, by - ay], size = dx * dx + dy * dy || 1
  const s = Math.max(0, Math.min(1, ((px - ax) * dx + (py - ay) * dy) / size))
  return Math.hypot(px - ax - s * dx, py - ay - s * dy)
}

/** Corners of the convex hull of points in a plane, in order. */
export function hull(points) {
  const sorted = points.toSorted(([a, b], [c, d]) => a - c || b - d)
  const half = (ordered) => ordered.reduce((kept, [x, y]) => {
    const left = () => { const [[a, b], [c, d]] = kept.slice(-2); return (c - a) * (y - b) > (d - b) * (x - a) }
    while (kept.length > 1 && !left()) kept.pop()
    return [...kept, [x, y]]
  }, [])
  return [...half(sorted).slice(0, -1), ...half(sorted.toReversed()).slice(0, -1)]
}

/** The area of a polygon. */
export function area(corners) {
  return Math.abs(corners.reduce((sum, [x, y], k) => { const [a, b] = corners.at(k - 1); return sum + a * y - b * x }, 0)) / 2
}

export function dot(a, b) {
  let sum = 0
  for (let k = 0; k < a.length; k++) sum += a[k] * b[k]
  return sum
}

/** The solution of a small square system, null if its rows are dependent. */
export function solve(rows, right) {
  const n = right.length, M = rows.map((row, k) => [...row, right[k]])
  for (let c = 0; c < n; c++) {
    let p = c
    for (let r = c + 1; r < n; r++) if (Math.abs(M[r][c]) > Math.abs(M[p][c])) p = r
    if (Math.abs(M[p][c]) < 1e-10) return null
    ;[M[c], M[p]] = [M[p], M[c]]
    for (let r = 0; r < n; r++) {
      if (r === c) continue
      const part = M[r][c] / M[c][c]
      if (part) for (let k = c; k <= n; k++) M[r][k] -= part * M[c][k]
    }
  }
  return M.map((row, k) => row[n] / row[k])
}

export class Body {
  constructor(scene) {
    this.scene = scene
    this.h = scene.h ?? 0
    this.count = scene.i.length
    const width = 2 * this.count
    this.axes = Array.from({ length: this.h }, (_, k) => scene.axes.slice(k * width, (k + 1) * width))
    this.load = Float64Array.from(scene.load)
    this.u = Array(this.h).fill(0)
    this.bounded = true // above three dimensions until the server says otherwise
    this.reload()
  }

  /** All balanced networks under the present loads: origin + u · axes, if there are any. */
  reload() {
    const { scene } = this, rows = scene.b?.length ?? 0, width = 2 * this.count
    const b = this.b = Float64Array.from(scene.b ?? [])
    ;[...(scene.grains ?? [])].forEach((grain, k) => {
      if (3 * grain + 2 >= this.load.length) return
      b[3 * k] = -this.load[3 * grain]
      b[3 * k + 1] = -this.load[3 * grain + 1]
      b[3 * k + 2] = -this.load[3 * grain + 2] / scene.r[grain]
    })
    this.origin = new Float64Array(width)
    for (let k = 0; k < width; k++) for (let r = 0; r < rows; r++) this.origin[k] += scene.lift[k * rows + r] * b[r]
    let unbalanced = 0, size = 1
    for (let r = 0; r < rows; r++) {
      let sum = -b[r]
      for (let k = 0; k < width; k++) sum += scene.A[r * width + k] * this.origin[k]
      unbalanced = Math.max(unbalanced, Math.abs(sum))
      size = Math.max(size, Math.abs(b[r]))
    }
    this.consistent = unbalanced < 1e-9 * size && this.touched()
  }

  /** Whether every loaded disk touches anything. */
  touched() {
    const { scene, load } = this, held = new Set([...scene.i, ...scene.j])
    return [...scene.r].every((_, g) => held.has(g) || !(load[3 * g] || load[3 * g + 1]))
  }

  /** Cones at this μ: slope · u + rest ≥ 0, three rows per contact. */
  cut(mu) {
    this.mu = mu
    this.rows = []
    let still = true // whether cones that do not depend on u are satisfied
    for (let c = 0; c < this.count; c++) {
      for (const what of [1, -1, OPENS]) {
        const of = (force) => (what === OPENS ? force[2 * c] : mu * force[2 * c] - what * force[2 * c + 1])
        const slope = this.axes.map(of), rest = of(this.origin), size = Math.hypot(...slope)
        if (size > 1e-10) this.rows.push({ slope: slope.map((v) => v / size), rest: rest / size, contact: c, what })
        else if (rest < -SMALL) still = false
      }
    }
    this.possible = still && this.consistent && this.count > 0 && Boolean(this.scene.b)
    this.whole = this.h <= 3
    if (this.whole) this.draw()
    else this.empty = !this.possible
    return this
  }

  /** Corners, sides and rays, in at most three dimensions. */
  draw() {
    const scale = this.scaleOf(), total = this.sum()
    const cap = (reach) => {
      const size = Math.hypot(...total.slope)
      return size > 1e-10 ? [{ slope: total.slope.map((v) => -v / size), rest: (reach - total.rest) / size, cap: true }] : []
    }
    let rows, corners = [], far = []
    this.rays = []
    for (const reach of this.possible ? FAR : []) {
      rows = [...this.rows, ...cap(reach * scale)]
      corners = this.meetings(rows)
      far = corners.filter((corner) => corner.cap)
      this.rays = far.map(({ u }) => this.along(u, total.slope))
        .filter((ray) => ray && this.isRay(ray))
        .filter((ray, k, all) => all.findIndex((other) => dot(other, ray) > 1 - 1e-12) === k) // one of parallel sides
      if (!far.length || this.rays.length) break
    }
    this.empty = !corners.length
    this.bounded = !this.rays.length
    if (!this.bounded) { // cut closer for the picture
      const reach = Math.max(...corners.filter((corner) => !corner.cap).map((corner) => this.sumAt(corner.u)), scale)
      rows = [...this.rows, ...cap(3 * reach)]
      corners = this.meetings(rows)
    }
    this.corners = corners
    this.drawn = rows
    this.sides = this.empty ? [] : this.faces(rows)
    this.middle = this.u.map((_, k) => corners.reduce((s, corner) => s + corner.u[k], 0) / corners.length)
  }

  /** A friction, in hundredths, at which S under the present loads is not empty; null if none up to `most` is. */
  enough(most) {
    const trial = new Body(this.scene)
    trial.load = this.load
    trial.reload()
    if (!this.whole || trial.cut(most).empty) return null
    let [low, high] = [this.mu, most]
    while (high - low > 1e-3) { const mu = (low + high) / 2; if (trial.cut(mu).empty) low = mu; else high = mu }
    const mu = Math.ceil(100 * high) / 100
    return trial.cut(mu).empty ? null : mu
  }

  /** Outward direction along the sides that meet in a distant corner, to rounding; null if there is none. */
  along(u, total) {
    const { h } = this, met = this.rows.filter((row) => Math.abs(dot(row.slope, u) + row.rest) < 1e-7 * (1 + Math.hypot(...u)))
    let ray = h === 1 ? [1] : null
    if (h === 2 && met.length) ray = [-met[0].slope[1], met[0].slope[0]]
    for (const other of h === 3 ? met.slice(1) : []) ray ??= independent(cross(met[0].slope, other.slope))
    return ray && ray.map((v) => (v * Math.sign(dot(ray, total))) / Math.hypot(...ray))
  }

  /** Whether this self-balanced change of forces leaves no cone: a proof that S is unbounded. */
  isRay(ray) {
    return this.rows.every((row) => dot(row.slope, ray) > -1e-11)
  }

  scaleOf() {
    return Math.max(1e-6, ...this.b.map(Math.abs))
  }

  /** Σ f_n as slope and rest. */
  sum() {
    const of = (force) => { let s = 0; for (let c = 0; c < this.count; c++) s += force[2 * c]; return s }
    return { slope: this.axes.map(of), rest: of(this.origin) }
  }

  sumAt(u) { const { slope, rest } = this.sum(); return dot(slope, u) + rest }

  /** Points where h sides meet and no constraint is violated, {u, cap}. */
  meetings(rows) {
    const { h } = this, points = []
    const add = (picked) => {
      const u = h ? solve(picked.map((row) => row.slope), picked.map((row) => -row.rest)) : []
      if (!u) return
      const size = 1 + Math.hypot(...u)
      if (rows.some((row) => dot(row.slope, u) + row.rest < -SMALL * size)) return
      if (points.some((other) => Math.hypot(...other.u.map((v, k) => v - u[k])) < 1e-7 * size)) return
      points.push({ u, cap: rows.some((row) => row.cap && Math.abs(dot(row.slope, u) + row.rest) < 1e-7 * size) })
    }
    const pick = (from, picked) => {
      if (picked.length === h) return add(picked)
      for (let k = from; k < rows.length; k++) pick(k + 1, [...picked, rows[k]])
    }
    if (h === 3) this.edges(rows, (picked) => add(picked.map((k) => rows[k])))
    else pick(0, [])
    return points
  }

  /** met([row, row, row]) at both ends of the part inside all other sides of the line in which two sides meet. */
  edges(rows, met) {
    for (let i = 0; i < rows.length; i++) for (let j = i + 1; j < rows.length; j++) {
      const [one, other] = [rows[i], rows[j]], along = cross(one.slope, other.slope), size = dot(along, along)
      if (size < 1e-12) continue
      const [a, b] = [cross(other.slope, along), cross(along, one.slope)]
      const from = a.map((v, k) => -(one.rest * v + other.rest * b[k]) / size), long = Math.sqrt(size)
      let [low, high, first, last, outside] = [-Infinity, Infinity, -1, -1, false]
      for (let k = 0; k < rows.length && !outside; k++) {
        if (k === i || k === j) continue
        const { slope, rest } = rows[k], lean = dot(slope, along) / long, room = dot(slope, from) + rest
        if (Math.abs(lean) < SMALL) outside = room < -1e-7 * (1 + Math.hypot(...from))
        else if (lean > 0 && -room / lean > low) { low = -room / lean; first = k }
        else if (lean < 0 && -room / lean < high) { high = -room / lean; last = k }
      }
      if (outside || low > high + 1e-7 * (1 + Math.abs(low))) continue
      if (first >= 0) met([i, j, first])
      if (last >= 0) met([i, j, last])
    }
  }

  /** Sides: {corners in order, stops: [[contact, what], …], cap}; coinciding sides are joined. */
  faces(rows) {
    const { h } = this, byCorners = new Map()
    for (const row of rows) {
      const on = []
      this.corners.forEach(({ u }, k) => {
        if (Math.abs(dot(row.slope, u) + row.rest) < 1e-7 * (1 + Math.hypot(...u))) on.push(k)
      })
      if (on.length < Math.max(1, h) || !h) continue
      const key = on.join(), side = byCorners.get(key) ?? { corners: on, stops: new Map(), slope: row.slope, rest: row.rest }
      if (row.cap) side.cap = true
      else if (side.stops.has(row.contact) && side.stops.get(row.contact) !== row.what) side.stops.set(row.contact, OPENS)
      else side.stops.set(row.contact, row.what)
      byCorners.set(key, side)
    }
    const sides = [...byCorners.values()].map((side) => ({ ...side, stops: [...side.stops] }))
    for (const side of sides) if (h === 3) side.corners = this.around(side)
    return sides
  }

  around({ corners, slope }) {
    const middle = [0, 1, 2].map((k) => corners.reduce((s, c) => s + this.corners[c].u[k], 0) / corners.length)
    const least = slope.map(Math.abs).indexOf(Math.min(...slope.map(Math.abs)))
    const unit = [0, 1, 2].map((k) => (k === least ? 1 : 0)), across = cross(slope, unit), other = cross(slope, across)
    const angle = (c) => {
      const d = this.corners[c].u.map((v, k) => v - middle[k])
      return Math.atan2(dot(d, other) / Math.hypot(...other), dot(d, across) / Math.hypot(...across))
    }
    return [...corners].sort((a, b) => angle(a) - angle(b))
  }

  /** Whether a contact with this force is at the friction limit. */
  slides(normal, tangential) {
    return this.mu > 0 && this.mu * normal - Math.abs(tangential) < 1e-6 * Math.max(1, normal)
  }

  /** Forces f_n, f_t of all contacts at u. */
  forces(u = this.u) {
    const F = Float64Array.from(this.origin)
    for (let k = 0; k < this.h; k++) for (let c = 0; c < F.length; c++) F[c] += u[k] * this.axes[k][c]
    return F
  }

  /** Least and largest value of a force (2 c for f_n, 2 c + 1 for f_t), if S is drawn whole. */
  interval(index) {
    const values = this.corners.map(({ u }) => dot(this.axes.map((axis) => axis[index]), u) + this.origin[index])
    const along = this.rays.map((ray) => dot(this.axes.map((axis) => axis[index]), ray))
    return [
      along.some((v) => v < -1e-10) ? -Infinity : Math.min(...values),
      along.some((v) => v > 1e-10) ? Infinity : Math.max(...values),
    ]
  }

  least(u) { return Math.min(Infinity, ...this.rows.map((row) => dot(row.slope, u) + row.rest)) }

  /** Whether there are so many disks that only the relevant wedges are drawn. */
  get crowded() { return this.scene.r.length > 8 }

  /** Go to a network inside S, locally as far from its sides as possible; returns whether there is one. */
  goInside() {
    for (const margin of [0.1, 0.03, 0.01, 1e-3, 0]) {
      const u = this.nearest(this.u, null, margin * this.scaleOf())
      if (this.least(u) >= -1e-6) { this.u = u; return true }
    }
    return false
  }

  /**
   * The network nearest to u, in the metric of H (given by its inverse; by default the identity): each side in
   * turn pushes by the required amount (Hildreth 1957).
   */
  nearest(target, inverse = null, margin = 0) {
    if (!this.h) return []
    const turned = this.rows.map((row) => (inverse ? inverse.map((line) => dot(line, row.slope)) : row.slope))
    const size = this.rows.map((row, k) => dot(row.slope, turned[k]))
    const push = new Float64Array(this.rows.length), u = [...target]
    for (let sweep = 0; sweep < 400; sweep++) {
      let most = 0
      this.rows.forEach((row, k) => {
        const step = Math.max(-push[k], -(dot(row.slope, u) + row.rest - margin) / size[k])
        if (!step) return
        push[k] += step
        for (let d = 0; d < this.h; d++) u[d] += step * turned[k][d]
        most = Math.max(most, Math.abs(step))
      })
      if (most < 1e-12) break
    }
    return u
  }

  /** Go to the network nearest to u; returns whether there is one. */
  goTo(u, inverse = null) {
    let found = this.least(u) >= 0 ? u : this.nearest(u, inverse)
    if (this.least(found) < -1e-7 && !this.empty) found = this.inwards(found, this.whole ? this.middle : this.u)
    if (this.least(found) < -1e-5 || this.empty) return false
    this.u = found
    return true
  }

  /** Correct rounding errors outside S, on the straight line to a position inside. */
  inwards(u, place) {
    let inside = 0
    for (const row of this.rows) {
      const here = dot(row.slope, u) + row.rest, there = dot(row.slope, place) + row.rest
      if (here < 0 && there > here) inside = Math.max(inside, Math.min(1, -here / (there - here)))
    }
    return u.map((v, k) => v + inside * (place[k] - v))
  }

  /** Forces (as in `interval`) that can change while these are held, at a point inside S. */
  loose(held) {
    const rows = held.map((force) => this.axes.map((axis) => axis[force]))
    const free = this.axes.map((_, k) => without(this.u.map((_, d) => Number(d === k)), rows))
    return [...this.origin.keys()].filter((index) => free.some((way) => Math.abs(dot(way, this.axes.map((axis) => axis[index]))) > SMALL))
  }

  /** Pull the force of a contact towards (f_n, f_t), changing all others as little as possible. */
  pull(contact, normal, tangential) {
    const B = [2 * contact, 2 * contact + 1].map((index) => this.axes.map((axis) => axis[index]))
    const now = this.forces(), miss = [normal - now[2 * contact], tangential - now[2 * contact + 1]]
    const H = this.u.map((_, a) => this.u.map((_, b) => B[0][a] * B[0][b] + B[1][a] * B[1][b] + (a === b ? 1e-3 : 0)))
    const inverse = H.map((_, k) => solve(H, H.map((_, l) => (l === k ? 1 : 0))))
    if (inverse.some((column) => !column)) return false
    const gain = this.u.map((_, a) => B[0][a] * miss[0] + B[1][a] * miss[1])
    return this.goTo(this.u.map((v, k) => v + dot(inverse[k], gain)), inverse)
  }

  /** Move towards a network with these values of these forces, changing all others as little as possible. */
  steer(forces, values) {
    const rows = forces.map((force) => this.axes.map((axis) => axis[force]))
    const square = rows.map((a) => rows.map((b) => dot(a, b)))
    for (let round = 0; round < STEERED; round++) {
      const now = this.forces(), miss = forces.map((force, k) => values[k] - now[force])
      if (Math.max(...miss.map(Math.abs)) < 1e-9 * this.scaleOf()) return
      const part = solve(square, miss) ?? miss.map((v, k) => (k ? 0 : v / square[0][0]))
      this.goTo(this.u.map((v, d) => v + part.reduce((sum, p, k) => sum + p * rows[k][d], 0)))
    }
  }

  /** Go to the corner where a force is least (sign −1) or largest (1), or, on a side of such corners, as near as possible. */
  goToEnd(index, sign) {
    const end = this.interval(index)[sign > 0 ? 1 : 0], corners = this.corners.filter(({ u }) => Math.abs(this.forces(u)[index] - end) < 1e-9 * this.scaleOf())
    if (corners.length === 1) this.u = [...corners[0].u]
    else this.steer([index], [end + sign * this.scaleOf()])
  }

  /** A uniform draw by hit-and-run from u: a point of a random chord, along which these forces do not change. */
  step(u, random = Math.random, held = []) {
    const any = u.map(() => Math.sqrt(-2 * Math.log(1 - random())) * Math.cos(2 * Math.PI * random()))
    const direction = without(any, held.map((force) => this.axes.map((axis) => axis[force])))
    let low = -Infinity, high = Infinity
    for (const row of this.whole ? this.drawn : this.rows) { // if unbounded, up to the added bounds
      const slope = dot(row.slope, direction), room = dot(row.slope, u) + row.rest
      if (slope > 1e-12) low = Math.max(low, -Math.max(room, 0) / slope)
      if (slope < -1e-12) high = Math.min(high, -Math.max(room, 0) / slope)
    }
    if (!Number.isFinite(low) || !Number.isFinite(high)) return u
    const at = low + random() * (high - low)
    return u.map((v, k) => v + at * direction[k])
  }
}

/** The part of a vector that is perpendicular to independent rows. */
function without(vector, rows) {
  const parts = solve(rows.map((a) => rows.map((b) => dot(a, b))), rows.map((row) => dot(row, vector)))
  return vector.map((v, d) => v - rows.reduce((sum, row, k) => sum + parts[k] * row[d], 0))
}

const independent = (v) => (Math.hypot(...v) > 1e-6 ? v : null)
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
