// A canvas that is painted every frame. Static parts are painted once, on a separate canvas that is
// copied; it is opaque, which halves the work of a browser without a graphics card.

export class Easel {
  constructor(canvas) {
    this.canvas = canvas
    this.ratio = window.devicePixelRatio || 1 // pixels of the canvas per pixel of the page
    this.still = document.createElement("canvas")
    this.g = canvas.getContext("2d", { alpha: false })
    this.measure()
  }

  /** Size in CSS pixels; read once before each frame, as it may trigger a layout. */
  measure() { ({ clientWidth: this.wide, clientHeight: this.high } = this.canvas) }

  /** The position of an event on it. */
  at(event) {
    const box = this.canvas.getBoundingClientRect()
    return [event.clientX - box.left, event.clientY - box.top]
  }

  /** A frame with its static parts, which `paint` repaints when a value of `key` changes. */
  begin(paper, key, paint) {
    const { ratio } = this, size = [this.wide, this.high].map((v) => Math.max(1, Math.round(v * ratio)))
    const whole = [paper, ...size, ...key], visible = this.g
    if (!this.key || whole.some((value, k) => value !== this.key[k])) {
      this.key = whole
      for (const canvas of [this.canvas, this.still]) [canvas.width, canvas.height] = size
      this.g = this.still.getContext("2d", { alpha: false })
      this.g.setTransform(ratio, 0, 0, ratio, 0, 0)
      this.g.fillStyle = paper
      this.g.fillRect(0, 0, this.wide, this.high)
      paint()
      this.g = visible
    }
    visible.setTransform(1, 0, 0, 1, 0, 0)
    visible.drawImage(this.still, 0, 0)
    visible.setTransform(ratio, 0, 0, ratio, 0, 0)
  }
}
