// The address of the workbench: a scene is a step in the history, friction is not.

export class Address {
  /** opened(query): called after going back or forward to another scene; large: names of scenes that Explore
   * shows. */
  constructor(opened, large) {
    this.returning = false // until the scene in the history is loaded
    this.listener = () => {
      const { search } = window.location
      if ([null, ...large].includes(new URLSearchParams(search).get("scene"))) return window.location.reload()
      this.returning = true
      opened(search)
    }
    window.addEventListener("popstate", this.listener)
  }

  stop() { window.removeEventListener("popstate", this.listener) }

  /** Update the address to the present scene. */
  write({ scene: { name, built }, mu }) {
    if (this.returning) return
    const scene = new URLSearchParams(window.location.search).get("scene"), step = scene && scene !== name
    window.history[step ? "pushState" : "replaceState"](null, "", `?${this.query({ scene: name, mu: String(Number(mu.toPrecision(6))), built })}`)
  }

  query(given) {
    return new URLSearchParams(Object.entries(given).filter(([, value]) => value !== "" && value !== undefined))
  }
}
