// Playing: the replay advances with every painted frame, and a pause comes to rest at a network.

import { CATCH_UP } from "./live.js"
import { STILL } from "../../browser/motion.js"

const PLOTS_MS = 30 // shortest time between two repaints of the plots while playing,
const PLOTS_FRAMES = 1.5 // also in frames, for slow frames,
const PLOTS_CONTACT_MS = 0.05 // and for each contact, as plots of many take longer than the packing
const REST_MS = 400 // duration of a whole step when a pause moves to the nearest network

export class Playback {
  /**
   * stage: the object that plays: `replay` or null, `grows` (whether more networks are expected), `speed` (rows
   * per second), `shown` (whether it is on the page), paint(), paintPlots(now), show(position), and
   * changed(running), called at the start and the end.
   */
  constructor(stage) {
    this.stage = stage
    this.running = false
    this.resting = null // target of a pause, while it is being approached
    this.newest = false // whether it stays close behind the newest network of a walk in progress
    this.painted = 0 // time at which plots were painted
  }

  /** Begin or end. */
  run(on) {
    const { stage } = this, { replay } = stage
    this.running = on && replay !== null && replay.walk.free !== 0 // a single network has nothing to play
    this.resting = null
    if (replay && !this.running) this.settle(replay)
    stage.changed(this.running)
    if (!this.running) return
    if (replay.atEnd) stage.show(0)
    this.before = performance.now()
    requestAnimationFrame((now) => this.tick(now))
  }

  /** Rest at a named network, the nearest one. */
  settle(replay) {
    if (replay.held || !(replay.position % 1)) return
    replay.go(Math.round(replay.position))
    this.stage.paint()
  }

  /** Stop playing at the nearest network after a transition; returns whether it is still under way. */
  pause() {
    const { replay } = this.stage
    if (replay.held || STILL.matches) { this.run(false); return false }
    this.resting = Math.round(replay.position)
    return true
  }

  /** One step towards the resting position; returns whether it is reached. */
  rest(replay, took) {
    const way = this.resting - replay.position, step = (took / REST_MS) * Math.sign(way)
    if (Math.abs(way) <= Math.abs(step)) { this.run(false); return true }
    replay.go(replay.position + step)
    return false
  }

  /** Rows to advance in a time, s. */
  steps(replay, took) {
    const behind = this.newest ? (replay.last - replay.position) / CATCH_UP : 0
    return took * Math.max(this.stage.speed, behind)
  }

  tick(now) {
    const { stage } = this, { replay } = stage
    if (!this.running || !stage.shown) return
    const elapsed = Math.max(0, now - this.before), again = () => requestAnimationFrame((next) => this.tick(next))
    this.before = now
    if (this.resting !== null) {
      if (this.rest(replay, elapsed)) return
      stage.paint()
      return void again()
    }
    if (stage.grows && replay.atEnd) return void again()
    replay.go(replay.position + this.steps(replay, elapsed / 1000))
    stage.paint()
    const wait = Math.max(PLOTS_MS, PLOTS_FRAMES * elapsed, PLOTS_CONTACT_MS * replay.walk.contacts)
    if (now - this.painted > wait) stage.paintPlots(now)
    if (!replay.atEnd || stage.grows) return void again()
    this.run(false)
    stage.show(replay.last)
  }
}
