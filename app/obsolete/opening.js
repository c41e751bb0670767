// The page opens moving: slowly, from the beginning again and again, until somebody touches it; or, where
// a first gesture is to be made, for some seconds. The speed stays what it was: who then plays sees what was
// seen before.

// What a link may hold that opens a page as it is at first.
const PLAIN = ["scene", "mu", "n", "seed", "states", "source", "relax", "packed_mu", "tab", "dark"]
const UNASKED = ["upload", "export"] // tabs that come later to somebody new
const SLOW = 0 // log2 of states per second
const AGAIN_MS = 700 // rest at the end
const FIRST_MS = 6000 // after which it rests, and the first gesture is pointed out

/** Whether the page was opened by a link that shows something of its own. */
export function shown() {
  const asked = new URLSearchParams(location.search)
  return UNASKED.includes(asked.get("tab")) || [...asked.keys()].some((name) => !PLAIN.includes(name))
}

export function openMoving(player) {
  const { model, buttons } = player
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) return
  if (model.frame || model.between || model.predict || player.pushes) return // a link that shows one moment
  buttons.part("speed").value = SLOW
  buttons.tellRate()
  let rests = null // the timer by which it comes to rest
  const again = setInterval(() => {
    if (!player.scene.root.isConnected || player.playing || !player.replay || !model.walk) return
    player.show(0, false)
    player.play(true)
    if (player.opens) rests ??= setTimeout(() => end(() => player.pause(player.replay)), FIRST_MS)
  }, AGAIN_MS)

  player.opens = player.later.waits

  function end(stop) {
    clearInterval(again)
    clearTimeout(rests)
    for (const name of HEARD) window.removeEventListener(name, touched, true)
    player.opens = false
    if (player.playing) stop()
    else player.mark()
  }

  /** The button and Space, which pause, do it themselves. */
  function touched(event) {
    const path = event.composedPath()
    if (path.some((node) => node.classList?.contains("tour"))) return
    const pauses = event.key === " " || path.includes(buttons.part("play"))
    end(() => { if (!pauses) player.play(false) })
  }

  const HEARD = ["pointerdown", "keydown", "wheel"]
  for (const name of HEARD) window.addEventListener(name, touched, true)
}
