// Chains as strokes on a canvas: one by one or, if there are many, all of similar colour and width
// at once.

export const LEAST = 0.1 // px; thinner chains are not drawn
const FINE = 16 // colours; if there are more, gathered chains use every second one

/** lines: the `rows` to draw, their `width` and `bin` of `colours` by row, and ends(row): [xa, ya, xb, yb]. */
export function strokeEach(context, { rows, width, bin, colours, ends }) {
  context.lineCap = "round"
  for (const k of rows) {
    const [xa, ya, xb, yb] = ends(k)
    context.strokeStyle = colours[bin[k]]
    context.lineWidth = width[k]
    context.beginPath()
    context.moveTo(xa, ya)
    context.lineTo(xb, yb)
    context.stroke()
  }
}

/** The same in half the time, with one stroke for each class; scale: px per unit. */
export function strokeByClass(context, { rows, width, bin, colours, ends }, scale) {
  const classes = new Map()
  for (const k of rows) {
    const thickness = Math.round(2 * Math.log2((width[k] * scale) / LEAST)) // half octaves
    const colour = colours.length > FINE ? bin[k] - (bin[k] % 2) : bin[k]
    const key = 64 * colour + thickness
    let path = classes.get(key)
    if (!path) classes.set(key, (path = new Path2D()))
    const [xa, ya, xb, yb] = ends(k)
    path.moveTo(xa, ya)
    path.lineTo(xb, yb)
  }
  context.lineCap = "butt"
  for (const [key, path] of classes) {
    context.strokeStyle = colours[key >> 6]
    context.lineWidth = (LEAST * 2 ** ((key & 63) / 2)) / scale
    context.stroke(path)
  }
}
