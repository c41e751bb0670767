// The address follows the view, and the view follows Back and Forward; for a lost server see
// connection_lost.js.

import { ask } from "../browser/send.js"
import { connectionBanner } from "../browser/connection_lost.js"
import { keepView } from "../browser/local_storage.js"

export function render({ model, view }) {
  const banner = connectionBanner(view, "Everything already loaded still plays.")
  let requests = model.settled // number of Back and Forward requests
  const waits = () => requests > model.settled // until then the address is ahead of the view

  /** A query without the parameters that Back ignores. */
  function lasting(query) {
    const given = new URLSearchParams(query)
    for (const name of model.passing) given.delete(name)
    return given.toString()
  }

  function write() {
    const { query } = model
    if (!query || waits()) return
    keepView(query) // for the link in Learn
    const put = (how, view) => window.history[how](null, "", view)
    // An address without a view gets the first one, even if the visitor has already selected another.
    if (!new URLSearchParams(window.location.search).has("mu")) put("replaceState", model.first)
    const now = window.location.search
    if (query !== now) put(lasting(query) === lasting(now) ? "replaceState" : "pushState", query)
  }

  function returned() {
    const query = window.location.search
    if (!waits() && lasting(query) === lasting(model.query)) return
    requests++
    ask(model, view, { query })
  }

  window.addEventListener("popstate", returned)
  model.on(["query", "settled"], write)
  model.on("remove", () => window.removeEventListener("popstate", returned))
  write()
  return banner
}
