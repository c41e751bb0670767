// The card of the tour in a small scene, above the pictures it speaks of: its first steps; the others are of 400 disks.

import { knows, remember } from "../browser/local_storage.js"

const NARROW = "(max-width: 759.95px)" // where S lies below the scene

export class TourCard {
  /** root: the page; shown(does): have it show what a step is about; onwards(): after the last step. */
  constructor(root, steps, all, shown, onwards) {
    Object.assign(this, { root, steps, all, shown, step: 0 })
    this.card = root.querySelector(".card")
    this.part("earlier").addEventListener("click", () => this.go(this.step - 1))
    this.part("next").addEventListener("click", () => (this.step < steps.length ? this.go(this.step + 1) : onwards()))
    this.part("close").addEventListener("click", () => this.go(0))
  }

  part(name) { return this.card.querySelector(`.${name}`) }

  get seen() { return knows("tour") }

  /** Show this step, none for 0. */
  go(step) {
    const { card, root } = this, was = this.step
    this.step = step
    card.hidden = !step
    root.classList.toggle("touring", Boolean(step))
    if (!step) {
      if (was) root.querySelector(".tourist").focus({ preventScroll: true })
      return
    }
    remember("tour")
    const [title, text, does] = this.steps[step - 1]
    card.querySelector("h2").textContent = title
    card.querySelector("p").textContent = text
    this.part("of").textContent = `${step} of ${this.all}`
    this.part("earlier").disabled = step === 1
    this.shown(does)
    requestAnimationFrame(() => {
      if (window.matchMedia(NARROW).matches) root.querySelector(`.${does.see ?? "card"}`).scrollIntoView({ block: "start" })
      card.querySelector("h2").focus({ preventScroll: true })
    })
  }
}
