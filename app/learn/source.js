// What chapters show, asked of the server once: scenes, packings, and what is computed of them.

import { ask } from "../browser/send.js"
import { plain } from "../browser/to_object.js"

export class Source {
  constructor(model, view) {
    Object.assign(this, { model, view, promises: new Map(), waiting: new Map() })
    model.on("msg:custom", (news) => this.arrived(plain(news)))
  }

  /** A promise of what is asked for; rejected with the reason where it cannot be had. */
  get(want, name = "") {
    const { model, view } = this, key = `${want} ${name}`
    if (!this.promises.has(key)) {
      this.promises.set(key, new Promise((resolve, reject) => this.waiting.set(key, { resolve, reject })))
      ask(model, view, { want, name })
    }
    return this.promises.get(key)
  }

  arrived({ what, name, given, error }) {
    const key = `${what} ${name}`, waiting = this.waiting.get(key)
    this.waiting.delete(key)
    if (error) {
      this.promises.delete(key) // to be asked for again
      waiting?.reject(new Error(error))
    } else waiting?.resolve(Object.fromEntries(Object.entries(plain(given)).map(([field, value]) => [field, native(value)])))
  }
}

const ARRAYS = [Float64Array, Float32Array, Int32Array, Int8Array, Uint8Array]

/** An array as scripts know it: a part of Bokeh's own kind, by subarray, is the whole of it. */
function native(value) {
  const kind = ARRAYS.find((one) => value instanceof one)
  return kind ? new kind(value) : value
}
