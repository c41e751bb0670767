// The list of scenes: choosing one opens its page, with the friction if it was chosen.

import { openScene, sceneOptions } from "../browser/scene_options.js"

export function render({ model }) {
  const root = document.createElement("label")
  root.className = "scenelist"
  root.innerHTML = `Scene <select aria-label="Scene">${sceneOptions(model.titles, "Explore")}</select>`
  const list = root.querySelector("select")
  const show = () => { list.value = model.shown }
  model.on("shown", show)
  show()
  list.addEventListener("change", (event) => {
    const mu = new URLSearchParams(window.location.search).get("mu")
    openScene(event.target.value, Number(mu) === model.usual ? null : mu)
  })
  return root
}
