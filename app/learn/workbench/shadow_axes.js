// The two forces onto which S is projected, above three dimensions: chosen in two lists.

export class Axes {
  /** host: contains the lists; chosen(forces): called with both, 2 c for f_n of contact c, 2 c + 1 for f_t. */
  constructor(host, chosen) {
    this.host = host
    this.lists = [...host.querySelectorAll("select")]
    for (const list of this.lists) list.addEventListener("change", () => chosen(this.lists.map(({ value }) => Number(value))))
  }

  /** Offer the forces of a scene, by name(force); returns the initial choice. */
  show({ whole, count }, name) {
    const first = [0, 2 * Math.min(1, count - 1)]
    this.host.hidden = whole
    if (whole) return first
    const offered = Array.from({ length: count }, (_, c) => [2 * c, 2 * c + 1].map((force) => `<option value="${force}">${name(force)}</option>`).join("")).join("")
    this.lists.forEach((list, k) => Object.assign(list, { innerHTML: offered }).value = first[k])
    return first
  }
}
