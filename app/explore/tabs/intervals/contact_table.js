// A table of all contacts: present forces, possible forces, known forces. It reads from the player,
// not the server, and only while it is open; rows hidden by a filter are dim in the packing.

import { named, unsigned } from "../../../packing/drawing/chain_style.js"

const ROWS = 200 // of a page
const AGAIN_MS = 250 // between two updates during motion
const NUMBER = (value) => value === Infinity ? "∞" : Number.isFinite(value) ? unsigned(value.toFixed(3)) : "–"
const interval = (of) => [
  ["least", (on, c) => on[of].low?.[c], NUMBER],
  ["largest", (on, c) => on[of].high?.[c], NUMBER],
  ["ΔFₙ", (on, c) => on[of].high?.[c] - on[of].low?.[c], NUMBER],
]
// Groups of columns [heading, columns], and of each column: heading, value for contact c, its format. The heading of
// a group may depend on the player's look.
const GROUPS = [
  ["", [
    ["contact", (on, c) => on.walk.backbone[c], (number, on, c) => `${number}${on.known.has(c) ? " held" : ""}`],
    ["disks", (on, c) => on.pairs[c][0], (_, on, c) => on.pairs[c].join("–")],
  ]],
  ["on screen", [
    ["fₙ", (on, c) => on.mixed.normal[c], NUMBER],
    ["fₜ", (on, c) => on.mixed.tangential[c], NUMBER],
  ]],
  [(look) => `interval of fₙ, ${look.bounds}`, interval("exact")],
  [(look) => `interval of fₙ, ${look.seen}`, interval("walk")],
]
const COLUMNS = GROUPS.flatMap(([, columns]) => columns)
// The column by which the table is sorted, at first fₙ. Tabs draw their views anew each time, and a page has one table.
const sorted = { by: 2, down: true }

export function render({ model, view }) {
  const root = document.createElement("details"), page = view.model.document
  root.innerHTML = `<summary>All contacts as a table</summary>
    <div class="filters">
      <label>number of contact or disk <input class="find" inputmode="numeric"></label>
      <label>fₙ at least <input class="least" type="number" step="0.1" min="0"> × the mean force</label>
      <span class="pages"><button type="button" class="soft earlier">previous ${ROWS}</button>
        <button type="button" class="soft later">next ${ROWS}</button></span>
    </div>
    <p class="status" role="status"></p>
    <div class="frame"><table><thead></thead><tbody></tbody></table></div>`
  const part = (name) => root.querySelector(name), body = part("tbody")
  const player = () => page.get_model_by_name("player")?.player
  let from = 0, pending = 0, shown = [], headed = ""

  /** The data for the columns. */
  function now() {
    const on = player(), { replay, look } = on, { walk, mixed } = replay
    const pairs = Array.from(walk.i, (i, c) => [i, walk.j[c]].map((grain) => named(grain, walk)))
    return { walk, mixed, pairs, known: new Set(on.pins.pins.contacts ?? []), exact: look.exact ?? {} }
  }

  function fits(on, c) {
    const wanted = part(".find").value.trim(), least = Number(part(".least").value) || 0
    if (on.mixed.normal[c] < least) return false
    return !wanted || [on.walk.backbone[c], ...on.pairs[c]].some((number) => String(number) === wanted)
  }

  function fill() {
    if (!root.open || !player()?.replay) return
    const on = now(), value = COLUMNS[sorted.by][1], sign = sorted.down ? -1 : 1
    const all = Array.from(on.mixed.normal.keys()), matching = all.filter((c) => fits(on, c))
    matching.sort((a, b) => sign * (value(on, a) - value(on, b)) || a - b)
    from = Math.min(from, ROWS * Math.floor(Math.max(0, matching.length - 1) / ROWS))
    shown = matching.slice(from, from + ROWS)
    part(".pages").hidden = matching.length <= ROWS
    part(".earlier").disabled = from === 0
    part(".later").disabled = from + ROWS >= matching.length
    part(".status").textContent = `${matching.length} of ${all.length} contacts` +
      (matching.length > ROWS ? `, rows ${from + 1} to ${from + shown.length} are shown` : "") +
      `; forces in mean forces; seen: in ${on.walk.room ? "the networks so far" : `all ${on.walk.states} networks`}; ` +
      "a heading sorts the table, “Sort bars” the bars above"
    heads()
    const chosen = player().model.contact
    body.innerHTML = shown.map((c) => `<tr tabindex="0" data-contact="${c}" aria-selected="${c === chosen}">` +
      COLUMNS.map(([, read, write]) => `<td>${write(read(on, c), on, c)}</td>`).join("") + "</tr>").join("")
    dim(matching.length < all.length ? matching : null, all.length)
  }

  /** Dim the contacts hidden by a filter. */
  function dim(matching, count) {
    const { look } = player(), was = look.only
    look.only = matching && new Uint8Array(count)
    for (const c of matching ?? []) look.only[c] = 1
    if (was || look.only) player().repaint()
  }

  function heads() {
    const look = player()?.look ?? {}
    const groups = GROUPS.map(([words, { length }]) => `<th colspan="${length}" scope="colgroup">${words.call ? words(look) : words}</th>`)
    const html = `<tr>${groups.join("")}</tr><tr>` + COLUMNS.map(([words], k) => {
      const order = k === sorted.by ? (sorted.down ? "descending" : "ascending") : "none"
      return `<th aria-sort="${order}"><button type="button" data-k="${k}">${words}` +
        `${order === "none" ? "" : sorted.down ? " ↓" : " ↑"}</button></th>`
    }).join("")
    if (html !== headed) part("thead").innerHTML = headed = html // otherwise a click or the focus would be lost
  }

  function select(row) {
    player().model.contact = Number(row.dataset.contact)
    for (const other of body.rows) other.setAttribute("aria-selected", String(other === row))
  }

  function turn(rows) {
    from += rows
    fill()
    part(".frame").scrollTop = 0
  }

  const soon = () => { pending ||= setTimeout(() => { pending = 0; fill() }, AGAIN_MS) }
  part("thead").addEventListener("click", ({ target: { dataset } }) => {
    if (dataset.k === undefined) return
    const column = Number(dataset.k)
    sorted.down = column === sorted.by ? !sorted.down : column > 1
    sorted.by = column
    turn(-from)
    part(`[data-k="${column}"]`).focus()
  })
  body.addEventListener("click", ({ target }) => { const row = target.closest("tr"); if (row) select(row) })
  body.addEventListener("keydown", (event) => {
    const row = event.target.closest("tr"), { key } = event
    const next = { ArrowDown: row.nextElementSibling, ArrowUp: row.previousElementSibling }[key]
    if (key === "Enter" || key === " ") select(row)
    else if (next) { next.focus(); select(next) } else if (!key.startsWith("Arrow")) return
    event.preventDefault()
    event.stopPropagation()
  })
  for (const name of [".find", ".least"]) part(name).addEventListener("input", fill)
  part(".earlier").addEventListener("click", () => turn(-ROWS))
  part(".later").addEventListener("click", () => turn(ROWS))
  root.addEventListener("toggle", () => {
    const on = player()
    model.open = root.open
    if (!on) return
    if (root.open) {
      on.listeners.add(soon)
      fill()
    } else { on.listeners.delete(soon); if (on.look) dim(null, 0) }
  })
  const open = () => { root.open = model.open }
  model.on("open", open)
  open()
  model.on("remove", () => player()?.listeners.delete(soon))
  return root
}
