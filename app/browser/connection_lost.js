// Where the server is gone, that is said; when there is one again, the page opens anew with its
// address, which holds the view.

import { made } from "./dom.js"

const RETRY_MS = 1000 // how often a server that is gone is asked for

/** The banner that says so; still: what goes on meanwhile. */
export function goneBanner(view, still) {
  const banner = made("div", { className: "gone", role: "alert", hidden: true })
  let lost = false

  function gone() {
    if (lost) return
    lost = true
    for (const data of wishes()) data.wish = undefined // until now the server heard of them
    banner.textContent = `Connection lost, trying again. ${still}`
    banner.hidden = false
    retry()
  }

  /** What sliders of μ hold of it, see friction.js. */
  function wishes() {
    return [...view.model.document._all_models.values()].map(({ data }) => data)
      .filter((data) => data?.wish !== undefined)
  }

  /** The same view, with the μ that was asked for meanwhile. */
  function reopen() {
    const address = new URL(window.location.href), [asked] = wishes()
    if (asked) address.searchParams.set("mu", asked.wish)
    window.history.replaceState(null, "", address)
    window.location.reload()
  }

  async function retry() {
    const asked = new URL("static/js/bokeh.min.js", window.location.href)
    try {
      const answer = await fetch(asked, { method: "HEAD", cache: "no-store" })
      if (answer.ok) return reopen()
    } catch { /* still gone */ }
    setTimeout(retry, RETRY_MS)
  }

  window.addEventListener("offline", gone)
  view.model.document.on_event("connection_lost", gone)
  return banner
}
