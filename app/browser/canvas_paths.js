// Lines, circles and letters on a canvas.

let letters // of the page; read once, as it may trigger a layout

/** A font of this size, such as "bold 12px", in the letters of the page. */
export function font(size) { return `${size} ${letters ??= getComputedStyle(document.body).fontFamily}` }

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
  addPolygon(g, points)
}

/** Add a closed path through points. */
export function addPolygon(g, points) {
  if (g.polygon) return g.polygon(points) // a Sheet
  points.forEach((point, k) => (k ? g.lineTo(...point) : g.moveTo(...point)))
  g.closePath()
}

/** Whether a point is inside a convex polygon with anticlockwise corners. */
export function inside(corners, [px, py]) {
  return corners.every(([x, y], k) => {
    const [u, v] = corners[(k + 1) % corners.length]
    return (u - x) * (py - y) >= (v - y) * (px - x)
  })
}

/** Corners (x, y) from a flat list; null for none. */
export function unflat(flat) {
  return flat?.length ? Array.from({ length: flat.length / 2 }, (_, k) => flat.slice(2 * k, 2 * k + 2)) : null
}

/** Begin a path around a point. */
export function circle(g, [x, y], r) {
  g.beginPath()
  g.arc(x, y, r, 0, 2 * Math.PI)
}

/** Add an arrow from a to b to the path, with an open head of this length and relative width. */
export function arrow(g, a, b, head, wide) {
  const size = Math.hypot(b[0] - a[0], b[1] - a[1]), [ux, uy] = [(b[0] - a[0]) / size, (b[1] - a[1]) / size]
  g.moveTo(...a)
  g.lineTo(...b)
  for (const side of [wide, -wide]) {
    g.moveTo(b[0] - head * (ux - side * uy), b[1] - head * (uy + side * ux))
    g.lineTo(...b)
  }
}
