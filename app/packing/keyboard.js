// The keys of the player, active wherever the focus is, unless the focused element uses them
// itself.

const HELD = { "[": "less", "]": "more", z: "undo", Z: "undo", Escape: "free", h: "hold", H: "hold" }
const KEYS = {
  ArrowRight: "step", ArrowLeft: "back", Home: "restart", End: "end", n: "next", N: "previous",
}

export class Keyboard {
  /** Call actions by name while the element `root` is on the page. */
  constructor(root, actions) {
    this.root = root
    this.actions = actions
    // Before the focused widget: a clicked widget keeps the focus, but Space and arrows then
    // control the player again. After Tab they control the widget.
    this.tabbed = false
    this.onKey = (event) => this.press(event)
    this.onPointer = () => { this.tabbed = false }
    window.addEventListener("keydown", this.onKey, true)
    window.addEventListener("pointerdown", this.onPointer, true)
  }

  remove() {
    window.removeEventListener("keydown", this.onKey, true)
    window.removeEventListener("pointerdown", this.onPointer, true)
  }

  press(event) {
    if (!this.root.isConnected) return this.remove()
    if (event.key === "Tab") this.tabbed = true
    const at = event.composedPath()[0]
    if (typing(at) || event.ctrlKey || event.metaKey || event.altKey) return
    const used = { space: usesSpace(at, this.tabbed), arrows: usesArrows(at, this.tabbed) }
    const name = KEYS[event.key]
    if (event.key === " " && !used.space) this.actions.play()
    else if (name && !used.arrows) this.actions[name]()
    else if (HELD[event.key]) return this.actions[HELD[event.key]]()
    else if (/^[1-9]$/.test(event.key)) this.actions.tab(Number(event.key))
    else return
    event.preventDefault()
    event.stopPropagation()
  }
}

// Keys that the focused element uses itself

function typing(at) {
  return at.isContentEditable || /^(TEXTAREA|SELECT)$/.test(at.tagName) ||
    (at.tagName === "INPUT" && !["range", "checkbox", "radio", "button"].includes(at.type))
}

const chosen = (at) => at.ariaSelected === "true" || at.ariaPressed === "true"
const inMenu = (at) => ["option", "menuitem", "listbox", "menu"].includes(at.role)

/** An active tab or a chosen option has no use for it. */
function usesSpace(at, tabbed) {
  if (inMenu(at)) return true
  const pressed = at.tagName === "BUTTON" || at.tagName === "A" || at.type === "checkbox" ||
    ["combobox", "tab", "button", "switch"].includes(at.role)
  return pressed && tabbed && !chosen(at)
}

function usesArrows(at, tabbed) {
  if (inMenu(at) || at.type === "range") return true
  return tabbed && ["tab", "combobox", "radio"].includes(at.role)
}
