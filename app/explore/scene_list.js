// The list of scenes: choosing one opens its page, with the friction if it was chosen.

import { sceneOptions } from "../browser/scene_options.js"

export function render({ model }) {
  const root = document.createElement("label")
  root.className = "scenelist"
  root.innerHTML = `Scene <select aria-label="Scene">${sceneOptions(model.titles, "Explore")}</select>`
  const list = root.querySelector("select")
  const show = () => {
    list.value = model.shown
    list.querySelector("[value=imported]").hidden = model.shown !== "imported"
  }
  model.on("shown", show)
  show()
  list.addEventListener("change", (event) => {
    const here = new URLSearchParams(window.location.search), there = new URLSearchParams({ scene: event.target.value })
    if (here.has("mu") && Number(here.get("mu")) !== model.usual) there.set("mu", here.get("mu"))
    window.location.assign(`?${there}`)
  })
  return root
}
