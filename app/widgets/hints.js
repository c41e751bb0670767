// The glossary at the words on the page: elements with data-term, and the words in the label and
// the chosen option of widgets.

import { createElement } from "../browser/dom.js"
import { focused, outwards } from "../browser/kept_focus.js"
import { plain } from "../browser/send.js"

const WAIT_MS = 250 // before a hint opens under a resting pointer
const WIDGETS = "[role=tab], button, .number, .friction, " +
  ".choice, .MuiFormControl-root, .MuiFormControlLabel-root"
const DEEP = 14 // levels above the pointer to search for the word

export function render({ model }) {
  const terms = plain(model.terms), labels = plain(model.labels)
  const tip = createElement("div", { className: "hint", role: "tooltip", hidden: true })
  let waiting = 0, at = null, pointer = null, under = null

  const words = (node, part) => node?.querySelector(part)?.textContent.trim()

  /** Glossary keys for a widget's words: first its value's, then its label's. */
  function keysOf(node) {
    const value = words(node, "option:checked"), label = words(node, "label, legend, .name")
    const keys = [value, label, node.textContent.trim()].map((text) => labels[text])
    return [...new Set(keys.filter(Boolean))].slice(0, 2)
  }

  function termsAt(path) {
    for (const node of path.slice(0, DEEP)) {
      if (!(node instanceof Element)) continue
      if (node.dataset.term) return [node, node.dataset.term.split(" ")]
      if (node.matches(WIDGETS)) {
        const keys = keysOf(node)
        if (keys.length) return [node, keys]
      }
    }
    return [null, []]
  }

  function show(node, keys) {
    at = node
    tip.replaceChildren(...keys.filter((key) => terms[key]).map((key) => {
      const [title, sentence] = plain(terms[key]), row = document.createElement("p")
      row.append(createElement("b", { innerHTML: title.replace(/_(\w+)/, "<sub>$1</sub>") }), ` ${sentence}`)
      return row
    }))
    if (!node.ariaDescription) node.setAttribute("aria-description", tip.textContent)
    tip.hidden = false
    const box = node.getBoundingClientRect(), { offsetWidth: width, offsetHeight: height } = tip
    const left = Math.max(8, Math.min(window.innerWidth - width - 8, box.left))
    const below = box.bottom + 8 + height < window.innerHeight
    tip.style.left = `${left}px`
    tip.style.top = `${below ? box.bottom + 8 : Math.max(8, box.top - height - 8)}px`
  }

  function hide() {
    clearTimeout(waiting)
    waiting = 0
    tip.hidden = true
    at = null
  }

  /** The element under the pointer, inside any shadow root. */
  function pointed() {
    let node = null, root = document
    while (root) {
      const inner = root.elementFromPoint(pointer.clientX, pointer.clientY)
      if (!inner || inner === node) break
      node = inner
      root = node.shadowRoot
    }
    return node
  }

  // What was under the pointer can be replaced or scrolled away while it rests.
  function rest() {
    waiting = setTimeout(() => {
      const [node, keys] = termsAt(outwards(pointed()))
      waiting = 0
      if (node) show(node, keys)
    }, WAIT_MS)
  }

  // Not pointerover and focusin, which are not dispatched here for moves within one shadow root.

  function move(event) {
    const path = event.composedPath()
    pointer = event
    if (event.pointerType === "touch" || path[0] === under) return
    under = path[0]
    const [node] = termsAt(path)
    if (node === at && node) return
    hide()
    if (node) rest()
  }

  function scroll() {
    const rested = waiting
    hide()
    under = null
    if (rested) rest()
  }

  function press(event) {
    const [node, keys] = termsAt(event.composedPath()), touched = event.pointerType === "touch"
    if (!node || (touched ? node === at : !node.matches(".term"))) return hide()
    clearTimeout(waiting)
    show(node, keys)
  }

  function typed(event) {
    const node = focused()
    if (!/^(Tab|Arrow.*)$/.test(event.key) || !node.matches(":focus-visible")) return hide()
    const [word, keys] = termsAt(outwards(node))
    if (!word) hide()
    else if (word !== at) show(word, keys)
  }

  // Scrolling inside a shadow root is not heard here, but what causes it is.
  const listeners = { pointermove: move, pointerdown: press, keyup: typed, scroll, wheel: scroll, touchmove: hide }
  for (const [name, act] of Object.entries(listeners)) window.addEventListener(name, act, true)
  model.on("remove", () => {
    for (const [name, act] of Object.entries(listeners)) window.removeEventListener(name, act, true)
  })
  return tip
}
