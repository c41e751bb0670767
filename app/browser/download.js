// Hands results to the browser: saves a file, or prints a page.

import { createElement } from "./dom.js"

/** Save a blob as a file of this name. */
export function save(blob, name) {
  const link = createElement("a", { href: URL.createObjectURL(blob), download: name })
  link.click()
  setTimeout(() => URL.revokeObjectURL(link.href), 10000)
}

/** The same for bytes in base64. */
export function saveBytes(text, name) {
  save(new Blob([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))]), name)
}

/** Print an HTML document alone; title: its title, for screen readers. */
export function print(title, html) {
  const sheet = createElement("iframe", { title, srcdoc: html, style: "position: fixed; width: 0; height: 0; border: 0" })
  sheet.addEventListener("load", () => {
    sheet.contentWindow.addEventListener("afterprint", () => sheet.remove())
    sheet.contentWindow.print()
  })
  document.body.append(sheet)
}
