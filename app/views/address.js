// The address follows the view, the view follows Back and Forward, and where the server is gone, that
// is said; when there is one again, the page opens anew with its address, which holds the view.

const RETURN_MS = 4000 // in which a view that was gone back to appears
const RETRY_MS = 1000 // how often a server that is gone is asked for

export function render({ model, view }) {
  const banner = document.createElement("div")
  banner.className = "gone"
  banner.setAttribute("role", "alert")
  banner.hidden = true
  let goal = null, lost = false

  /** A query without what is not gone back to. */
  function lasting(query) {
    const given = new URLSearchParams(query)
    for (const name of model.passing) given.delete(name)
    return given.toString()
  }

  function write() {
    const { query } = model, now = window.location.search
    if (goal === query) goal = null
    if (goal !== null || !query || query === now) return
    const known = new URLSearchParams(now).has("mu") // else the page has just opened
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

  function gone() {
    if (lost) return
    lost = true
    banner.textContent = "Connection lost, trying again. What is in the page still plays."
    banner.hidden = false
    retry()
  }

  async function retry() {
    const asked = new URL("static/js/bokeh.min.js", window.location.href)
    try {
      const answer = await fetch(asked, { method: "HEAD", cache: "no-store" })
      if (answer.ok) return window.location.reload()
    } catch { /* still gone */ }
    setTimeout(retry, RETRY_MS)
  }

  window.addEventListener("popstate", returned)
  window.addEventListener("offline", gone)
  view.model.document.on_event("connection_lost", gone)
  model.on("query", write)
  model.on("remove", () => window.removeEventListener("popstate", returned))
  write()
  return banner
}
