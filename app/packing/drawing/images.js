// Disks and contacts at all places where they are seen: in the periodic cell, and in a strip around it.

/** The number of contacts of each grain. */
export function touching({ radius, i, j }) {
  const count = new Int32Array(radius.length)
  for (const grain of [...i, ...j]) count[grain]++
  return count
}

/**
 * A packing, as `frames` in player.py, with a row for each visible disk, and for each visible line of a contact with
 * its grains i and j; those in the cell come first.
 */
export function withImages(packing) {
  const { box: [wide, high], tilt, centres, radius, starts, reach, unit } = packing, touches = touching(packing)
  const drawn = { touching: touches }
  for (const name of ["x", "y", "r", "grain", "kind", "x0", "y0", "x1", "y1", "contact", "i", "j"]) drawn[name] = []
  // In a tilted cell: distances from its sides b and a; x and y in a straight one.
  const narrow = tilt ? high / Math.hypot(tilt, high) : 1, across = (x, y) => (tilt ? x - (tilt * y) / high : x) * narrow
  const visible = (low, up, side) => side < 0 || (up > -unit && low < side + unit) // below 0: open
  const steps = (side) => (side < 0 ? [0] : side > 3 * unit ? [0, -1, 1] : [0, -1, 1, -2, 2])
  for (const s of steps(wide * narrow)) for (const t of steps(high)) {
    const a = s * wide + t * tilt, b = t && t * high, image = s || t ? 2 : 0
    for (let g = 0; 2 * g < centres.length; g++) {
      const x = centres[2 * g] + a, y = centres[2 * g + 1] + b, r = radius[g], at = across(x, y)
      if (!visible(at - r, at + r, wide * narrow) || !visible(y - r, y + r, high)) continue
      drawn.x.push(x); drawn.y.push(y); drawn.r.push(r); drawn.grain.push(g)
      drawn.kind.push(image + (touches[g] ? 0 : 1)) // row of the colours of disks
    }
    for (let c = 0; c < packing.i.length; c++) {
      const x0 = starts[2 * c] + a, y0 = starts[2 * c + 1] + b, x1 = x0 + reach[2 * c], y1 = y0 + reach[2 * c + 1]
      const at = across(x0, y0), to = across(x1, y1)
      if (!visible(Math.min(at, to), Math.max(at, to), wide * narrow)) continue
      if (!visible(Math.min(y0, y1), Math.max(y0, y1), high)) continue
      drawn.x0.push(x0); drawn.y0.push(y0); drawn.x1.push(x1); drawn.y1.push(y1)
      drawn.contact.push(c); drawn.i.push(packing.i[c]); drawn.j.push(packing.j[c])
    }
  }
  return { ...packing, ...drawn }
}
