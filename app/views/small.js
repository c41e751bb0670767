// The page of a small scene: the scene and its S side by side, friction, and what is counted and said.

const MOST_MU = 1.5 // on the slider; larger ones can be typed
const REST_MS = 150 // after which what only the server tells is asked for
const PATH = 60
const NARROW = "(max-width: 759.95px)" // where S lies below the scene
const UNSEEN = "granforce.tour" // remembered in the browser: that the tour was seen

export function render({ model, view }) {
  const root = document.createElement("div")
  root.className = "desk"
  root.innerHTML = `
    <div class="strip">
      <label>Scene <select class="name" aria-label="Scene"></select></label>
      <label class="mu">friction μ <input class="range" type="range" min="0" max="${MOST_MU}" step="0.005" aria-label="friction μ">
        <input class="typed" inputmode="decimal" aria-label="μ"></label>
      <span class="buttons">
        <button type="button" class="play" title="Go at random through S">Walk</button>
        <button type="button" class="fill" title="Networks of S, by a walk that in the end is everywhere equally often">Fill S</button>
        <button type="button" class="undo" title="Take the last pull back (Z)" disabled>Undo</button>
        <button type="button" class="push" title="Drag a disk to push it">Push a disk</button>
        <button type="button" class="save" title="This scene as a file for granforce: gf.load_packing">Save NPZ</button>
        <button type="button" class="tourist">Tour</button>
      </span>
    </div>
    <p class="says" aria-live="polite"></p>
    <div class="pair">
      <figure><figcaption>the scene: forces on each disk, and the wedge (cone) each must stay in</figcaption>
        <canvas class="packing" tabindex="0" role="img" aria-label="Disks, and the force on them at every contact"></canvas></figure>
      <figure><figcaption class="what"></figcaption>
        <canvas class="space" tabindex="0" role="img" aria-label="S: every point is one network of forces. Arrow keys move the point"></canvas></figure>
    </div>
    <p class="count"></p>
    <div class="own" hidden></div>
    <div class="bars" role="list"></div>
    <details class="lesson" hidden><summary>The groove: a lesson of one page, with three questions</summary>
      <button type="button" class="print">Print</button> <button type="button" class="print answered">Print with answers</button>
      <article></article></details>
    <section class="card" role="dialog" aria-labelledby="small-title" hidden>
      <h2 id="small-title" tabindex="-1"></h2><p></p>
      <div class="row"><span class="of"></span><button type="button" class="earlier">Back</button>
        <button type="button" class="next">Next</button><button type="button" class="close">Close</button></div>
    </section>`
  const part = (name) => root.querySelector(`.${name}`)
  const now = { contact: null, disk: null, side: null, contacts: new Set(), fall: null, filled: false, path: [], walk: null, undo: [], push: false, limit: null }
  let body = null, mu = model.scene.mu, waiting = 0, asleep = 0, step = 0

  const builder = new Builder(part("own"), (built) => ask(model, view, { built, mu }))
  const arrows = new Arrows(part("packing"), heard), space = new Space(part("space"), heard)

  // What is seen

  function colours() {
    const dark = model.dark
    return {
      ink: dark ? "#e6e9ee" : "#22272e", paper: dark ? "#181b20" : "#ffffff", edge: dark ? "#7a8798" : "#8fa1b5",
      fill: dark ? "rgba(150,172,200,0.25)" : "rgba(139,160,187,0.3)", lit: dark ? "rgba(150,172,200,0.45)" : "rgba(139,160,187,0.55)",
      cold: dark ? "#5fa2e8" : "#1464c8", warm: "#e8710a", hand: dark ? "#ff5ca8" : "#b5236b", weight: dark ? "#aab4c2" : "#4a5563",
      cone: dark ? "rgba(95,162,232,0.16)" : "rgba(20,100,200,0.12)", coneLit: dark ? "rgba(255,92,168,0.3)" : "rgba(181,35,107,0.22)",
      coneFull: "rgba(232,113,10,0.28)", shade: dark ? "rgba(95,162,232,0.2)" : "rgba(20,100,200,0.14)", state: dark ? "#8fbfee" : "#3d8bd4",
    }
  }

  function paint() {
    waiting = 0
    if (!body || !root.isConnected) return
    const wall = builder.held?.wall === undefined ? [] : builder.walls[builder.held.wall]
    const look = { ...colours(), ...now, wall, dots: now.filled && space.dots.length }
    if (body.scene !== arrows.body?.scene || arrows.wide !== part("packing").clientWidth) {
      arrows.fit(body, body.scene.name === "own" && arrows.own === part("packing").clientWidth)
      arrows.own = body.scene.name === "own" ? part("packing").clientWidth : 0
      arrows.wide = part("packing").clientWidth
    }
    arrows.draw(look)
    if (space.draw(body, look, now.path)) soon()
    bars()
    root.painted = (root.painted ?? 0) + 1
  }

  const soon = () => { waiting ||= requestAnimationFrame(paint) }

  function bars() {
    const host = part("bars")
    if (host.children.length !== body.count) {
      host.innerHTML = Array.from({ length: body.count }, (_, c) => `
        <div role="listitem" data-contact="${c}"><span class="label"></span><span class="rail"><i class="span"></i><i class="dot"></i></span><span class="value"></span></div>`).join("")
    }
    if (body.empty) { host.hidden = true; return }
    host.hidden = false
    const F = body.forces(), ends = Array.from(F.slice(0, body.count), (_, c) => (body.whole ? body.interval(2 * c) : now.bounds?.[c] ?? [NaN, NaN]))
    const finite = [...ends.flat().filter(Number.isFinite), ...F.filter((_, k) => k % 2 === 0)]
    const most = Math.max(...finite, 1e-9) * 1.1
    ;[...host.children].forEach((row, c) => {
      const [low, high] = ends[c], value = F[2 * c], at = (v) => `${(100 * Math.min(v, most)) / most}%`
      row.classList.toggle("lit", now.contacts.has(c))
      row.querySelector(".label").textContent = `fₙ ${body.scene.names[c]}`
      const span = row.querySelector(".span")
      span.hidden = Number.isNaN(low)
      span.style.left = at(low)
      span.style.right = `${100 - (100 * Math.min(high, most)) / most}%`
      row.querySelector(".dot").style.left = at(value)
      const range = span.hidden ? "" : ` in ${number(low)} … ${Number.isFinite(high) ? number(high) : "∞"}`
      row.querySelector(".value").textContent = `${number(value)}${range}`
    })
  }

  const number = (v) => (Math.abs(v) < 5e-4 ? "0" : v.toFixed(Math.abs(v) < 10 ? 3 : 1))

  // What is said

  function words(side) {
    const kinds = new Map()
    for (const [contact, what] of side.stops) {
      const [, disk, place] = body.scene.names[contact].match(/^(disk \d+ )?(.*)$/)
      const verb = `${disk ?? ""}${what === OPENS ? "opens" : `slides${way(contact, what)}`}`
      kinds.set(verb, [...(kinds.get(verb) ?? []), place])
    }
    return [...kinds].map(([verb, places]) => `${verb} ${places.join(" and ")}`).join(", ")
  }

  /** Where a disk is about to slide at a wall: against the friction on it. */
  function way(contact, what) {
    const { scene } = body
    if (scene.j[contact] < scene.r.length) return ""
    const [x, y] = [-what * scene.normal[2 * contact + 1], what * scene.normal[2 * contact]]
    return Math.abs(y) > 0.3 ? (y > 0 ? " up" : " down") : x > 0 ? " right" : " left"
  }

  function say() {
    const { h, count, scene } = body, forces = 2 * count, equations = scene.equations ?? 0
    part("count").innerHTML = `<b>${forces} forces − ${equations} equations = ${h} free</b> ` +
      `<span>(${count} contact${count === 1 ? "" : "s"} with a normal and a tangential force each; every disk's forces and torque must balance` +
      `${scene.box[0] ? ", and the pressure is given" : ""})</span>`
    part("what").textContent = body.empty ? "S: empty" : body.whole && body.corners.length === 1 ? "S: a single point" : { 0: "S: a single point", 1: "S: a line", 2: "S: a polygon, in its true shape", 3: "S: a body; drag beside the point to turn it" }[h] ??
      `a shadow of S, which has ${h} dimensions; dots: networks drawn from it`
    part("says").textContent = sentence()
    part("says").classList.toggle("bad", body.empty)
    part("undo").disabled = !now.undo.length
  }

  function sentence() {
    const { h } = body
    if (now.note) return now.note
    if (body.empty) {
      const falls = now.fall ? [...body.scene.r.keys()].filter((d) => Math.hypot(...now.fall.slice(3 * d, 3 * d + 3)) > 0.05) : []
      const which = `disk${falls.length > 1 ? "s" : ""} ${falls.map((d) => d + 1).join(", ")}`
      const why = falls.length ? `The orange arrows show how ${which} give${falls.length > 1 ? "" : "s"} way: along that motion the loads do work, and no force allowed at any contact takes it up. That proves it.` : ""
      return `Nothing balances at μ = ${number(mu)}: S is empty. ${why}`
    }
    if (!h) return "Everything is determined: there is one network of forces, and mechanics finds it."
    if (h > 3) return `${h} free numbers: infinitely many networks of forces hold these disks. What is drawn is a shadow of S. Drag the point or an arrow: all forces follow, and everything stays in balance.`
    const size = h === 1 ? "line" : h === 2 ? "polygon" : "body"
    if (body.corners.length === 1) {
      return mu ? "S is one point: of all forces in balance, only these stay in their cones. Everything is determined."
        : "Without friction S is one point: everything is determined. Open the cones with the slider."
    }
    if (!body.bounded) return `S has no end in some direction: the disk${body.scene.r.length > 1 ? "s have" : " has"} wedged ${body.scene.r.length > 1 ? "themselves" : "itself"}, and the forces may be as large as you like. (Proof: a change of forces that is in balance by itself and stays in every cone.)`
    const fixed = body.scene.names.filter((_, c) => { const [low, high] = body.interval(2 * c); return high - low < 1e-9 * body.scaleOf() }).length
    const determined = fixed ? ` ${fixed} of ${body.count} normal forces are determined all the same.` : ""
    return `Every point of this ${size} is one way to hold the same disk${body.scene.r.length > 1 ? "s" : ""}, in balance, within friction. Drag the point, or an arrow.${determined}`
  }

  // What is done

  function heard(what, given) {
    if (what === "words") return words(given)
    if (what === "name") return body.scene.names[given]
    if (what === "hover" || what === "select") {
      now.disk = given ? given.disk : null
      if (what === "select" || !now.chosen) choose(given && !given.loose ? given.contact : null)
      if (what === "select") now.chosen = Boolean(given && !given.loose)
      if (what === "select" && given && !given.loose) remember()
      now.side = null
    }
    if (what === "side") {
      now.side = given ? given.corners.join() : null
      now.contacts = new Set(given ? given.stops.map(([c]) => c) : now.contact === null ? [] : [now.contact])
    }
    if (what === "begin") remember()
    if (what === "go") { pause(); body.goTo(given) }
    if (what === "pull") { pause(); body.pull(given.contact, given.normal, given.tangential) }
    if (what === "press") return press(given)
    if (what === "carry") carry(given)
    if (what === "release" && builds()) builder.release()
    soon()
  }

  function choose(contact) {
    now.contact = contact
    now.contacts = new Set(contact === null ? [] : [contact])
    if (contact !== null && body.h > 3) {
      space.shadow = [contact, space.shadow[0] === contact ? space.shadow[1] : space.shadow[0]]
    }
  }

  function remember() {
    now.undo.push([...body.u])
    if (now.undo.length > 100) now.undo.shift()
    part("undo").disabled = false
  }

  function undo() {
    const u = now.undo.pop()
    if (u) { pause(); body.goTo(u) }
    part("undo").disabled = !now.undo.length
    soon()
  }

  /** Cones of another μ, or other loads, on the same disks: S is cut anew, the point stays if it can. */
  function cut() {
    body.cut(mu)
    now.fall = now.bounds = null
    if (!body.empty && !body.goTo(body.u)) body.empty = true
    if (!body.empty && body.whole && !Number.isFinite(body.u[0] ?? 0)) body.u = body.middle
    if (now.filled && body.whole) space.fill()
    else space.dots = [] // many dimensions take their time: once friction rests
    now.path = []
    say()
    soon()
    clearTimeout(asleep)
    asleep = setTimeout(rest, REST_MS)
  }

  function rest() {
    if (body.empty) ask(model, view, { fall: { mu, load: [...body.load] } })
    else if (now.filled && !space.dots.length) { space.fill(); soon() }
    if (!body.empty && !body.whole) ask(model, view, { bounds: { mu, load: [...body.load] } })
    address()
  }

  function address() {
    const { name, built } = body.scene
    const query = new URLSearchParams({ scene: name, mu: String(Number(mu.toPrecision(6))), ...(built ? { built } : {}) })
    history.replaceState(null, "", `?${query}`)
  }

  function show() {
    const { scene } = model, same = scene.name === "own" && body?.scene.name === "own"
    part("own").hidden = scene.name !== "own"
    part("lesson").hidden = scene.name !== "groove"
    if (!scene.i) return void (part("says").textContent = "The disks are being pressed together …")
    Object.assign(now, { contact: null, disk: null, side: null, contacts: new Set(), fall: null, path: [], undo: [], chosen: false, bounds: null, push: false, limit: null, note: "" })
    pause()
    mu = scene.mu
    body = new Body(scene).cut(mu)
    if (scene.name === "own") builder.read(scene.built)
    space.shadow = [0, Math.min(1, body.count - 1)]
    Object.assign(space, { body, dots: [] })
    if (body.whole && !body.empty) body.u = [...body.middle]
    else if (!body.empty && !startInside()) body.empty = true
    if (!body.whole && !body.empty) now.filled = true
    if (now.filled) space.fill()
    if (!body.whole && space.dots.length) body.u = body.u.map((_, k) => space.dots.reduce((s, u) => s + u[k], 0) / space.dots.length)
    part("name").value = scene.name
    follow()
    say()
    part("push").classList.remove("on")
    if (root.opened && !same) address()
    clearTimeout(asleep)
    asleep = setTimeout(rest, REST_MS)
    root.opened = true
    soon()
  }

  function startInside() {
    for (const margin of [0.1, 0.03, 0.01, 1e-3, 0]) {
      const u = body.nearest(body.u, null, margin * body.scaleOf())
      if (body.least(u) >= -1e-6) { body.u = u; return true }
    }
    return false
  }

  function follow() {
    part("range").value = Math.min(mu, MOST_MU)
    part("typed").value = String(Number(mu.toPrecision(4)))
  }

  function setMu(value) {
    mu = Math.max(0, value)
    follow()
    cut()
  }

  // Going by itself

  function pause() {
    if (now.walk) cancelAnimationFrame(now.walk)
    now.walk = null
    part("play").textContent = "Walk"
    part("play").classList.remove("on")
  }

  function walk() {
    if (now.walk) return pause()
    if (body.empty || !body.h) return
    part("play").textContent = "Stop"
    part("play").classList.add("on")
    now.path = [body.u]
    let from = body.u, to = body.step(from), begun = performance.now()
    const go = (time) => {
      const part = Math.min(1, (time - begun) / 450)
      body.u = from.map((v, k) => v + part * (to[k] - v))
      now.path[now.path.length - 1] = body.u
      if (part === 1) {
        from = to
        to = body.step(from)
        begun = time
        now.path = [...now.path, from].slice(-PATH)
      }
      soon()
      now.walk = requestAnimationFrame(go)
    }
    now.path.push(body.u)
    now.walk = requestAnimationFrame(go)
  }

  // A push on a disk

  const builds = () => body?.scene.name === "own" && !now.push

  function press({ found, at }) {
    if (builds()) return builder.press(at)
    if (!now.push || !found || found.disk === undefined) return false
    now.pushed = { disk: found.disk, at, load: [...body.load], good: null }
    pause()
    return true
  }

  function carry({ at }) {
    if (builds()) return builder.carry(at)
    const { disk, at: from, load } = now.pushed, unit = arrows.forceUnit
    const push = [0, 1].map((k) => (at[k] - from[k]) / unit)
    body.load = Float64Array.from(load)
    body.load[3 * disk] += push[0]
    body.load[3 * disk + 1] += push[1]
    body.reload()
    cut()
    limit(disk, push, load)
  }

  /** How much may push that way before nothing balances any more, by halving. */
  function limit(disk, push, load) {
    const size = Math.hypot(...push)
    if (size < 1e-6 || !body.whole) return
    const trial = new Body(body.scene), along = push.map((v) => v / size)
    const holds = (F) => {
      trial.load = Float64Array.from(load)
      trial.load[3 * disk] += F * along[0]
      trial.load[3 * disk + 1] += F * along[1]
      trial.reload()
      return !trial.cut(mu).empty
    }
    let [low, high] = [0, 64 * body.scaleOf()]
    if (holds(high)) low = Infinity
    else for (let k = 0; k < 30; k++) { const F = (low + high) / 2; if (holds(F)) low = F; else high = F }
    const most = Number.isFinite(low) ? `at most ${number(low)} can be borne this way (the limit load)` : "no push this way is too large: it only presses the disks against their walls"
    now.note = `You push disk ${disk + 1} with ${number(size)}: ${most}.${body.empty ? " Now nothing balances." : ""}`
    say()
  }

  // The tour

  function tour(number) {
    step = number
    const steps = model.steps, card = part("card")
    card.hidden = !step
    root.style.paddingBottom = ""
    if (!step) return
    try { localStorage.setItem(UNSEEN, "seen") } catch { /* private */ }
    const [title, text, does] = steps[step - 1]
    card.querySelector("h2").textContent = title
    card.querySelector("p").textContent = text
    card.querySelector(".of").textContent = `${step} of ${model.all}`
    part("earlier").disabled = step === 1
    root.style.paddingBottom = `${card.offsetHeight + 20}px` // what lies under the card can be scrolled to
    if (does.mu !== undefined) setMu(does.mu)
    Object.assign(card.style, { background: colours().paper, color: colours().ink })
    requestAnimationFrame(() => {
      if (window.matchMedia(NARROW).matches) part(does.see ?? "pair").scrollIntoView({ block: "start" })
      card.querySelector("h2").focus({ preventScroll: true })
    })
  }

  const onwards = () => (step < model.steps.length ? tour(step + 1) : window.location.assign("?scene=many&tour=1"))

  // Widgets

  part("name").innerHTML = model.titles.map(([name, title]) => `<option value="${name}">${title}</option>`).join("")
  part("name").addEventListener("change", (event) => {
    const name = event.target.value
    if (name === "many") return window.location.assign("?scene=many")
    part("says").textContent = `Making “${event.target.selectedOptions[0].textContent}” …`
    ask(model, view, { scene: name })
  })
  part("range").addEventListener("input", (event) => setMu(Number(event.target.value)))
  part("typed").addEventListener("change", (event) => {
    const value = Number(event.target.value.replace(",", "."))
    if (Number.isFinite(value) && value >= 0) setMu(value)
    else { now.note = "μ is a number from 0 on"; say(); now.note = ""; follow() }
  })
  part("play").addEventListener("click", walk)
  part("fill").addEventListener("click", () => {
    now.filled = !now.filled
    if (now.filled) space.fill()
    part("fill").classList.toggle("on", now.filled)
    soon()
  })
  part("undo").addEventListener("click", undo)
  part("push").addEventListener("click", () => {
    now.push = !now.push
    part("push").classList.toggle("on", now.push)
    now.note = now.push ? "Drag a disk: you push it, and S shrinks until nothing balances. Press again to let go." : ""
    if (!now.push) { body.load = Float64Array.from(body.scene.load); body.reload(); cut() }
    say()
  })
  part("save").addEventListener("click", () => ask(model, view, { save: { mu, load: [...body.load] } }))
  part("lesson").querySelector("article").innerHTML = lesson()
  for (const button of root.querySelectorAll(".print")) {
    button.addEventListener("click", () => printed(part("packing").toDataURL(), button.classList.contains("answered")))
  }
  part("tourist").addEventListener("click", () => tour(1))
  part("earlier").addEventListener("click", () => tour(step - 1))
  part("next").addEventListener("click", onwards)
  part("close").addEventListener("click", () => tour(0))
  part("bars").addEventListener("pointerover", (event) => {
    const row = event.target.closest("[data-contact]")
    if (row) { choose(Number(row.dataset.contact)); soon() }
  })

  function download(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)), link = document.createElement("a")
    link.href = URL.createObjectURL(new Blob([bytes]))
    link.download = `${body.scene.name}.npz`
    link.click()
    setTimeout(() => URL.revokeObjectURL(link.href), 1000)
  }

  function key(event) {
    if (event.metaKey || event.ctrlKey || !root.isConnected) return
    const { key } = event, over = (names) => event.composedPath().some((node) => node.matches?.(names))
    if (over("input, select, textarea") || (key === " " && over("button, summary"))) return
    if (key === "z" || key === "Z") undo()
    else if (key === " ") walk()
    else if (key === "Escape") { tour(0); choose(null); now.chosen = false }
    else if (key === "[" || key === "]") {
      const contact = now.contact ?? 0, F = body.forces(), push = (key === "]" ? 0.05 : -0.05) * body.scaleOf()
      if (body.empty || !body.count) return
      choose(contact)
      now.chosen = true
      remember()
      body.pull(contact, F[2 * contact] + push, F[2 * contact + 1])
    } else if (key === "n" || key === "N") {
      choose(body.count ? ((now.contact ?? -1) + 1) % body.count : null)
      now.chosen = true
    } else return
    event.preventDefault()
    soon()
  }

  const sized = new ResizeObserver(() => { arrows.wide = 0; soon() })
  sized.observe(root)
  window.addEventListener("keydown", key)
  model.on("remove", () => { window.removeEventListener("keydown", key); sized.disconnect(); pause() })
  model.on("scene", show)
  model.on("dark", soon)
  model.on("msg:custom", (news) => {
    if (news.fall && body.empty) { now.fall = news.fall.length ? news.fall : null; say(); soon() }
    if (news.bounds && news.mu === mu && !body.whole) { now.bounds = news.bounds; soon() }
    if (news.file) download(news.file)
    if (news.error) { now.note = news.error; say(); now.note = "" }
  })
  Object.defineProperty(root, "small", { get: () => ({ body, now, space, arrows, builder, mu }) })
  show()
  const seen = () => { try { return localStorage.getItem(UNSEEN) !== null } catch { return true } }
  if (model.step) tour(model.step)
  else if (model.first && !seen()) tour(1)
  return root
}
