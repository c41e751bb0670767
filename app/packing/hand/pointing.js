// Pointer, wheel and touch over the packing: they highlight, select, drag a force, or move the
// view.

const WHEEL = matchMedia("(pointer: fine)") // a finger has none

/** Listen over a Scene. */
export function listen(scene) {
  const { root } = scene, fingers = new Map()
  let moved = 0, taken = null
  // By touch only the selected contact is dragged; otherwise the page scrolls under the finger.
  root.addEventListener("touchstart", (event) => {
    if (event.touches.length === 1 && scene.takenAt(event.touches[0], true) !== null) event.preventDefault()
  }, { passive: false })
  // Without a key or a click the wheel scrolls the page, which would otherwise stop over the
  // packing.
  root.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey && !root.matches(":focus-within")) return
    event.preventDefault()
    scene.zoom(Math.exp(event.deltaY * 0.0015), ...scene.place(event))
  }, { passive: false })
  root.addEventListener("pointerenter", ({ pointerType }) => { if (pointerType === "mouse" && WHEEL.matches) scene.hintAtZoom() }, { once: true })
  root.addEventListener("dblclick", () => scene.reset())
  root.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return
    fingers.set(event.pointerId, scene.place(event))
    root.setPointerCapture(event.pointerId)
    moved = 0
    taken = fingers.size > 1 ? null : scene.takenAt(event, event.pointerType === "touch")
  })
  root.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId), now = scene.place(event)
    if (!before) return scene.hover(...now)
    const step = [now[0] - before[0], now[1] - before[1]]
    const still = moved <= 3
    moved += Math.hypot(...step)
    fingers.set(event.pointerId, now)
    if (moved <= 3) return
    if (taken === null) return scene.drag(fingers, event.pointerId, before, now)
    if (still) scene.hand.takeInScene(taken, ...before)
    scene.hand.moveInScene(...now)
  })
  const end = (event) => {
    if (!fingers.delete(event.pointerId)) return
    if (taken !== null && moved > 3) scene.hand.leave()
    taken = null
    if (event.type === "pointerup" && moved <= 3) scene.pick(...scene.place(event))
  }
  root.addEventListener("pointerup", end)
  root.addEventListener("pointercancel", end)
  root.addEventListener("pointerleave", () => { scene.closeTip(); scene.point(-1) })
}
