// Buttons that ask the server for a file and save what comes.

const RATE = 6e6 // bits a second of a movie
const LONGEST_MS = 60000 // of a movie
const SCALE = 2 // pixels of a PNG per pixel of its SVG

export function render({ model, view }) {
  const root = document.createElement("div")
  const plain = (given) => (given instanceof Map ? Object.fromEntries(given) : given)

  const deep = (given) => (given instanceof Map || given?.constructor === Object
    ? Object.fromEntries(Object.entries(plain(given)).map(([name, part]) => [name, deep(part)])) : given)

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

  const player = () => view.model.document.get_model_by_name("player").player

  /** The packing as on screen, drawn by the player: the one place that knows how. */
  function drawn(caption) {
    return new Blob([player().scene.picture(caption)], { type: "image/svg+xml" })
  }

  /** A movie of what plays, from the first state to the last, or once to and fro. */
  async function recorded({ background }, button) {
    const it = player(), { scene } = it, layers = [scene.disks, scene.chains, scene.marks]
    const canvas = document.createElement("canvas")
    canvas.width = canvas.height = scene.disks.canvas.width & ~1
    const context = canvas.getContext("2d"), pieces = []
    const stream = canvas.captureStream(30)
    const recorder = new MediaRecorder(stream, { mimeType: "video/webm", videoBitsPerSecond: RATE })
    recorder.ondataavailable = (event) => pieces.push(event.data)
    const ended = new Promise((resolve) => { recorder.onstop = resolve })
    it.show(0, false)
    it.play(true)
    recorder.start(250)
    const begun = performance.now(), words = button?.textContent
    const frame = (now) => {
      context.fillStyle = background
      context.fillRect(0, 0, canvas.width, canvas.height)
      for (const layer of layers) context.drawImage(layer.canvas, 0, 0)
      if (button) button.textContent = `recording … ${Math.round((now - begun) / 1000)} s`
      const swung = it.replay.swinging && it.direction > 0 && it.turned
      if (it.replay.swinging && it.direction < 0) it.turned = true
      if (!it.playing || swung || now - begun > LONGEST_MS) recorder.stop()
      else requestAnimationFrame(frame)
    }
    it.turned = false
    requestAnimationFrame(frame)
    await ended
    it.play(false)
    if (button) button.textContent = words
    return new Blob(pieces, { type: "video/webm" })
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
    if (file.rest) return rest()
    const caption = file.caption && deep(file.caption)
    const button = root.querySelector(".busy")
    let blob
    if (!caption) blob = new Blob([file.content], { type: file.mime })
    else if (file.name.endsWith(".webm")) blob = await recorded(caption, button)
    else blob = drawn(caption)
    if (caption && file.name.endsWith(".png")) blob = await rendered(blob)
    save(blob, file.name)
    rest()
  }

  function rest() {
    for (const button of root.querySelectorAll(".busy")) button.classList.remove("busy")
  }

  model.on("files", offer)
  model.on("msg:custom", take)
  offer()
  return root
}
