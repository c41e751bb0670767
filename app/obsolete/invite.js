// The first gesture, pointed out: one strong line near the middle of the packing says that it can be dragged,
// until one was; or a contact is the one that is spoken of. What there is to find out stands above, also of
// the point in force space, which has a tag of its own (layer.js).

import { made } from "../browser/dom.js"

const FINGER = matchMedia("(pointer: coarse)").matches
const DRAG = FINGER ? "tap, then drag ↕" : "drag me ↕", THEN = FINGER ? "then tap and drag ↕" : "then drag me ↕"
// What the tag says, if there is one, and what stands above.
const WORDS = {
  watch: ["", "<b>Watch: the forces change, no disk moves.</b> At every moment all disks are in balance."],
  drag: [DRAG, "<b>Your turn: can you make this force larger than {goal}?</b> Press on the marked line and drag upwards: no disk moves, all forces follow (now {now})."],
  strong: [THEN, "<b>Your turn: how strong can you make this force?</b> Guess in the plot; then drag the marked line up, or the red dot (now {now})."],
  free: [DRAG, "<b>Your turn: how strong can you make this force?</b> Press on the marked line and drag upwards: no disk moves, all forces follow (now {now})."],
  push: ["", "<b>Your turn: how hard can these two disks be pushed apart?</b> Guess on the scale, then drag the slider."],
  point: ["", "<b>Your turn: how far out can you take the red dot?</b> Drag it in the plot, and watch the lines."],
  first: ["", "<b>Your turn: is {seen} a law, or luck?</b> Guess in the plot how far right the red dot can go; then drag it."],
  reach: ["", "<b>Your turn: no dot lies beyond {seen}. Can you bring the green force above {goal}?</b> Drag the red dot."],
  guess: ["this contact", "<b>Your turn: how does friction change how much a force varies?</b> Choose on the right."],
  click: ["", "<b>Your turn: at which friction do forces vary most?</b> Click a point of the curve to see such a packing."],
}

export class Invitation {
  constructor(player) {
    const { root } = player.scene
    this.player = player
    this.tag = root.appendChild(made("div", { className: "invite", hidden: true }))
    this.turn = root.appendChild(made("div", { className: "turn", hidden: true }))
  }

  /** What can be done first, one of WORDS: nothing was dragged yet, and a line can be, or the point; or null. */
  get what() {
    const { model, replay, live, difference, predict, points, plots, pushes, pushed, took, scene, opens } = this.player
    if (replay === null || !scene.hand || live.moves || difference.on || predict.shown || !replay.walk.free) return null
    if (opens) return "watch"
    if (this.guesses) return "guess"
    if (points && !plots.invites) return null
    if (points && model.fresh && plots.plane.pair?.length) return "first"
    if (points) return this.target ? "reach" : "point"
    if (pushes) return model.pushing === "one" && !pushed.load ? "push" : null
    if ((model.contact ?? null) !== null) return null
    if (took) return null
    if (model.tab !== "statistics") return model.fresh ? "strong" : model.goal ? "drag" : "free"
    if (model.figure !== "eta") return null
    return "click"
  }

  /** Whether the curve over friction is to be guessed. */
  get guesses() {
    const { tab, figure, guess } = this.player.model
    return tab === "statistics" && figure === "eta" && guess
  }

  /** The row of links that is pointed out: of a contact as it varies typically, or of that to be dragged. */
  get row() {
    const { walk } = this.player.replay
    return this.guesses ? walk.contact.indexOf(walk.typical) : walk.inviting
  }

  /** How strong the force is that can be dragged, in mean forces. */
  get now() { return this.player.replay.mixed.normal[this.contact]?.toFixed(1) }

  /** The contact whose line is pointed out. */
  get contact() { return this.player.scene.geometry.contact[this.row] }

  /** What the green force is to reach; 0 where it is there, and in other planes. */
  get target() {
    const { plots: { plane }, replay } = this.player, [green] = plane.pair ?? []
    return green !== undefined && plane.goal > replay.mixed.normal[green] ? plane.goal : 0
  }

  /** Say what can be done, beside its line and above the packing. */
  place() {
    const { turn, tag, what, player: { scene, model, plots } } = this, at = what && WORDS[what][0] ? this.middle() : null
    turn.hidden = !what || Boolean(WORDS[what][0] && !at)
    tag.hidden = !at
    if (at) scene.highlight(this.contact, scene.palette.selected)
    if (at) tag.style.transform = `translate(${at[0]}px, ${at[1]}px) translateY(-100%)`
    if (!what) return
    const [short, long] = WORDS[what], goal = what === "reach" ? this.target : model.goal
    const words = long.replace("{goal}", goal).replace("{now}", this.now).replace("{seen}", plots.plane.seen)
    if (this.words !== words) [tag.textContent, turn.innerHTML] = [short, words]
    this.words = words
  }

  /** Where the line is, in pixels; null where it is out of view. */
  middle() {
    const { row, player: { scene } } = this, { view } = scene
    if (!(row >= 0)) return null
    const [xa, ya, xb, yb] = scene.ends(row), x = (xa + xb) / 2, y = (ya + yb) / 2
    return Math.max(Math.abs(x - view.x), Math.abs(y - view.y)) > 0.9 * view.half ? null : scene.toPixel(x, y)
  }
}
