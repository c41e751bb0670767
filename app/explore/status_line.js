// The line at the lower edge: what failed, else what is being computed, else what is known of the
// numbers on screen; and, until it is closed for good, where to begin for somebody new.

import { ask } from "../browser/send.js"
import { button, made } from "../browser/dom.js"
import { knows, remember } from "../browser/local_storage.js"
import { taskLine } from "../widgets/progress.js"

const NEW = "learn" // what a browser remembers of the line for somebody new

export function render({ model, view }) {
  const root = made("div", { className: "line" }), facts = made("p", { className: "facts" })
  const failed = made("p", { className: "failed", role: "alert" })
  root.append(failed, taskLine(model, view), facts)

  function show() {
    failed.hidden = !model.failed
    failed.replaceChildren(model.failed, button("×", () => ask(model, view, { read: true }), { ariaLabel: "Close" }))
    facts.hidden = model.running
    view.el.classList.toggle("urgent", model.running || Boolean(model.failed)) // seen wherever the page is scrolled to
    facts.replaceChildren(...model.facts.map((fact) => made("span", { innerHTML: fact })))
  }

  if (!knows(NEW)) root.append(invitation())
  model.on(["failed", "facts", "running"], show)
  show()
  return root
}

function invitation() {
  const told = made("p", { className: "new" }), dark = new URLSearchParams(location.search).get("dark") === "1"
  const link = made("a", { href: `${location.pathname}?learn${dark ? "&dark=1" : ""}`, textContent: "Learn" })
  const close = button("×", () => { remember(NEW); told.remove() }, { ariaLabel: "Close permanently" })
  told.append("New to this? ", link, " starts with one disk", close)
  return told
}
