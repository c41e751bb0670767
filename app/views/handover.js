// Buttons that ask the server for a file and save what comes.

const SCALE = 2 // pixels of a PNG per pixel of its SVG

export function render({ model, view }) {
  const root = document.createElement("div")
  const plain = (given) => (given instanceof Map ? Object.fromEntries(given) : given)

  function button(key, words) {
    const made = document.createElement("button")
    made.type = "button"
    made.textContent = words
    made.dataset.key = key
    made.addEventListener("click", () => {
      made.classList.add("busy")
      ask(model, view, { key })
    })
    return made
  }

  function offer() {
    root.replaceChildren()
    for (const [heading, files] of Object.entries(plain(model.files))) {
      const group = document.createElement("section")
      group.append(Object.assign(document.createElement("h4"), { textContent: heading }))
      for (const [key, words] of Object.entries(plain(files))) group.append(button(key, words))
      root.append(group)
    }
  }

  function save(blob, name) {
    const link = document.createElement("a")
    link.href = URL.createObjectURL(blob)
    link.download = name
    link.click()
    setTimeout(() => URL.revokeObjectURL(link.href), 10000)
  }

  async function rendered(svg) {
    const image = new Image()
    image.src = URL.createObjectURL(svg)
    await image.decode()
    const canvas = document.createElement("canvas")
    canvas.width = SCALE * image.naturalWidth
    canvas.height = SCALE * image.naturalHeight
    canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height)
    URL.revokeObjectURL(image.src)
    return new Promise((resolve) => canvas.toBlob(resolve, "image/png"))
  }

  async function take(message) {
    if (!root.isConnected) return // of an earlier rendering
    const file = plain(message)
    const blob = new Blob([file.content], { type: file.mime })
    save(file.png ? await rendered(blob) : blob, file.name)
    for (const button of root.querySelectorAll(".busy")) button.classList.remove("busy")
  }

  model.on("files", offer)
  model.on("msg:custom", take)
  offer()
  return root
}
