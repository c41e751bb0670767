// The player without a server: the model is a plain object, and its plots are those of this file.

import { render } from "../../../packing/player.js"

function unpacked(value) {
  if (value === null || typeof value !== "object" || Array.isArray(value)) return value
  if (value.array) {
    const bytes = Uint8Array.from(atob(value.data), (letter) => letter.charCodeAt(0))
    return new { Int32Array, Float32Array }[value.array](bytes.buffer)
  }
  return Object.fromEntries(Object.entries(value).map(([name, part]) => [name, unpacked(part)]))
}

/** Parameters as properties that notify listeners in the page. */
function standIn(given) {
  const heard = {}
  const on = (names, act) => { for (const name of [names].flat()) (heard[name] ??= []).push(act) }
  const model = { on, send_msg() {} }
  return new Proxy(Object.assign(model, given), {
    set(all, name, value) {
      all[name] = value
      for (const act of heard[name] ?? []) act()
      return true
    },
  })
}

/** given: the parameters; style: of the player. */
export function begin(given, style) {
  const page = window.Bokeh?.documents[0]
  if (!page?.get_model_by_name("bars")) { setTimeout(begin, 30, given, style); return }
  const model = standIn(unpacked(given)), data = {}
  const view = { model: { document: page, data } }
  const shadow = document.getElementById("player").attachShadow({ mode: "open" })
  shadow.append(Object.assign(document.createElement("style"), { textContent: style }))
  shadow.append(render({ model, view }))
  data.player.scene.hand = null // no server computes networks for dragging
  data.player.select() // nor can a button hold a force
  data.player.again()
  // Their marks were drawn before layout.
  for (const { type, change } of page._all_models.values()) if (type === "Legend") setTimeout(() => change.emit(), 100)
}
