// Buttons that request a file from the server and save it.

import { ask, plain } from "../browser/send.js"
import { composed, plotsSeen, printFigure } from "./composed_figure.js"
import { button, createElement } from "../browser/dom.js"
import { save } from "../browser/download.js"
import { recorded } from "../browser/movie.js"

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

  /** A movie of the animation, from the first state to the last. */
  async function filmed(caption, button) {
    const stage = player(), { scene } = stage, layers = [scene.disks, scene.chains, scene.marks]
    const { position } = stage.replay, picture = await imageOf(drawn(caption)), height = picture.naturalHeight - SIDE
    const canvas = createElement("canvas", { width: SIDE, height: (SIDE + height) & ~1 })
    const context = canvas.getContext("2d"), { view } = scene, words = button.textContent
    scene.reset(false) // whole, like the scale in its caption
    scene.finer(SIDE)
    stage.show(0, false)
    stage.play(true)
    const movie = await recorded(canvas, (ms) => {
      context.fillStyle = caption.background
      context.fillRect(0, 0, canvas.width, canvas.height)
      for (const layer of layers) context.drawImage(layer.canvas, 0, 0)
      context.drawImage(picture, 0, SIDE, SIDE, height, 0, SIDE, SIDE, height)
      context.fillStyle = caption.ink
      context.font = "15px Helvetica, Arial, sans-serif"
      context.textAlign = "right"
      context.fillText(stage.replay.title, WHERE[0], SIDE + WHERE[1])
      button.textContent = `recording … ${Math.round(ms / 1000)} s`
      return !stage.playing
    }, "video/webm")
    stage.play(false)
    scene.view = view // as it was on screen
    scene.size = 0
    scene.resize()
    stage.show(position)
    button.textContent = words
    return movie
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
    else if (file.name.endsWith(".webm")) blob = await filmed(caption, root.querySelector(".webm"))
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
