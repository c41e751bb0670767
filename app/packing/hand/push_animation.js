// A push on the two disks of a contact: arrows that grow with the load, and the network,
// interpolated between networks from the server. Between two of them the straight line balances the
// load in between (S under all loads is convex too). At the last of them, disks start to move.

import { networkAt } from "../replay/replay.js"

export class Pushed {
  constructor(player) {
    this.player = player
    this.end()
  }

  /** Stop pushing: the network of before is shown again, without its pulls. */
  end() {
    this.load = this.part = 0
    this.moves = false // whether disks start to move
    const { player } = this, held = this.held
    this.held = null
    player.sway?.take(null)
    if (!held || player.replay?.held !== held) return
    player.hand.forget()
    player.show(player.model.frame, false)
  }

  /** Stop pushing; pulls are shown again. */
  leave() {
    const pushed = this.held
    this.end()
    if (pushed) this.player.hand.tell({ anew: true })
  }

  /** path: networks under loads up to the largest one with equilibrium; part: fraction of the longest arrow. */
  take(path, load, part) {
    const { player } = this, { replay, scene } = player
    if (!player.pushable || player.live.moves || player.grows) return
    if (load > 0 && player.playing) player.play(false)
    Object.assign(this, { load, part, moves: load > 0 && load >= (path.values?.at(-1) ?? Infinity) })
    this.tellMotion()
    if (!(load > 0 && path.values?.length) || path.normal.length !== path.values.length * replay.walk.contacts) {
      if (this.held) this.leave()
      return scene.style && scene.drawMarks()
    }
    if (!this.held) player.say("") // about a pull
    if (replay.position) player.show(0, false) // meanwhile, for the server, the network of before is on screen
    player.look.before = replay.walk.normal.subarray(0, replay.walk.contacts)
    player.hand.show((this.held = { ...networkAt(path, load), place: "pushed" }))
  }

  /** Disks move only under a sufficient push. */
  tellMotion() { this.player.sway.take(this.moves ? this.player.model.displacement : null) }
}
