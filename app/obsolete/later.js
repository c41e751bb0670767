// What a page offers only once the first gesture was made, in this visit or before, or where it is asked
// for by a button: styles say so by --later, and of that button by --sooner.

import { knows, remember } from "../browser/local_storage.js"

export class Later {
  /** gesture: as a browser remembers it; button: shows all at once; now: nothing is to wait. */
  constructor(gesture, button, now = false) {
    this.gesture = gesture
    this.listeners = [] // each called once there is nothing to wait for
    this.waits = this.new = !now && !knows(gesture) // new: nothing was known before this visit, or asked for
    this.tell()
    button.addEventListener("click", () => { this.new = false; this.offer() })
  }

  offer() {
    if (!this.waits) return
    this.waits = false
    remember(this.gesture)
    this.tell()
    for (const listener of this.listeners) listener()
  }

  tell() {
    const { style } = document.documentElement
    for (const [name, value] of [["--later", "none"], ["--unseen", "hidden"], ["--sooner", "inline-block"]]) {
      if (this.waits) style.setProperty(name, value)
      else style.removeProperty(name)
    }
  }
}
