// What the picture shows, in sentences: told anew as it changes, and what was opened stays open.

export function render({ model }) {
  const root = document.createElement("div"), more = document.createElement("details")
  const first = document.createElement("div"), rest = document.createElement("div")
  more.append(Object.assign(document.createElement("summary"), { textContent: model.question }), rest)
  root.append(first, more)
  const tell = () => {
    first.innerHTML = model.first
    rest.innerHTML = model.rest
    more.hidden = !model.rest
  }
  for (const name of ["first", "rest"]) model.on(name, tell)
  tell()
  return root
}
