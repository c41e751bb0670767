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
  reach: ["", "<b>Your turn: can you bring the green force above {}?</b> Drag the red dot, and watch all lines."],
  click: ["", "<b>Your turn: at which friction are forces freest?</b> Click a point of the curve to see such a packing."],
}

export class Invitation {
  constructor(player) {
    const { root } = player.scene
    this.player = player
    this.of = this.row = null // the packing, and the line that was chosen in it
    this.tag = root.appendChild(made("div", { className: "invite", hidden: true }))
    this.turn = root.appendChild(made("div", { className: "turn", hidden: true }))
  }

  /** What can be done first, one of WORDS: nothing was dragged yet, and a line can be, or the point; or null. */
  get what() {
    const { model, replay, live, difference, predict, points, plots, pushes, took, scene } = this.player
    if (replay === null || !scene.hand || live.moves || difference.on || predict.shown || !replay.walk.free) return null
    if (points && !plots.invites) return null
    if (points) return this.target ? "reach" : "point"
    if ((model.contact ?? null) !== null) return null
    if (pushes) return model.pushing === "one" ? "choose" : null
    if (took) return null
    if (model.tab !== "statistics") return "drag"
    return model.figure === "eta" ? "click" : null
  }

  /** Near the largest force that the green line can have; 0 where it is there, and in other planes. */
  get target() {
    const { plots, replay } = this.player, [green] = plots.plane.pair ?? []
    if (green === undefined) return 0
    const most = (plots.find("outer")?.get_column("x") ?? []).reduce((one, other) => Math.max(one, other), 0)
    const near = Math.floor(9.8 * most) / 10
    return near > replay.mixed.normal[green] ? near : 0
  }

  /** Say what can be done, beside its line and above the packing. */
  place() {
    const { turn, tag, what } = this, at = what && WORDS[what][0] ? this.middle() : null
    turn.hidden = !what || Boolean(WORDS[what][0] && !at)
    tag.hidden = !at
    if (at) tag.style.transform = `translate(${at[0]}px, ${at[1]}px) translateY(-100%)`
    if (!what) return
    const [short, long] = WORDS[what], words = long.replace("{}", what === "reach" ? this.target : "")
    if (this.words !== words) [tag.textContent, turn.innerHTML] = [short, words]
    this.words = words
  }

  /** Where the line is, in pixels; null where it is out of view. */
  middle() {
    const { scene, replay } = this.player, { geometry, view } = scene
    if (this.of !== geometry) Object.assign(this, { of: geometry, row: this.strongest(replay.mixed.normal) })
    if (this.row === null) return null
    const [xa, ya, xb, yb] = scene.ends(this.row), x = (xa + xb) / 2, y = (ya + yb) / 2
    return Math.max(Math.abs(x - view.x), Math.abs(y - view.y)) > 0.9 * view.half ? null : scene.toPixel(x, y)
  }

  strongest(normal) {
    const { scene } = this.player, { geometry: { contact }, view } = scene
    let best = null
    for (const { k, middle: [x, y] } of scene.segments(() => true)) {
      if (Math.max(Math.abs(x - view.x), Math.abs(y - view.y)) > NEAR * view.half) continue
      if (best === null || normal[contact[k]] > normal[contact[best]]) best = k
    }
    return best
  }
}
