// How far a reader is: predictions and finished chapters, as this browser remembers them.

const KEY = "granforce.learn"

export class Progress {
  constructor() {
    try { this.chapters = JSON.parse(localStorage.getItem(KEY)) ?? {} } catch { this.chapters = {} }
  }

  /** {prediction, done} of a chapter. */
  of(name) { return this.chapters[name] ?? { prediction: null, done: false } }

  set(name, more) {
    this.chapters[name] = { ...this.of(name), ...more }
    try { localStorage.setItem(KEY, JSON.stringify(this.chapters)) } catch { /* a private window */ }
  }
}
