// Buttons that request a file from the server and save it.

import { ask } from "../browser/send.js"
import { composed, plotsSeen, printFigure } from "./composed_figure.js"
import { button, createElement } from "../browser/dom.js"
import { plain } from "../browser/to_object.js"
import { save } from "../browser/download.js"

const RATE = 6e6 // bits per second of a movie
const LONGEST_MS = 60000 // of a movie
const HELD_MS = 500 // hold on the last network at the end of a movie; a shorter one would be lost
const SIDE = 900 // pixels of a movie, equal to the picture whose caption it has
const WHERE = [888, 60] // pixels in its caption, where the number of the network ends
const SCALE = 2 // pixels of a PNG per pixel of its SVG

export function render({ model, view }) {
  const root = document.createElement("div")

  const deep = (given) => (given instanceof Map || given?.constructor === Object
    ? Object.fromEntries(Object.entries(plain(given)).map(([name, part]) => [name, deep(part)])) : given)

  function offer() {
    root.replaceChildren()
    for (const [heading, files] of Object.entries(plain(model.files))) {
      const group = document.createElement("section")
      if (heading) group.append(createElement("h4", { textContent: heading }))
      for (const [key, words] of Object.entries(plain(files))) group.append(button(words, () => request(key), { className: `soft ${key}` }))
      root.append(group)
    }
  }

  /** Request a file of the network at which a player in motion comes to rest. */
  function request(key) {
    if (player().playing) player().play(false)
    ask(model, view, { key })
  }

  const player = () => view.model.document.get_model_by_name("player").player

  /** The packing as on screen, drawn by the player, the only place that can do it. */
  function drawn(caption) {
    return new Blob([player().picture(caption)], { type: "image/svg+xml" })
  }

  /** A movie of the animation, from the first state to the last, or once to and fro. */
  async function recorded(caption, button) {
    const stage = player(), { scene } = stage, layers = [scene.disks, scene.chains, scene.marks]
    const { position } = stage.replay, picture = await imageOf(drawn(caption)), height = picture.naturalHeight - SIDE
    const canvas = createElement("canvas", { width: SIDE, height: (SIDE + height) & ~1 })
    const context = canvas.getContext("2d"), pieces = []
    const stream = canvas.captureStream(30)
    const recorder = new MediaRecorder(stream, { mimeType: "video/webm", videoBitsPerSecond: RATE })
    recorder.ondataavailable = (event) => pieces.push(event.data)
    const ended = new Promise((resolve) => { recorder.onstop = resolve })
    const { view } = scene
    scene.reset(false) // whole, like the scale in its caption
    scene.finer(SIDE)
    stage.show(0, false)
    stage.play(true)
    recorder.start(250)
    const begun = performance.now(), words = button.textContent
    let over // time at which the last network was shown
    const frame = (now) => {
      context.fillStyle = caption.background
      context.fillRect(0, 0, canvas.width, canvas.height)
      for (const layer of layers) context.drawImage(layer.canvas, 0, 0)
      context.drawImage(picture, 0, SIDE, SIDE, height, 0, SIDE, SIDE, height)
      context.fillStyle = caption.ink
      context.font = "15px Helvetica, Arial, sans-serif"
      context.textAlign = "right"
      context.fillText(stage.replay.title, WHERE[0], SIDE + WHERE[1])
      button.textContent = `recording … ${Math.round((now - begun) / 1000)} s`
      const swung = stage.replay.swinging && stage.playback.turns > 1
      if (!stage.playing || swung) over ??= now
      if ((now - over > HELD_MS && pieces.some(({ size }) => size)) || now - begun > LONGEST_MS) recorder.stop()
      else requestAnimationFrame(frame)
    }
    requestAnimationFrame(frame)
    await ended
    const duration = performance.now() - begun
    stage.play(false)
    scene.view = view // as it was on screen
    scene.size = 0
    scene.resize()
    stage.show(position)
    button.textContent = words
    return timed(new Blob(pieces, { type: "video/webm" }), duration)
  }

  async function imageOf(svg) {
    const image = new Image()
    image.src = URL.createObjectURL(svg)
    await image.decode()
    URL.revokeObjectURL(image.src)
    return image
  }

  async function rendered(svg) {
    const image = await imageOf(svg)
    const canvas = createElement("canvas", { width: SCALE * image.naturalWidth, height: SCALE * image.naturalHeight })
    canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height)
    return new Promise((resolve) => canvas.toBlob(resolve, "image/png"))
  }

  async function take(message) {
    if (!root.isConnected) return // from an earlier rendering
    const file = plain(message), caption = file.caption && deep(file.caption)
    if (file.width) return together(file, caption)
    let blob
    if (!caption) blob = new Blob([file.content], { type: file.mime })
    else if (file.name.endsWith(".webm")) blob = await recorded(caption, root.querySelector(".webm"))
    else blob = drawn(caption)
    if (caption && file.name.endsWith(".png")) blob = await rendered(blob)
    save(blob, file.name)
  }

  /** Packing and plots as one figure, to save or print. */
  async function together({ name, width }, caption) {
    const plots = await plotsSeen(view.model.document), packing = player().picture(caption)
    const figure = composed(packing, plots, width, caption.background)
    if (name.endsWith(".pdf")) printFigure(figure, width)
    else save(new Blob([figure.text], { type: "image/svg+xml" }), name)
  }

  model.on("files", offer)
  model.on("msg:custom", take)
  offer()
  return root
}

// Recorders do not write the duration, without which players cannot seek.

const INFO = [0x15, 0x49, 0xa9, 0x66], DURATION = [0x44, 0x89, 0x88] // EBML: ids, and 8 bytes that follow

/** A WebM with its duration (ms) in its Info element; unchanged if that is not found. */
async function timed(movie, duration) {
  const bytes = new Uint8Array(await movie.arrayBuffer())
  const at = bytes.subarray(0, 1000).findIndex((_, k) => INFO.every((byte, n) => bytes[k + n] === byte))
  const size = bytes[at + 4] & 0x7f // one byte long, marked by its highest bit
  if (at < 0 || !(bytes[at + 4] & 0x80) || size === 0x7f) return movie
  const written = new DataView(new ArrayBuffer(8)), longer = new DataView(new ArrayBuffer(8)), end = at + 5 + size
  written.setFloat64(0, duration)
  longer.setBigUint64(0, (1n << 56n) | BigInt(size + DURATION.length + 8)) // a size of eight bytes
  const parts = [
    bytes.subarray(0, at + 4), longer, bytes.subarray(at + 5, end), new Uint8Array(DURATION), written, bytes.subarray(end),
  ]
  return new Blob(parts, { type: movie.type })
}
