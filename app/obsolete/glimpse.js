// Pictures side by side, one of which is clicked. Meanwhile each goes from one network to the next, by
// straight lines, all at the same pace.

import { ask } from "../browser/send.js"
import { made } from "../browser/dom.js"

const STEP_MS = 700 // from one network to the next
const STILL = matchMedia("(prefers-reduced-motion: reduce)")

export function render({ model, view }) {
  const root = document.createElement("div"), buttons = root.appendChild(made("div", { className: "glimpses" }))
  if (!STILL.matches) root.append(made("p", { textContent: "No disk moves; watch the lines become thicker and thinner." }))
  let moving = false // while they are seen
  let shown = [] // of each picture its lines, their widths, and how many networks these are of

  function show() {
    buttons.replaceChildren(...model.items.map(([picture, , words], k) => {
      const button = made("button", { type: "button", className: "soft", innerHTML: `${picture}<span>${words}</span>` })
      button.addEventListener("click", () => ask(model, view, { pick: k }))
      return button
    }))
    shown = model.items.map(([, widths], k) => {
      const lines = [...buttons.children[k].querySelectorAll("path")]
      return { lines, widths, count: widths.length / lines.length }
    })
    paint(0)
  }

  function step(now) {
    if (!moving) return
    paint(now / STEP_MS)
    requestAnimationFrame(step)
  }

  function paint(at) {
    for (const { lines, widths, count } of shown) {
      const k = Math.floor(at) % count, next = (k + 1) % count, part = at - Math.floor(at)
      lines.forEach((line, c) => {
        const width = (1 - part) * widths[k * lines.length + c] + part * widths[next * lines.length + c]
        line.setAttribute("stroke-width", width.toFixed(3))
      })
    }
  }

  const seen = new IntersectionObserver((told) => {
    const { isIntersecting } = told.at(-1)
    const begins = isIntersecting && !moving && !STILL.matches
    moving = isIntersecting
    if (begins) requestAnimationFrame(step)
  })
  seen.observe(root)
  model.on("remove", () => { moving = false; seen.disconnect() })
  model.on("items", show)
  show()
  return root
}
