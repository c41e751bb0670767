// The keyboard focus moves to a neighbour when its element is removed, hidden or disabled.

const CONTROLS = "a[href], button, select, summary, input[type=range], [tabindex]" // no fields: they open a touch keyboard
const PLACES = ".scene[tabindex], canvas.packing, h1[tabindex]" // main element of a page
const WATCH_MS = 100

/** Watch the focus on the whole page; returns the function that ends this. */
export function keepFocus() {
  let last = null, around = [] // the element with the focus, and what contains it

  function watch() {
    const now = focused()
    if (now !== document.body && usable(now)) {
      if (now !== last) around = outwards(now)
      last = now
    } else if (last && !usable(last)) {
      for (const part of around.slice(1)) if (part.isConnected && moved(part)) return
    } else last = null // the visitor clicked elsewhere
  }

  function moved(part) {
    const all = [...inside(part)], at = all.indexOf(last), controls = all.filter((one) => one.matches(CONTROLS) && one.tabIndex >= 0)
    const near = [...controls.filter((one) => all.indexOf(one) > at), ...controls.reverse()]
    const next = all.find((one) => one.matches(PLACES) && usable(one)) ?? near.find(usable)
    next?.focus({ preventScroll: true })
    return next && focused() === next
  }

  const timer = setInterval(watch, WATCH_MS), events = ["keydown", "click"] // which can act on the element
  for (const name of events) window.addEventListener(name, watch, true)
  return () => {
    clearInterval(timer)
    for (const name of events) window.removeEventListener(name, watch, true)
  }
}

const usable = (element) => element.isConnected && !element.disabled && element.checkVisibility({ visibilityProperty: true })

/** The element with the focus, inside any shadow root. */
export function focused() {
  let node = document.activeElement ?? document.body
  while (node.shadowRoot?.activeElement) node = node.shadowRoot.activeElement
  return node
}

/** An element and what contains it, from the inside outwards, through shadow roots. */
export function outwards(element) {
  const path = []
  for (let node = element; node; node = node.parentNode ?? node.host) path.push(node)
  return path
}

/** All elements of a part in order, through shadow roots. */
function* inside(part) {
  for (const element of part.shadowRoot ? [part.shadowRoot, ...part.children] : part.children) {
    if (element instanceof Element) yield element
    yield* inside(element)
  }
}
