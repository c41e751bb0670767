// An automatic walk through S: straight from one draw to the next, which stays in S.

const LEG_MS = 450
const PATH = 60 // stored corners of its path

export class RandomWalk {
  /** button: starts and stops the walk; moved(path): called with each new point. */
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
