// The first gesture, pointed out: one strong line near the middle of the packing says that it can be dragged,
// until one was; or clicked, where a contact is to be chosen.

const NEAR = 0.45 // of half the view, from its middle
const DRAG = matchMedia("(pointer: coarse)").matches ? "↙ tap, then drag" : "↙ drag me: how strong can I get?", CHOOSE = "↙ click me"

export class Invitation {
  constructor(scene) {
    this.scene = scene
    this.of = this.row = null // the packing, and the line that was chosen in it
    this.tag = scene.root.appendChild(document.createElement("div"))
    Object.assign(this.tag, { className: "invite", hidden: true })
  }

  /** Beside the line; nowhere where there is no hand for it. */
  place(mixed, wanted, pushes) {
    const { scene, tag } = this, { geometry, view } = scene
    if (!wanted) return void (tag.hidden = true)
    if (this.of !== geometry) Object.assign(this, { of: geometry, row: this.strongest(mixed.normal) })
    if (this.row === null) return void (tag.hidden = true)
    const [xa, ya, xb, yb] = scene.ends(this.row), x = (xa + xb) / 2, y = (ya + yb) / 2, [px, py] = scene.toPixel(x, y)
    tag.hidden = Math.max(Math.abs(x - view.x), Math.abs(y - view.y)) > 0.9 * view.half
    tag.textContent = pushes ? CHOOSE : DRAG
    tag.style.transform = `translate(${px}px, ${py}px) translateY(-100%)`
  }

  strongest(normal) {
    const { geometry: { contact }, view } = this.scene
    let best = null
    for (const { k, middle: [x, y] } of this.scene.segments(() => true)) {
      if (Math.max(Math.abs(x - view.x), Math.abs(y - view.y)) > NEAR * view.half) continue
      if (best === null || normal[contact[k]] > normal[contact[best]]) best = k
    }
    return best
  }
}
