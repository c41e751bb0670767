// The line at the bottom: a failure, or the progress of a computation, or the reliability of the
// numbers on screen; and, until it is closed, where new visitors can begin.
import { ask, plain } from "../browser/send.js"
import { button, createElement } from "../browser/dom.js"
import { knows, remember } from "../browser/local_storage.js"
import { asked } from "../browser/scene_options.js"

const NEW = "learn" // name under which a browser remembers that the line for new visitors was closed
const LATE_MS = 200 // after which a computation is shown; shorter ones would flicker

export function render({ model, view }) {
  const root = createElement("div", { className: "line" }), facts = createElement("p", { className: "facts" })
  const failed = createElement("p", { className: "failed", role: "alert" }), task = createElement("div", { className: "task", hidden: true })
  task.innerHTML = `
    <div class="bar" role="progressbar" aria-label="progress" aria-valuemin="0" aria-valuemax="100"><div></div></div><span></span>`
  const [bar, words] = task.children
  const stop = button("Stop and keep", () => ask(model, view, { stop: true }), { className: "soft" })
  const cancel = button("Cancel", () => ask(model, view, { cancel: true }), { className: "soft" })
  task.append(stop, cancel)
  root.append(failed, task, facts)
  let late = 0

  /** A newer message replaces the one below the packing. */
  function replace() {
    if (model.failed) view.model.document.get_model_by_name("player")?.player?.say("")
    show()
  }

  function show() {
    const { fraction = null, words: sentence, keeps } = plain(model.progress), known = fraction !== null
    late = 0
    failed.hidden = !model.failed
    failed.replaceChildren(model.failed, button("×", () => ask(model, view, { read: true }), { ariaLabel: "Close" }))
    facts.replaceChildren(...model.facts.map((fact) => createElement("span", { innerHTML: fact })))
    task.hidden = !sentence
    facts.style.visibility = task.hidden && !model.failed ? "" : "hidden"
    view.el.classList.toggle("urgent", !task.hidden || Boolean(model.failed)) // visible at any scroll position
    if (task.hidden) return
    bar.classList.toggle("unknown", !known)
    bar.firstElementChild.style.width = `${known ? Math.round(100 * fraction) : 40}%`
    bar.ariaValueNow = known ? Math.round(100 * fraction) : null
    stop.hidden = !keeps
    cancel.textContent = keeps ? "Discard" : "Cancel"
    words.textContent = words.title = sentence
  }

  function follow() {
    if (!plain(model.progress).words || !task.hidden) { clearTimeout(late); show() } else late ||= setTimeout(show, LATE_MS)
  }

  const question = asked()
  if (question || !knows(NEW)) root.append(invitation(question))
  model.on("facts", show)
  model.on("failed", replace)
  model.on("progress", follow)
  show()
  return root
}

/** Where new visitors can begin, or the question that the lesson ended with. */
function invitation(question) {
  const paragraph = createElement("p", { className: "new" })
  const link = createElement("a", { href: "?learn", textContent: "Learn" })
  const close = button("×", () => { remember(NEW); paragraph.remove() }, { ariaLabel: "Close permanently" })
  paragraph.append(...(question ? [question] : ["New to this? ", link, " starts with one force"]), close)
  return paragraph
}
