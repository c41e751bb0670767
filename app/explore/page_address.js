// The address follows the view, and the view follows Back and Forward; for a lost server see
// connection_lost.js.

import { ask } from "../browser/send.js"
import { goneBanner } from "../browser/connection_lost.js"

const RETURN_MS = 20000 // within which a view in the history appears

export function render({ model, view }) {
  const banner = goneBanner(view, "What is in the page still plays.")
  let goal = null

  /** A query without the parameters that Back ignores. */
  function lasting(query) {
    const given = new URLSearchParams(query)
    for (const name of model.passing) given.delete(name)
    return given.toString()
  }

  function write() {
    const { query } = model, now = window.location.search
    if (goal === query) goal = null
    if (goal !== null || !query || query === now) return
    const known = new URLSearchParams(now).has("mu") // otherwise the page has just opened
    const step = known && lasting(query) !== lasting(now)
    window.history[step ? "pushState" : "replaceState"](null, "", query)
  }

  function returned() {
    const asked = window.location.search
    if (lasting(asked) === lasting(model.query)) return
    goal = asked
    ask(model, view, { query: asked })
    setTimeout(() => { if (goal === asked) { goal = null; write() } }, RETURN_MS)
  }

  window.addEventListener("popstate", returned)
  model.on("query", write)
  model.on("remove", () => window.removeEventListener("popstate", returned))
  write()
  return banner
}
