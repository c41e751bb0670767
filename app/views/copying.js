// A button that copies a text, or the address of the page, and says so for a moment.

export function render({ model }) {
  const button = document.createElement("button")
  Object.assign(button, { type: "button", className: "soft" })
  const tell = (text) => { button.textContent = text }
  // Browsers offer a clipboard to pages of this machine and of https only.
  async function copy(text) {
    if (navigator.clipboard) return navigator.clipboard.writeText(text)
    const area = document.createElement("textarea")
    area.value = text
    document.body.append(area)
    area.select()
    document.execCommand("copy")
    area.remove()
  }
  button.addEventListener("click", async () => {
    await copy(model.text || window.location.href)
    tell("copied ✓")
    setTimeout(() => tell(model.label), 1500)
  })
  model.on("label", () => tell(model.label))
  tell(model.label)
  return button
}
