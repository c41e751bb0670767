// A push on the two disks of a contact: arrows that grow with the load, and the network,
// interpolated between networks from the server. Between two of them the straight line balances the
// load in between (S under all loads is convex too). At the last of them, disks start to move.

import { FORCES } from "../replay/live.js"
import { networkAt } from "../replay/replay.js"
import { plain } from "../../browser/send.js"

export class Pushed {
  constructor(player) {
    this.player = player
    this.end()
  }

  /** Another network is on screen. */
  end() {
    this.load = this.part = 0
    this.moves = false // whether disks start to move
    this.held = null // the pushed network, while it is on screen
    this.player.sway?.take(null)
  }

  /** Show the network as packed, with which every push begins. */
  begin() { if (this.possible && !this.held) this.show() }

  /** Stop pushing: the network of before is shown again, with its pulls. */
  leave() {
    const { held, player } = this
    this.end()
    if (held && player.replay?.held === held) player.hand.restore()
  }

  get possible() {
    const { player } = this
    return player.pushable && !player.live.moves && !player.grows
  }

  /** path: networks under loads up to the largest one with equilibrium; part: fraction of the longest arrow. */
  take(path, load, part, limit) {
    const { player } = this, known = path.values?.length > 0 && path.normal.length === path.values.length * player.replay?.walk.contacts
    if (!this.possible) return
    Object.assign(this, { load, part, moves: load > 0 && load >= (path.values?.at(-1) ?? Infinity) })
    this.words = `push ${load.toFixed(2)} ⟨fₙ⟩`
    if (known && limit !== null) this.words += `, F_crit ${path.values.at(-1).toFixed(2)} ⟨fₙ⟩, limit load ${limit.toFixed(2)} ⟨fₙ⟩`
    this.tellMotion()
    if (load > 0 && known) this.show({ ...networkAt(path, load), place: "pushed" })
    else if (load > 0 || this.held) this.show()
    else if (player.scene.style) player.scene.drawMarks()
  }

  /** Show a network, by default the one as packed; for the server, the network of before is still on screen. */
  show(network = this.packed) {
    const { player } = this, { replay } = player
    if (player.playing) player.play(false)
    if (!this.held) player.say("") // about a pull
    replay.held = this.held = network
    if (replay.position) player.show(0, false)
    player.look.before = this.packed.normal
    player.hand.show(network)
  }

  get packed() {
    const { walk } = this.player.replay // whose arrays are Bokeh's, which have no subarrays
    const [normal, tangential] = FORCES.map((name) => walk[name].slice(0, walk.contacts))
    return { normal, tangential, residual: walk.residual[0], place: walk.origin }
  }

  /** The first motion; null before the push suffices. */
  get motion() {
    const motion = this.moves ? plain(this.player.model.motion ?? {}) : {}
    return motion.field ? motion : null
  }

  /** Show the first motion as a still, or animated. */
  tellMotion() {
    const { player: { scene, sway }, motion } = this
    sway.take(motion?.animated ? motion.field : null)
    if (scene.style) scene.drawMarks()
  }
}
