// Where a scene of many dimensions begins: in the middle of S, about.

/** Put the point at the mean of draws from S: far from all of its sides, and the same each time. */
export function toMean(space) {
  const { body } = space
  space.fill(fixed())
  const { dots } = space
  space.dots = []
  if (dots.length) body.u = body.u.map((_, k) => dots.reduce((sum, u) => sum + u[k], 0) / dots.length)
}

/** Numbers in [0, 1) that look random, always the same ones: a linear congruential generator. */
function fixed() {
  let state = 1
  return () => (state = (Math.imul(1664525, state) + 1013904223) >>> 0) / 2 ** 32
}
