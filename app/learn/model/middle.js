// Where a scene of many dimensions begins: in the middle of S, about.

const DRAWS = 700

/** The mean of draws from S, far from all of its sides, and the same each time; the body's own point without any. */
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

/** Numbers in [0, 1) that look random, always the same ones: a linear congruential generator. */
function fixed() {
  let state = 1
  return () => (state = (Math.imul(1664525, state) + 1013904223) >>> 0) / 2 ** 32
}
