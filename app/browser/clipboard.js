// The clipboard, which browsers offer only to pages of this machine and of https.

import { made } from "./dom.js"

/** Copy a text. */
export async function copy(text) {
  if (navigator.clipboard) return navigator.clipboard.writeText(text)
  const area = made("textarea", { value: text })
  document.body.append(area)
  area.select()
  document.execCommand("copy")
  area.remove()
}
