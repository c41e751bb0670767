// The reader's progress: predictions and finished chapters, stored in this browser.

const KEY = "granforce.predictions"

export class Progress {
  constructor() {
    try { this.chapters = JSON.parse(localStorage.getItem(KEY)) ?? {} } catch { this.chapters = {} }
  }

  /** {prediction, answer, done} of a chapter. */
  of(name) { return this.chapters[name] ?? { prediction: null, done: false } }

  set(name, more) {
    this.chapters[name] = { ...this.of(name), ...more }
    try { localStorage.setItem(KEY, JSON.stringify(this.chapters)) } catch { /* a private window */ }
  }
}
