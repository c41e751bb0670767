// The exact intervals of all normal forces in a small scene, and where each force is in its own.

class Bars {
  constructor(host) { this.host = host }

  /** ends: [least, largest] of each contact, known otherwise where S is not drawn whole. */
  draw(body, lit, ends) {
    const { host } = this
    host.hidden = body.empty
    if (body.empty) return
    if (host.children.length !== body.count) {
      host.innerHTML = Array.from({ length: body.count }, (_, c) => `
        <div role="listitem" data-contact="${c}"><span class="label"></span><span class="rail"><i class="span"></i><i class="dot"></i></span><span class="value"></span></div>`).join("")
    }
    const F = body.forces(), both = Array.from({ length: body.count }, (_, c) => (body.whole ? body.interval(2 * c) : ends?.[c] ?? [NaN, NaN]))
    const finite = [...both.flat().filter(Number.isFinite), ...F.filter((_, k) => k % 2 === 0)]
    const most = Math.max(...finite, 1e-9) * 1.1, at = (v) => `${(100 * Math.min(v, most)) / most}%`
    ;[...host.children].forEach((row, c) => {
      const [low, high] = both[c], value = F[2 * c], part = (name) => row.querySelector(name)
      row.classList.toggle("lit", lit.has(c))
      part(".label").textContent = `fₙ ${body.scene.names[c]}`
      part(".span").hidden = Number.isNaN(low)
      part(".span").style.left = at(low)
      part(".span").style.right = `${100 - (100 * Math.min(high, most)) / most}%`
      part(".dot").style.left = at(value)
      const range = Number.isNaN(low) ? "" : ` in ${number(low)} … ${Number.isFinite(high) ? number(high) : "∞"}`
      part(".value").textContent = `${number(value)}${range}`
    })
  }
}
