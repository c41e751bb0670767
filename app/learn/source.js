// Data for chapters, requested from the server once: scenes, packings, and computed results.

import { ask, plain } from "../browser/send.js"

export class Source {
  constructor(model, view) {
    Object.assign(this, { model, view, promises: new Map(), waiting: new Map() })
    model.on("msg:custom", (news) => this.arrived(plain(news)))
  }

  /**
   * A promise of the requested data; rejected with the reason if they are not available. network: the forces that
   * they depend on, all normal and then all tangential ones; such data are not kept.
   */
  get(want, name = "", network = null) {
    const { model, view } = this, key = `${want} ${name}`
    if (network || !this.promises.has(key)) {
      this.promises.set(key, new Promise((resolve, reject) => this.waiting.set(key, { resolve, reject })))
      ask(model, view, network ? { want, name, network } : { want, name })
    }
    return this.promises.get(key)
  }

  arrived({ what, name, given, error }) {
    const key = `${what} ${name}`, waiting = this.waiting.get(key)
    this.waiting.delete(key)
    if (error) {
      this.promises.delete(key) // allows another request
      waiting?.reject(new Error(error))
    } else waiting?.resolve(Object.fromEntries(Object.entries(plain(given)).map(([field, value]) => [field, native(value)])))
  }
}

const ARRAYS = [Float64Array, Float32Array, Int32Array, Int8Array, Uint8Array]

/** A plain copy of an array: Bokeh's own array type ignores subarray. */
function native(value) {
  const kind = ARRAYS.find((one) => value instanceof one)
  return kind ? new kind(value) : value
}
