// A walk through S by itself: from one draw to the next in a straight line, which lies in S.

const LEG_MS = 450
const PATH = 60 // corners of its path that are kept

export class RandomWalk {
  /** button: it begins and ends a walk; moved(path): another point of it is on screen. */
  constructor(button, moved) { Object.assign(this, { button, moved, frame: null }) }

  pause() {
    if (this.frame) cancelAnimationFrame(this.frame)
    this.frame = null
    this.show()
  }

  show() {
    this.button.textContent = this.frame ? "Stop" : "Random walk"
    this.button.classList.toggle("on", Boolean(this.frame))
  }

  toggle(body) {
    if (this.frame) return this.pause()
    if (body.empty || !body.h) return
    let from = body.u, to = body.step(from), begun = performance.now(), path = [body.u, body.u]
    const go = (time) => {
      const part = Math.max(0, Math.min(1, (time - begun) / LEG_MS))
      body.u = from.map((v, k) => v + part * (to[k] - v))
      path[path.length - 1] = body.u
      if (part === 1) {
        from = to
        to = body.step(from)
        begun = time
        path = [...path, from].slice(-PATH)
      }
      this.moved(path)
      this.frame = requestAnimationFrame(go)
    }
    this.frame = requestAnimationFrame(go)
    this.show()
  }
}
