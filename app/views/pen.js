// Lines and circles on a canvas.

/** Draw a straight line from a to b. */
export function line(g, a, b) {
  g.beginPath()
  g.moveTo(...a)
  g.lineTo(...b)
  g.stroke()
}

/** Begin a path through points, closed. */
export function polygon(g, points) {
  g.beginPath()
  for (const point of points) g.lineTo(...point)
  g.closePath()
}

/** Begin a path around a point. */
export function circle(g, [x, y], r) {
  g.beginPath()
  g.arc(x, y, r, 0, 2 * Math.PI)
}
