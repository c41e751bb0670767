// Elements of the page, with what they look like.

/** An element of this tag with these properties. */
export function made(tag, look) { return Object.assign(document.createElement(tag), look) }

/** A button with these words that does this. */
export function button(textContent, act, look = {}) {
  const it = made("button", { type: "button", textContent, ...look })
  it.addEventListener("click", () => act(it))
  return it
}
