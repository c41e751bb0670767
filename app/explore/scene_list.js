// The list of scenes: choosing one opens it, with the friction if it was chosen; those of Learn have
// another page.

import { ask } from "../browser/send.js"
import { sceneOptions, sceneQuery } from "../browser/scene_options.js"

export function render({ model, view }) {
  const root = document.createElement("label")
  root.className = "scenelist"
  root.innerHTML = `Scene <select aria-label="Scene">${sceneOptions(model.titles, "Explore")}</select>`
  const list = root.querySelector("select")
  const show = () => { list.value = model.shown }
  model.on("shown", show)
  show()
  list.addEventListener("change", (event) => {
    const mu = new URLSearchParams(window.location.search).get("mu")
    const { value } = event.target, query = sceneQuery(value, Number(mu) === model.usual ? null : mu)
    if (model.titles.some(([name, , page]) => name === value && page === "Explore")) ask(model, view, { query })
    else window.location.assign(query)
  })
  return root
}
