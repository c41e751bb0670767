// Elements of the page, with their properties.

/** An element of this tag with these properties. */
export function createElement(tag, look) { return Object.assign(document.createElement(tag), look) }

/** A button with this text and action. */
export function button(textContent, act, look = {}) {
  const element = createElement("button", { type: "button", textContent, ...look })
  element.addEventListener("click", () => act(element))
  return element
}
