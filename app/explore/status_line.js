// The line at the bottom: a failure, or the progress of a computation, or the reliability of the
// numbers on screen; and, until it is closed, where new visitors can begin.
import { ask } from "../browser/send.js"
import { button, made } from "../browser/dom.js"
import { knows, remember } from "../browser/local_storage.js"
import { taskLine } from "../widgets/progress.js"

const NEW = "learn" // name under which a browser remembers that the line for new visitors was closed

export function render({ model, view }) {
  const root = made("div", { className: "line" }), facts = made("p", { className: "facts" })
  const failed = made("p", { className: "failed", role: "alert" })
  root.append(failed, taskLine(model, view), facts)

  function show() {
    failed.hidden = !model.failed
    failed.replaceChildren(model.failed, button("×", () => ask(model, view, { read: true }), { ariaLabel: "Close" }))
    facts.hidden = model.running
    view.el.classList.toggle("urgent", model.running || Boolean(model.failed)) // visible at any scroll position
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
