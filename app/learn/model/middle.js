// The initial state of a scene of many dimensions: near the centre of S.

const DRAWS = 700

/** The mean of draws from S, far from all of its sides, always the same; without draws the body's own point. */
export function middleOf(body) {
  if (body.empty || !body.h || body.least(body.u) < -1e-6) return body.u
  const random = fixed(), between = Math.ceil(body.h / 2)
  let u = body.u, sum = u.map(() => 0)
  for (let k = 0; k < DRAWS; k++) {
    for (let m = 0; m < between; m++) u = body.step(u, random)
    sum = sum.map((v, d) => v + u[d] / DRAWS)
  }
  return sum
}

/** Pseudo-random numbers in [0, 1), always the same: a linear congruential generator. */
export function fixed() {
  let state = 1
  return () => (state = (Math.imul(1664525, state) + 1013904223) >>> 0) / 2 ** 32
}
