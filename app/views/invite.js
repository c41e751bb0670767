// The first gesture, pointed out: one strong line near the middle of the packing says that it can be dragged,
// until one was; or clicked, where a contact is to be chosen. What there is to find out stands above,
// also of the point in force space, which has a tag of its own (layer.js).

import { made } from "./made.js"

const NEAR = 0.45 // of half the view, from its middle
const FINGER = matchMedia("(pointer: coarse)").matches
// What the tag says, if there is one, and what stands above.
const WORDS = {
  drag: [FINGER ? "↙ tap, then drag" : "↙ drag me", "<b>Your turn: how strong can you make this force?</b> Drag the line: playing pauses."],
  choose: ["↙ click me", "<b>Your turn: how hard can two disks be pushed apart?</b> Click a line, guess, then push."],
  point: ["", "<b>Your turn: how far out can you take the red dot?</b> Drag it in force space, and watch the lines."],
  click: ["", "<b>Your turn: at which friction are forces freest?</b> Click a point of the curve to see such a packing."],
}

export class Invitation {
  constructor(scene) {
    this.scene = scene
    this.of = this.row = null // the packing, and the line that was chosen in it
    this.tag = scene.root.appendChild(made("div", { className: "invite", hidden: true }))
    this.turn = scene.root.appendChild(made("div", { className: "turn", hidden: true }))
  }

  /** what: one of WORDS; null where there is no hand for it. */
  place(mixed, what) {
    const { turn, tag } = this, at = what ? this.middle(mixed) : null
    turn.hidden = at === null
    tag.hidden = at === null || !WORDS[what][0]
    if (at === null) return
    tag.style.transform = `translate(${at[0]}px, ${at[1]}px) translateY(-100%)`
    if (this.what !== what) [tag.textContent, turn.innerHTML] = WORDS[what]
    this.what = what
  }

  /** Where the line is, in pixels; null where it is out of view. */
  middle(mixed) {
    const { scene } = this, { geometry, view } = scene
    if (this.of !== geometry) Object.assign(this, { of: geometry, row: this.strongest(mixed.normal) })
    if (this.row === null) return null
    const [xa, ya, xb, yb] = scene.ends(this.row), x = (xa + xb) / 2, y = (ya + yb) / 2
    return Math.max(Math.abs(x - view.x), Math.abs(y - view.y)) > 0.9 * view.half ? null : scene.toPixel(x, y)
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
