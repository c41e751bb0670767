// The progress of a task, with a button that cancels it; hidden while idle.

import { ask } from "../browser/send.js"

export function render({ model, view }) { return taskLine(model, view) }

/** Bar, text and buttons of the task that a model follows. */
export function taskLine(model, view) {
  const root = document.createElement("div")
  root.className = "task"
  root.innerHTML = `
    <div class="bar" role="progressbar" aria-label="progress" aria-valuemin="0" aria-valuemax="100"><div></div></div>
    <span></span><button type="button" class="soft">Stop and keep</button><button type="button" class="soft">Cancel</button>`
  const [bar, words, stop, cancel] = root.children

  function show() {
    root.hidden = !model.running
    const known = model.fraction !== null && model.fraction !== undefined
    const percent = known ? Math.round(100 * model.fraction) : 40
    bar.classList.toggle("unknown", !known)
    bar.firstElementChild.style.width = `${percent}%`
    if (known) bar.setAttribute("aria-valuenow", percent)
    else bar.removeAttribute("aria-valuenow")
    stop.hidden = !model.keeps
    cancel.textContent = model.keeps ? "Discard" : "Cancel"
    words.textContent = words.title = model.words
  }

  stop.addEventListener("click", () => ask(model, view, { stop: true }))
  cancel.addEventListener("click", () => ask(model, view, { cancel: true }))
  for (const name of ["running", "fraction", "words", "keeps"]) model.on(name, show)
  show()
  return root
}
