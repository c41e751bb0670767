// The controls around the scene: tools above it; below it the player's bar, the legend, and numbers
// that check the network on screen.

import { createElement } from "../browser/dom.js"
import { Keyboard } from "./keyboard.js"
import { PlayerBar } from "./player_bar.js"
import { LEAST } from "./drawing/chain_strokes.js"

const ICONS = {
  undo: "M12 5V1L6 6l6 5V7a6 6 0 1 1-6 6H4a8 8 0 1 0 8-8z",
  hold: "M8 2h8v2l-1 1v6l3 3v2h-5v6l-1 1-1-1v-6H6v-2l3-3V5L8 4z",
  closer: "M11 4h2v7h7v2h-7v7h-2v-7H4v-2h7z",
  farther: "M4 11h16v2H4z",
  whole: "M4 4h6v2H6v4H4zM14 4h6v6h-2V6h-4zM4 14h2v4h4v2H4zM18 14h2v6h-6v-2h4z",
  full: "M3 5h18v14H3zm2 2v10h14V7z",
}
function icon(name) {
  return `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${ICONS[name]}"/></svg>`
}

function button(name, title, word = "") {
  const label = word && ` <span>${word}</span>`
  return `<button type="button" class="${name}" title="${title}" aria-label="${word ? `${word}: ` : ""}${title}">` +
    `${icon(name)}${label}</button>`
}

// Tools appear depending on the selection.
const BUTTONS = `
  <div class="scenes">
    <div class="view">
      ${button("closer", "zoom in (Ctrl + wheel, pinch)")}
      ${button("farther", "zoom out")}
      ${button("whole", "the whole packing (double click)")}
      ${button("full", "full screen")}
    </div>
    <div class="bar tools">
      ${button("undo", "the last pull (Z); Esc undoes all pulls; held forces stay held", "Undo")}
      <span class="hold-tools">
        <label title="normal force of the selected contact, in mean forces; enter a value to pull it there">fₙ
          <input class="force" type="number" min="0" step="any" aria-label="normal force of the selected contact, in mean forces"></label>
        <button type="button" class="least" title="pull it to its least value">least</button>
        <button type="button" class="largest" title="pull it to its largest value">largest</button>
        ${button("hold", "hold the selected contact at this force (H); press again to release it", "Hold")}
        <label title="error bar of a force that is held, in mean forces; 0: held exactly">±
          <input class="uncertainty" type="number" min="0" step="0.05" value="0" aria-label="error bar in mean forces"></label>
      </span>
    </div>
  </div>
  <div class="legend"></div>
  <div class="foot"><details class="extras"><summary>Check</summary>
  <div class="read">
    <span class="differs">from that <b class="origin"></b>, on average, <b class="apart"></b> of the mean force</span>
    <span tabindex="0" data-term="residual">unbalanced <b class="residual"></b> of the mean force</span>
    <span class="running">
      <span>of the stored networks up to this one, <b class="upto"></b>:</span>
      <span tabindex="0" data-term="eta1">η₁ <b class="eta1"></b></span>
      <span tabindex="0" data-term="eta2">η₂ <b class="eta2"></b></span>
      <span tabindex="0" data-term="eta3">0.15 η₃ <b class="eta3"></b></span>
    </span>
  </div>
  <div>Made: <span class="source"></span></div>
  <div class="skips" data-term="segment" tabindex="0"></div>
  </details><div class="message" role="status"></div></div>`
const CLOSER = 0.7 // zoom factor of a button

export class Buttons {
  /**
   * actions: by the buttons' names; scrub(position); tab(number), for the digits. look(name, value): what
   * lines are to show, or how, was chosen in the legend. open(name, whether): a panel was opened or closed.
   */
  constructor(scene, actions, { look, open }) {
    this.root = createElement("div", { className: "stage", innerHTML: BUTTONS })
    this.bar = new PlayerBar(actions, (words) => this.say(words))
    this.keyboard = new Keyboard(this.root, actions)
    this.requested = scene.root.appendChild(createElement("div", { className: "requested" }))
    this.scenes = this.part("scenes")
    this.scenes.prepend(scene.root)
    this.scenes.after(this.bar.root)
    this.scene = scene
    const zoom = (factor) => () => scene.zoom(factor, scene.size / 2, scene.size / 2)
    const all = {
      ...actions, closer: zoom(CLOSER), farther: zoom(1 / CLOSER), whole: () => scene.reset(),
      full: () => (document.fullscreenElement ? document.exitFullscreen() : this.root.requestFullscreen()),
    }
    for (const name of [...Object.keys(ICONS), "least", "largest"]) this.part(name)?.addEventListener("click", all[name])
    this.part("legend").addEventListener("change", ({ target }) => {
      const empty = target.type === "number" && target.value === ""
      const value = target.type === "checkbox" ? target.checked : empty ? null : target.type === "number" ? target.valueAsNumber : target.value
      if (target.validity.valid && (!empty || target.placeholder)) look(target.name, value)
      else target.value = target.defaultValue
    })
    const extras = this.part("extras")
    extras.addEventListener("toggle", () => open("check", extras.open))
    const force = this.part("force")
    force.addEventListener("input", () => { this.typed = true })
    force.addEventListener("change", () => { this.typed = false; actions.pull() })
    force.addEventListener("blur", () => { this.typed = false; this.writeForce() })
    this.part("uncertainty").addEventListener("keydown", (event) => { if (event.key === "Enter") actions.hold() })
  }

  remove() { this.keyboard.remove() }

  part(name) { return this.root.querySelector(`.${name}`) }

  /** Error bar of a held force, in ⟨fₙ⟩; NaN for invalid input. */
  get error() {
    const typed = this.part("uncertainty").valueAsNumber
    return typed >= 0 ? typed : NaN
  }

  /** Whether a contact is selected, so that its force can be held, and whether it is. */
  tellChosen(chosen, held) {
    this.root.classList.toggle("chosen", Boolean(chosen))
    this.part("hold").classList.toggle("on", held)
    this.part("hold").querySelector("span").textContent = held ? "Release" : "Hold"
    for (const name of ["force", "least", "largest"]) this.part(name).disabled = held
  }

  /** Show the force of the selected contact, unless another value is being typed. */
  showForce(value) {
    this.present = value
    if (!this.typed) this.writeForce()
  }

  writeForce() { this.part("force").value = this.present?.toFixed(3) ?? "" }

  /** The typed force of the selected contact; NaN for invalid input. */
  get force() { return this.part("force").valueAsNumber }

  tellPlaying(playing) {
    this.bar.showPlaying(playing)
    this.root.classList.toggle("playing", playing)
  }

  /** The quantities shown by lines, to be chosen; the open list, or the one with the focus, stays so. */
  tellLegend(html) {
    const legend = this.part("legend"), details = () => legend.querySelector("details")
    if (details()) this.unfolded = details().open // there is none while a packing is made
    const { name } = legend.getRootNode().activeElement ?? {}
    legend.innerHTML = html
    if (details()) details().open = this.unfolded ?? false
    if (name) legend.querySelector(`[name="${name}"]`)?.focus({ preventScroll: true })
  }

  /** The open panels, of which only one is here. */
  tellOpen(names) { this.part("extras").open = names.includes("check") }

  /** One line below the player; empty: no line. */
  say(words) {
    const message = this.part("message")
    message.textContent = message.title = words
  }

  /** A message over the old picture about a request in progress; empty: no message. */
  showRequested(words) {
    this.requested.textContent = words
    this.root.classList.toggle("pale", Boolean(words))
  }

  /** Whether a pulled network is on screen. */
  tellHeld(held) { this.root.classList.toggle("held", held) }

  /** The numbers of the position. */
  read(replay) {
    const { walk, frame, residual } = replay
    const form = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : "–")
    const texts = {
      origin: walk.origin,
      apart: `${Math.round(100 * replay.apart)} %`,
      eta1: form(walk.eta1[frame], 3),
      eta2: form(walk.eta2[frame], 3),
      eta3: form(0.15 * walk.eta3[frame], 3),
      upto: `${frame} of ${walk.number.length - 1}`,
      residual: residual === 0 ? "0" : Number.isFinite(residual) ? residual.toExponential(0) : "–",
    }
    for (const [name, text] of Object.entries(texts)) this.part(name).textContent = text
    this.root.classList.toggle("ran", frame > 1 && !replay.held)
    this.root.classList.toggle("other", replay.apart > 0)
    this.bar.show(replay)
    this.count()
  }

  count() {
    const { drawn, segments, outside, thin } = this.scene.counts
    this.part("skips").textContent = `Drawn: ${drawn} of ${segments} force lines ` +
      `(${outside} out of view, ${thin} thinner than ${LEAST} px).`
  }
}
