// Playing: the replay advances from painted frame to painted frame, and a pause comes to rest at a network.

import { CATCH_UP } from "./live.js"

const PLOTS_MS = 30 // the plots beside are repainted no more often than this while playing,
const PLOTS_FRAMES = 1.5 // nor than every so many frames, where frames take long
const CROSSING = 20 // times as long as a step takes the way between two states, to be followed by eye,
const LONGEST_S = 6 // but no longer than this
const REST_MS = 400 // that a whole step takes where a pause goes to the nearest network
const STILL = matchMedia("(prefers-reduced-motion: reduce)")

export class Playback {
  /**
   * stage: what is played on: `replay` or null, `grows` (whether more networks are to come), `speed` (rows a
   * second), `shown` (whether it is on the page), paint(), paintPlots(now), show(position), and
   * changed(running), called as it begins and ends.
   */
  constructor(stage) {
    this.stage = stage
    this.running = false
    this.resting = null // where a pause comes to rest, while it is on its way
    this.newest = false // whether it stays close behind the newest network of a walk under way
    this.turns = 0 // how often it has turned back, going to and fro
    this.painted = 0 // when plots were
  }

  /** Begin or end. */
  run(on) {
    const { stage } = this, { replay } = stage
    this.running = on && replay !== null
    this.resting = null
    if (replay && !this.running) this.settle(replay)
    stage.changed(this.running)
    if (!this.running) return
    if (replay.atEnd && !replay.swinging) stage.show(0)
    this.direction = 1
    this.turns = 0
    this.before = performance.now()
    requestAnimationFrame((now) => this.tick(now))
  }

  /** End without a word: another replay takes the place of this one. */
  halt() { this.running = false }

  /** What rests is a network that has a name: the nearest one, but between two that are compared. */
  settle(replay) {
    if (replay.held || replay.swinging || !(replay.position % 1)) return
    replay.go(Math.round(replay.position))
    this.stage.paint()
  }

  /** Playing ends at the nearest network, to which it goes over; whether it is on its way there. */
  pause() {
    const { replay } = this.stage
    if (replay.held || replay.swinging || STILL.matches) { this.run(false); return false }
    this.resting = Math.round(replay.position)
    return true
  }

  /** Go on after all. */
  resume() { this.resting = null }

  /** One step of the way to where it comes to rest; whether it is there. */
  rest(replay, took) {
    const way = this.resting - replay.position, step = (took / REST_MS) * Math.sign(way)
    if (Math.abs(way) <= Math.abs(step)) { this.run(false); return true }
    replay.go(replay.position + step)
    return false
  }

  /** Rows to go on in a time, s. */
  steps(replay, took) {
    const behind = this.newest ? (replay.last - replay.position) / CATCH_UP : 0
    const speed = Math.max(this.stage.speed, behind)
    return took * (replay.swinging ? Math.max(speed / CROSSING, 1 / LONGEST_S) : speed)
  }

  tick(now) {
    const { stage } = this, { replay } = stage
    if (!this.running || !stage.shown) return
    const took = Math.max(0, now - this.before), again = () => requestAnimationFrame((next) => this.tick(next))
    this.before = now
    if (this.resting !== null) {
      if (this.rest(replay, took)) return
      stage.paint()
      return void again()
    }
    if (stage.grows && replay.atEnd && !replay.swinging) return void again()
    replay.go(replay.position + this.direction * this.steps(replay, took / 1000))
    if (replay.swinging && (replay.atEnd || replay.position <= 0)) this.turn(replay.atEnd ? -1 : 1)
    stage.paint()
    if (now - this.painted > Math.max(PLOTS_MS, PLOTS_FRAMES * took)) stage.paintPlots(now)
    if (replay.swinging || !replay.atEnd || stage.grows) return void again()
    this.run(false)
    stage.show(replay.last)
  }

  turn(direction) {
    if (direction !== this.direction) this.turns++
    this.direction = direction
  }
}
