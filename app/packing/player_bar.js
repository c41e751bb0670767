// The bar of the player: steps, play, the slider, the number of the network, and their total.

import { button, createElement } from "../browser/dom.js"

const ICONS = { back: "M18 5v14L8 12z", play: "M7 4v16l13-8z", pause: "M6 5h4v14H6zM14 5h4v14h-4z", step: "M6 5v14l10-7z" }
const OUTSIDE = ({ states, origin }) => `Networks have the numbers 1 to ${states}; 0 is the network ${origin}.`

const icon = (name) => `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${ICONS[name]}"/></svg>`

function iconButton(name, title, act) {
  const element = button("", act, { className: name, title })
  element.innerHTML = icon(name)
  element.setAttribute("aria-label", title)
  return element
}

export class PlayerBar {
  /**
   * actions: back(), play(), step(), scrub(position), and keep(number): store all networks, then show this one.
   * say(words): show a line.
   */
  constructor(actions, say) {
    this.actions = actions
    this.say = say
    this.scrub = createElement("input", { className: "scrub", type: "range", min: 0, value: 0, step: 1, ariaLabel: "network" })
    this.number = createElement("input", { className: "number", inputMode: "numeric", autocomplete: "off", ariaLabel: "number of the network" })
    this.place = createElement("span", { className: "state" })
    this.speedInput = createElement("input", { className: "speed", type: "range", min: 0, max: 6, step: 0.25, value: 0, ariaLabel: "speed" })
    this.rate = createElement("span", { className: "rate" })
    this.stored = createElement("span", { className: "stored", role: "status" })
    this.keep = button("Keep all", () => actions.keep(this.replay.walk.number[this.replay.frame]), { className: "keep", title: "compute and store every network" })
    this.playButton = iconButton("play", "space", () => actions.play())
    const along = createElement("label", { className: "at" }), speed = createElement("label", { title: "networks per second" })
    const more = createElement("span", { className: "more" })
    along.append("network ", this.number)
    speed.append(this.speedInput, this.rate)
    more.append(speed, this.stored, this.keep)
    this.root = createElement("div", { className: "bar empty" })
    this.root.append(
      createElement("span", { className: "only", textContent: "One network: balance determines every force." }),
      iconButton("back", "one network back (←)", () => actions.back()), this.playButton,
      iconButton("step", "one network on (→)", () => actions.step()), this.scrub, along, this.place, more,
    )
    this.scrub.addEventListener("input", () => actions.scrub(Number(this.scrub.value)))
    this.number.addEventListener("change", () => this.go())
    this.number.addEventListener("keydown", (event) => { if (event.key === "Enter") this.number.blur() })
    this.speedInput.addEventListener("input", () => this.showRate())
    this.showPlaying(false)
  }

  /** Rows per second. */
  get speed() { return 2 ** Number(this.speedInput.value) }

  /** Go to the network whose number was typed; if it is not stored, all are computed first, or the nearest one is shown. */
  go() {
    const requested = Number(this.number.value), { replay } = this
    if (!replay) return
    const { walk } = replay
    if (this.number.value.trim() === "" || !Number.isInteger(requested) || requested < 0 || requested > walk.states) {
      this.number.value = walk.number[replay.frame]
      return this.say(OUTSIDE(walk))
    }
    const position = replay.positionOf(requested), shown = walk.number[position]
    this.actions.scrub(position)
    if (shown === requested) return
    if (this.keepable) this.actions.keep(requested)
    this.say(`${requested} is not stored${this.keepable ? ": computing all networks" : `: showing ${shown}`}.`)
  }

  showPlaying(playing) {
    const word = playing ? "pause" : "play"
    this.playButton.innerHTML = `${icon(word)} ${playing ? "Pause" : "Play"}`
    this.playButton.setAttribute("aria-label", word)
  }

  /** The number of networks seen per second: the stored ones, and more where the player follows a walk. */
  showRate() {
    const { speed, replay } = this, shown = speed < 10 ? Number(speed.toFixed(1)) : Math.round(speed)
    const words = `${replay?.walk.room ? "≥ " : ""}${shown}${replay?.stride > 1 ? " stored" : ""} network${shown === 1 ? "" : "s"}/s`
    this.rate.textContent = words
  }

  /** Show another replay: its length. keepable: seconds for computing the networks that were not stored; 0: they cannot be computed. */
  showTrack(replay, keepable) {
    this.replay = replay
    this.root.classList.remove("empty")
    const { last, stride } = replay
    this.scrub.max = last
    this.root.classList.toggle("single", replay.walk.free === 0)
    this.keepable = keepable
    this.stored.textContent = stride > 1 ? `every ${ordinal(stride)} of ${replay.walk.states} is stored` : ""
    this.keep.hidden = !(stride > 1 && keepable)
    this.keep.textContent = keepable >= 1 ? `Keep all (about ${duration(keepable)})` : "Keep all"
    this.showRate()
  }

  /** Show the present position. */
  show(replay) {
    this.scrub.value = replay.position
    this.place.textContent = this.place.title = replay.place
    if (!this.number.matches(":focus")) this.number.value = replay.walk.number[replay.frame]
  }
}

/** Seconds in words. */
function duration(seconds) { return seconds < 100 ? `${Math.round(seconds)} s` : `${Math.round(seconds / 60)} min` }

/** 2 → "2nd". */
function ordinal(count) {
  const ending = Math.floor(count / 10) % 10 === 1 ? "th" : ["th", "st", "nd", "rd"][count % 10] ?? "th"
  return `${count}${ending}`
}
