// The list of scenes: another one is another page.

export function render({ model }) {
  const root = document.createElement("label")
  root.className = "scenelist"
  root.innerHTML = `Scene <select aria-label="Scene">${model.titles.map(([name, title]) =>
    `<option value="${name}" ${name === model.shown ? "selected" : ""}>${title}</option>`).join("")}</select>`
  root.querySelector("select").addEventListener("change", (event) => {
    window.location.assign(`?scene=${event.target.value}`)
  })
  return root
}
