// Predict, then look: three questions on the packing on screen, each asked before the page shows what it
// asks for. In links `predict=2` opens the second one.

import { button } from "../browser/dom.js"

const ASKED = [
  {
    words: "Nothing moves. Are the forces at the contacts fixed, too?",
    choices: ["Yes, each has one value", "No, others balance as well"],
    answer: (player, chosen) => {
      const free = player.replay.walk.free, right = free > 0 ? 1 : 0
      if (free > 0) player.play(true)
      const told = free > 0
        ? `${free} numbers are left free by balance. Watch: every network that plays holds all disks.`
        : "Here balance leaves every force one value. With some friction it would not."
      return [chosen === right, told]
    },
  },
  {
    words: "Which line can change most, while every disk stays in balance? Click one.",
    choices: [],
    answer: (player, contact) => {
      const { extent, exact, walk } = player.look, order = Array.from(extent.keys()).sort((a, b) => extent[b] - extent[a])
      const rank = order.indexOf(contact) + 1, [widest] = order
      player.model.contact = widest
      player.model.colour = "extent"
      const told = `Contact ${walk.backbone[contact]} can change by ${extent[contact].toFixed(2)} × the mean force` +
        `${exact ? "" : " or more"}, place ${rank} of ${order.length}. The widest, ${extent[widest].toFixed(2)} × the mean force, ` +
        "is marked; colours now show how far each can go. Thick lines are not always the least certain."
      return [rank <= Math.ceil(order.length / 10), told]
    },
  },
  {
    words: "Packings made with more and more friction: how undetermined are their forces?",
    choices: ["More and more", "Less and less", "More at first, then less"],
    answer: (player, chosen) => {
      player.actions.tab(2)
      return [chosen === 2, "More friction lets each contact carry a wider range of forces, but leaves fewer " +
        "contacts, and so fewer free numbers. The statistics show how the two compete."]
    },
  },
]

export class Predict {
  constructor(player) {
    this.player = player
    this.step = 0 // the question that waits for an answer
    this.shown = false // whether there is one, answered or not
    this.quiz = player.buttons.part("quiz")
  }

  /** Another question is asked for, or none. */
  ask() {
    const { player } = this, step = player.model.predict
    if (!step && !this.shown) return
    player.difference.end()
    this.step = step
    this.shown = step > 0
    player.dress(step === 2)
    if (!step) return this.quiz.replaceChildren()
    player.hand.free()
    player.play(false)
    player.model.contact = null
    player.show(0)
    const { words, choices } = ASKED[step - 1]
    this.tell(`Question ${step} of ${ASKED.length}. ${words}`, choices.map((text, k) => [text, () => this.answer(k)]))
  }

  /** An answer: a contact that was chosen, or the number of a choice. */
  answer(given) {
    const { step, player } = this
    if (!step || given === null || given === undefined) return
    this.step = 0
    player.dress(false)
    const [right, told] = ASKED[step - 1].answer(player, given), next = step < ASKED.length ? step + 1 : 0
    this.tell(`${right ? "Well predicted" : "Not quite"}. ${told}`,
      [[next ? "Next question" : "Done", () => { player.model.predict = next }]])
  }

  /** A contact was chosen. */
  guess(contact) { if (this.step === 2) this.answer(contact) }

  tell(words, choices) {
    const row = document.createElement("div")
    row.append(...choices.map(([text, act]) => button(text, act)))
    this.quiz.replaceChildren(words, row)
  }
}
