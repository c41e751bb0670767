// Motion: whether the visitor asks for less of it, STILL.matches; and moving over to new values.

export const STILL = matchMedia("(prefers-reduced-motion: reduce)")

const PART = 0.3, ARRIVED = 1e-3 // of the way, per frame; the largest distance at which it ends

/** Values on the way from those shown to others: these themselves once they are near, or if nothing can be between. */
export function eased(shown, values) {
  if (STILL.matches || shown?.length !== values.length) return values
  const next = shown.map((v, k) => v + PART * (values[k] - v))
  return next.every((v, k) => Math.abs(values[k] - v) < ARRIVED) ? values : next
}
