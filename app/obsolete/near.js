// Who is new sees at first a few disks, around what is to be dragged, and forces without colour. When the
// hand lets go, the view goes out to the whole packing, where colours show what has changed, and where.

import { made } from "../browser/dom.js"

const INSET = 92 // px, of the whole packing in a corner
const AROUND = 6.5 // half width of what is seen, in largest radii
const MARGIN = 3 // around two lines that are seen at once, in largest radii

export class Near {
  constructor(player) {
    this.player = player
    this.inset = player.scene.root.appendChild(made("canvas", { className: "inset", hidden: true }))
    player.later.listeners.push(() => {
      if (!player.replay) return
      player.look.quiet = false
      this.go(player.scene.whole)
      player.again()
    })
  }

  /** The view that a newcomer begins with, or null. */
  get view() {
    const { player: { scene, later, replay, invite, points } } = this
    if (!later.waits || !(replay?.walk.inviting >= 0)) return null
    const places = points && scene.pair.length ? scene.pair.map((contact) => scene.geometry.contact.indexOf(contact)) : [invite.row]
    const ends = places.map((k) => scene.ends(k)), { whole } = scene
    const [x, y] = [0, 1].map((d) => ends.flatMap((end) => [end[d], end[d + 2]]))
    const [left, right, low, high] = [Math.min(...x), Math.max(...x), Math.min(...y), Math.max(...y)]
    const unit = Math.max(...scene.geometry.radius)
    const half = Math.max(AROUND * unit, Math.max(right - left, high - low) / 2 + MARGIN * unit)
    if (half > whole.half) return whole
    const within = (from, to, middle) => Math.max(middle + half - whole.half, Math.min(middle - half + whole.half, (from + to) / 2))
    return { x: within(left, right, whole.x), y: within(low, high, whole.y), half }
  }

  /** Another view, where another tab asks for another line. */
  show() {
    const { view, player: { live } } = this
    if (view && !live.moves) this.go(view)
  }

  go(view) {
    const { scene, live } = this.player, from = scene.view
    if (!from || live.moves) return
    scene.view = view
    scene.changed()
    live.glide(from)
  }

  /** In a corner the whole packing, with the part of it that is seen. */
  draw() {
    const { inset, player: { scene, later, live } } = this, { view, whole, geometry, palette } = scene
    inset.hidden = !later.waits || live.moves || view.half > 0.9 * whole.half
    if (inset.hidden) return
    const ratio = window.devicePixelRatio || 1, size = INSET * ratio, unit = size / (2 * whole.half), g = inset.getContext("2d")
    inset.width = inset.height = size
    g.setTransform(unit, 0, 0, -unit, size / 2 - unit * whole.x, size / 2 + unit * whole.y)
    g.fillStyle = palette.edge
    g.beginPath()
    for (let k = 0; k < geometry.x.length; k++) {
      const r = 0.8 * geometry.r[k]
      g.moveTo(geometry.x[k] + r, geometry.y[k])
      g.arc(geometry.x[k], geometry.y[k], r, 0, 2 * Math.PI)
    }
    g.fill()
    g.strokeStyle = palette.selected
    g.lineWidth = (2 * ratio) / unit
    g.strokeRect(view.x - view.half, view.y - view.half, 2 * view.half, 2 * view.half)
  }
}
