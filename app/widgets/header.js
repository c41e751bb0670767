// The header of every page: links to both entry pages, and tools that need no server.

import { button, createElement } from "../browser/dom.js"
import { copyButton } from "../browser/clipboard.js"
import { keepFocus } from "../browser/kept_focus.js"
import { lastChapter, lastView } from "../browser/local_storage.js"

const HALF = '<svg viewBox="0 0 24 24" aria-hidden="true"><path d="M12 2a10 10 0 1 0 0 20 10 10 0 0 0 0-20zm0 2v16a8 8 0 0 1 0-16z"/></svg>'
// Entry pages: name, title, and query: the last view of Explore, in which a packing of the visitor's own is named by
// its content, and the last chapter of Learn.
const DOORS = [["explore", "Explore", lastView], ["learn", "Learn", () => `?learn=${lastChapter()}`]]
const YEAR_S = 365 * 24 * 3600

export function render({ model }) {
  const root = document.createElement("div"), header = root.appendChild(document.createElement("header"))
  const nav = createElement("nav", { ariaLabel: "granforce" }), tools = createElement("div", { className: "tools" })
  header.append(createElement("b", { textContent: "granforce" }), nav, tools)

  function show() {
    nav.replaceChildren(...DOORS.map(([door, textContent, query]) => {
      const link = createElement("a", { textContent, href: window.location.pathname + query() })
      if (door === model.door) link.ariaCurrent = "page"
      return link
    }))
    theme.ariaLabel = theme.title = model.dark ? "Light theme" : "Dark theme"
  }

  const link = copyButton("Copy link", () => window.location.href)
  const theme = button("", () => {
    model.dark = !model.dark
    document.cookie = `dark=${model.dark ? 1 : 0}; max-age=${YEAR_S}; samesite=lax` // see visit.dark
  }, { innerHTML: HALF })
  const help = helpOf(model, root)
  const helpButton = button("?", () => help.showModal(), { ariaLabel: "Help and keys", title: "Help and keys (?)" })
  tools.append(link, helpButton, theme)

  /** The key "?" opens the list of keys, unless it is typed into a field. */
  function key(event) {
    const at = event.composedPath()[0]
    if (event.key !== "?" || /^(INPUT|TEXTAREA|SELECT)$/.test(at.tagName) || help.open) return
    help.showModal()
    event.preventDefault()
  }
  window.addEventListener("keydown", key)
  const leaveFocus = keepFocus()
  model.on("remove", () => {
    window.removeEventListener("keydown", key)
    leaveFocus()
  })
  model.on(["dark", "door"], show)
  show()
  return root
}

/** The dialog of "?": an explanation, and the keys. */
function helpOf(model, root) {
  const dialog = root.appendChild(document.createElement("dialog"))
  dialog.autofocus = true // not the first word with a hint, which may be below and would be scrolled to
  const keys = document.createElement("dl"), words = document.createElement("div")
  dialog.append(createElement("h2", { textContent: "Keys" }), keys, words, button("Close", () => dialog.close(), { className: "soft" }))
  dialog.addEventListener("click", (event) => { if (event.target === dialog) dialog.close() })
  dialog.addEventListener("keydown", (event) => event.stopPropagation()) // keys have no other effect meanwhile
  const show = () => {
    words.innerHTML = model.help
    dialog.firstChild.hidden = !model.keys.length
    keys.replaceChildren(...model.keys.flatMap(([key, does]) => [createElement("dt", { textContent: key }), createElement("dd", { textContent: does })]))
  }
  model.on(["help", "keys"], show)
  show()
  return dialog
}
