// Scrolls what a visitor unfolds into view, while it grows: plots follow their title.

import { STILL } from "../browser/motion.js"

const TITLE = "summary, .MuiAccordionSummary-root", FOLD = "details, .MuiAccordion-root"
const GROWS_MS = 2000 // after a click, unless the visitor scrolls

export function render({ model }) {
  const follow = ([{ target }]) => target.scrollIntoView({ block: "nearest", behavior: STILL.matches ? "auto" : "smooth" })
  const growth = new ResizeObserver(follow), end = () => growth.disconnect()
  let ending = 0

  function unfold(event) {
    const fold = event.composedPath().find((node) => node.matches?.(TITLE))?.closest(FOLD)
    end()
    clearTimeout(ending)
    if (!fold) return
    growth.observe(fold)
    ending = setTimeout(end, GROWS_MS)
  }

  const listeners = { click: unfold, wheel: end, touchmove: end }
  for (const [name, act] of Object.entries(listeners)) window.addEventListener(name, act, { capture: true, passive: true })
  model.on("remove", () => {
    end()
    for (const [name, act] of Object.entries(listeners)) window.removeEventListener(name, act, true)
  })
  return document.createElement("div")
}
