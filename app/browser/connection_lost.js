// Reports a lost connection; when the server is available again, the page reloads its address,
// which holds the view.

import { createElement } from "./dom.js"

const RETRY_MS = 1000 // time between two requests to a missing server

/** The banner that reports it; still: what continues to work meanwhile. */
export function connectionBanner(view, still) {
  const banner = createElement("div", { className: "gone", role: "alert", hidden: true })
  let lost = false

  function lose() {
    if (lost) return
    lost = true
    for (const data of wishes()) data.wish = undefined // until now the server received them
    banner.textContent = `Connection lost, trying again. ${still}`
    banner.hidden = false
    retry()
  }

  /** The sliders of μ that hold it, see friction_slider.js. */
  function wishes() {
    return [...view.model.document._all_models.values()].map(({ data }) => data)
      .filter((data) => data?.wish !== undefined)
  }

  /** The same view, with the μ chosen meanwhile. */
  function reopen() {
    const address = new URL(window.location.href), [slider] = wishes()
    if (slider) address.searchParams.set("mu", slider.wish)
    window.history.replaceState(null, "", address)
    window.location.reload()
  }

  async function retry() {
    const address = new URL("static/js/bokeh.min.js", window.location.href)
    try {
      const answer = await fetch(address, { method: "HEAD", cache: "no-store" })
      if (answer.ok) return reopen()
    } catch { /* still missing */ }
    setTimeout(retry, RETRY_MS)
  }

  window.addEventListener("offline", lose)
  view.model.document.on_event("connection_lost", lose)
  return banner
}
