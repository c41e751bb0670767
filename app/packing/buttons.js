// The player's buttons, sliders and numbers around the scene, and the keys that stand for them.

import { made } from "../browser/dom.js"
import { LEAST } from "./drawing/scene.js"

const ICONS = {
  restart: "M6 5h2v14H6zM20 5v14L9 12z",
  back: "M18 5v14L8 12z",
  play: "M7 4v16l13-8z",
  pause: "M6 5h4v14H6zM14 5h4v14h-4z",
  step: "M6 5v14l10-7zM17 5h2v14h-2z",
  pin: "M12 2a7 7 0 0 1 7 7c0 5-7 13-7 13S5 14 5 9a7 7 0 0 1 7-7zm0 4a3 3 0 1 0 0 6 3 3 0 0 0 0-6z",
  undo: "M12 5V1L6 6l6 5V7a6 6 0 1 1-6 6H4a8 8 0 1 0 8-8z",
  hold: "M8 2h8v2l-1 1v6l3 3v2h-5v6l-1 1-1-1v-6H6v-2l3-3V5L8 4z",
  between: "M4 12l5-5v3h6V7l5 5-5 5v-3H9v3z",
  split: "M3 5h8v14H3zM13 5h8v14h-8z",
  closer: "M11 4h2v7h7v2h-7v7h-2v-7H4v-2h7z",
  farther: "M4 11h16v2H4z",
  whole: "M4 4h6v2H6v4H4zM14 4h6v6h-2V6h-4zM4 14h2v4h4v2H4zM18 14h2v6h-6v-2h4z",
  full: "M3 5h18v14H3zm2 2v10h14V7z",
}
const HELD = { "[": "less", "]": "more", z: "undo", Z: "undo", Escape: "free", h: "hold", H: "hold" }
const KEYS = {
  ArrowRight: "step", ArrowLeft: "back", Home: "restart", End: "end", n: "next", N: "previous",
}

function icon(name) {
  return `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${ICONS[name]}"/></svg>`
}

function button(name, title, word = "") {
  const said = word && ` <span>${word}</span>`
  return `<button type="button" class="${name}" title="${title}" aria-label="${word ? `${word}: ` : ""}${title}">` +
    `${icon(name)}${said}</button>`
}

// The scene with tools over it that come and go with what is selected; below it the player, the legend,
// and what compares and checks networks.
const BUTTONS = `
  <div class="scenes">
    <div class="view">
      ${button("closer", "zoom in (wheel, pinch)")}
      ${button("farther", "zoom out")}
      ${button("whole", "the whole packing (double click)")}
      ${button("full", "full screen")}
    </div>
    <div class="bar tools">
      ${button("undo", "the last pull (Z); Esc lets all go", "Undo")}
      <span class="knowing">
        ${button("hold", "the selected contact keeps its present force (H); again: let it go", "Hold")}
        <label title="error bar of a force that is held, in mean forces; 0: held exactly">±
          <input class="error" type="number" min="0" step="0.05" value="0" aria-label="error bar in mean forces"></label>
      </span>
    </div>
  </div>
  <div class="bar">
    ${button("restart", "restart with the forces as packed (Home)")}
    ${button("back", "one network back (←)")}
    ${button("play", "space", "Play")}
    ${button("step", "one network on (→)")}
    <label class="along">network <input class="scrub" type="range" min="0" value="0" step="1" aria-label="network"></label>
    <b class="state"></b>
    <label title="speed, networks per second"><input class="speed" type="range" min="0" max="6" step="0.25" value="0"
      aria-label="speed"><span class="rate"></span></label>
  </div>
  <div class="read"><span class="said"></span></div>
  <div class="legend"></div>
  <details class="extras"><summary>Compare and check</summary>
  <div class="game">
    ${button("pin", "pin this network, to compare others with it", "Pin")}
    ${button("between", "between the pinned network and this one", "To and fro")}
    ${button("split", "the pinned network and this one; another μ then comes beside this one", "Side by side")}
  </div>
  <div class="read">
    <span class="differs">from as packed, on average, <b class="apart"></b> of the mean force</span>
    <span tabindex="0" data-term="residual">unbalanced <b class="residual"></b> of the mean force</span>
    <span tabindex="0" data-term="accepted">accepted <b class="acceptance"></b></span>
    <span tabindex="0" data-term="distance">from the centre of all networks <b class="distance"></b> mean forces</span>
    <span class="running">
      <span>of the <b class="played"></b> shown so far:</span>
      <span tabindex="0" data-term="eta1">spread <b class="eta1"></b></span>
      <span tabindex="0" data-term="eta2">distance <b class="eta2"></b></span>
      <span tabindex="0" data-term="eta3">range <b class="eta3"></b></span>
    </span>
  </div>
  <div class="game">Made: <span class="source"></span></div>
  <div class="skips" data-term="segment" tabindex="0"></div>
  </details>`
const CLOSER = 0.7 // of the view, by a button

export class Buttons {
  /**
   * actions: by the buttons' names; scrub(position); tab(number), for the digits. look(name, value): what
   * lines are to show, or how, was chosen in the legend.
   */
  constructor(scene, actions, look) {
    this.root = made("div", { className: "stage", innerHTML: BUTTONS })
    this.actions = actions
    this.asked = scene.root.appendChild(made("div", { className: "asked" }))
    this.scenes = this.part("scenes")
    this.scenes.prepend(scene.root)
    this.scene = scene
    const zoom = (factor) => () => scene.zoom(factor, scene.size / 2, scene.size / 2)
    const all = {
      ...actions, closer: zoom(CLOSER), farther: zoom(1 / CLOSER), whole: () => scene.reset(),
      full: () => (document.fullscreenElement ? document.exitFullscreen() : this.root.requestFullscreen()),
    }
    for (const name of Object.keys(ICONS)) this.part(name)?.addEventListener("click", all[name])
    this.part("scrub").addEventListener("input", (event) => actions.scrub(Number(event.target.value)))
    this.part("legend").addEventListener("change", ({ target }) => {
      const value = { checkbox: target.checked, number: target.value === "" ? null : target.valueAsNumber }[target.type] ?? target.value
      if (target.validity.valid && (value !== null || target.placeholder)) look(target.name, value)
      else target.value = target.defaultValue
    })
    this.part("error").addEventListener("keydown", (event) => { if (event.key === "Enter") actions.hold() })
    this.part("speed").addEventListener("input", () => this.tellRate())
    this.tellRate()
    // Before the widget that has the focus: what was clicked keeps it, but Space and arrows then mean
    // the player again. Who goes by Tab means the widget.
    this.tabbed = false
    this.onKey = (event) => this.key(event)
    this.onPress = () => { this.tabbed = false }
    window.addEventListener("keydown", this.onKey, true)
    window.addEventListener("pointerdown", this.onPress, true)
  }

  remove() {
    window.removeEventListener("keydown", this.onKey, true)
    window.removeEventListener("pointerdown", this.onPress, true)
  }

  part(name) { return this.root.querySelector(`.${name}`) }

  /** States per second. */
  get speed() { return 2 ** Number(this.part("speed").value) }

  /** Error bar of a force that is held, in ⟨fₙ⟩; NaN where what was typed is none. */
  get error() {
    const typed = this.part("error").valueAsNumber
    return typed >= 0 ? typed : NaN
  }

  /** Whether a contact is selected, whose force can be held. */
  tellChosen(chosen) { this.root.classList.toggle("chosen", Boolean(chosen)) }

  tellRate() { this.part("rate").textContent = `${this.speed.toFixed(this.speed < 10 ? 1 : 0)} /s` }

  tellPlaying(playing) {
    const play = this.part("play"), word = playing ? "pause" : "play"
    play.innerHTML = `${icon(word)} ${playing ? "Pause" : "Play"}`
    play.title = "space"
    play.setAttribute("aria-label", word)
    this.root.classList.toggle("playing", playing)
  }

  /** What lines show, to be chosen; what was open, or has the focus, keeps it. */
  tellLegend(html) {
    const legend = this.part("legend"), open = legend.querySelector("details")?.open
    const { name } = legend.getRootNode().activeElement ?? {}
    legend.innerHTML = html
    if (open) legend.querySelector("details").open = true
    if (name) legend.querySelector(`[name="${name}"]`)?.focus({ preventScroll: true })
  }

  /** One line below the player; empty: none. */
  say(words) { this.part("said").textContent = words }

  /** What was asked for and is not there yet lies over the old picture; empty: nothing was. */
  tellAsked(words) {
    this.asked.textContent = words
    this.root.classList.toggle("pale", Boolean(words))
  }

  /** Whether a network is on screen that was pulled. */
  tellHeld(held) { this.root.classList.toggle("held", held) }

  /** Whether two networks are asked for, and whether they are there. */
  tellSplit(asked, there) {
    if (asked) this.part("extras").open = true
    this.part("split").classList.toggle("on", asked)
    this.root.classList.toggle("two", there)
  }

  tellTrack({ last, swinging, walk }) {
    const scrub = this.part("scrub"), between = this.part("between")
    scrub.max = last
    scrub.step = swinging ? 0.01 : 1
    between.classList.toggle("on", swinging)
    if (swinging) this.part("extras").open = true
    between.disabled = !swinging && walk.number.length < 2
  }

  /** The numbers of the position. */
  read(replay) {
    const { walk, seen, residual } = replay
    const form = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : "–")
    const accepted = walk.acceptance[seen]
    const texts = {
      state: replay.place,
      apart: `${Math.round(100 * replay.apart)} %`,
      eta1: form(walk.eta1[seen], 3),
      eta2: form(walk.eta2[seen], 3),
      eta3: form(walk.eta3[seen], 3),
      played: seen,
      acceptance: accepted <= 1 ? `${Math.round(100 * accepted)} %` : "–",
      distance: form(replay.distance, 2),
      residual: Number.isFinite(residual) ? residual.toExponential(0) : "–",
    }
    for (const [name, text] of Object.entries(texts)) this.part(name).textContent = text
    this.root.classList.toggle("ran", seen > 1 && !replay.held)
    this.root.classList.toggle("other", replay.apart > 0)
    this.part("scrub").value = replay.position
    this.count()
  }

  count() {
    const { drawn, segments, outside, thin } = this.scene.counts
    this.part("skips").textContent = `Drawn: ${drawn} of ${segments} force lines ` +
      `(${outside} out of view, ${thin} thinner than ${LEAST} px).`
  }

  key(event) {
    if (!this.root.isConnected) return this.remove()
    if (event.key === "Tab") this.tabbed = true
    const at = event.composedPath()[0]
    if (typing(at) || event.ctrlKey || event.metaKey || event.altKey) return
    const own = { space: usesSpace(at, this.tabbed), arrows: usesArrows(at, this.tabbed) }
    const name = KEYS[event.key]
    if (event.key === " " && !own.space) this.actions.play()
    else if (name && !own.arrows) this.actions[name]()
    else if (HELD[event.key]) return this.actions[HELD[event.key]]()
    else if (/^[1-9]$/.test(event.key)) this.actions.tab(Number(event.key))
    else return
    event.preventDefault()
    event.stopPropagation()
  }
}

// Which keys the element with the focus needs for itself

function typing(at) {
  return at.isContentEditable || /^(TEXTAREA|SELECT)$/.test(at.tagName) ||
    (at.tagName === "INPUT" && !["range", "checkbox", "radio", "button"].includes(at.type))
}

const chosen = (at) => at.ariaSelected === "true" || at.ariaPressed === "true"
const inMenu = (at) => ["option", "menuitem", "listbox", "menu"].includes(at.role)

/** A tab or one of several that is chosen already has no use for it. */
function usesSpace(at, tabbed) {
  if (inMenu(at)) return true
  const pressed = at.tagName === "BUTTON" || at.tagName === "A" || at.type === "checkbox" ||
    ["combobox", "tab", "button", "switch"].includes(at.role)
  return pressed && tabbed && !chosen(at)
}

function usesArrows(at, tabbed) {
  if (inMenu(at) || at.type === "range") return true
  return tabbed && ["tab", "combobox", "radio"].includes(at.role)
}
