// The page of a small scene: the scene and its S side by side, friction, and what is done with them.

import { Arrows, tall } from "./drawing/scene_canvas.js"
import { ask } from "../browser/send.js"
import { Axes } from "./shadow_axes.js"
import { Bars } from "./drawing/bars.js"
import { Body } from "./model/polytope.js"
import { Builder } from "./builder.js"
import { desk } from "../obsolete/desk.js"
import { Going } from "./random_walk.js"
import { goneBanner } from "../browser/connection_lost.js"
import { Later } from "../obsolete/later.js"
import { teach } from "../obsolete/lesson.js"
import { toMean } from "./model/middle.js"
import { palette } from "./drawing/palette.js"
import { Push } from "./disk_push.js"
import { Quest } from "../obsolete/quest.js"
import { saveBytes } from "../browser/download.js"
import { barred, counted, forceName, legend, pictured, sentence, special, stopping } from "./model/sentences.js"
import { Space } from "./drawing/space.js"
import { TourCard } from "../obsolete/tourcard.js"

const MOST_MU = 1.5 // on the slider; larger ones can be typed
const REST_MS = 150 // after which what only the server tells is asked for
const FEW = 12 // contacts up to which all their intervals are seen at once

export function render({ model, view }) {
  const root = document.createElement("div")
  root.className = "desk"
  root.innerHTML = desk(MOST_MU)
  const parts = {}, told = {}
  const part = (name) => (parts[name] ??= root.querySelector(`.${name}`))
  // Of a scene that nobody has touched yet; moved: by hand.
  const untouched = () => ({ contact: null, disk: null, side: null, contacts: new Set(), read: [], fall: null, enough: null, path: [], undo: [], chosen: false, bounds: null, fresh: true, moved: false })
  const now = { ...untouched(), filled: false }, toured = new Set()
  let body = null, mu = model.scene.mu, chosenMu = false, waiting = 0, asleep = 0, returning = false

  const gone = goneBanner(view, "What is in the page still moves.")
  root.prepend(gone)
  const builder = new Builder(part("own"), (built) => ask(model, view, { built, mu }))
  const arrows = new Arrows(part("packing"), heard), space = new Space(part("space"), heard)
  const going = new Going(part("play"), (path) => { now.path = path; say(); soon() })
  const pushed = new Push(), quest = new Quest(part("quest")), bars = new Bars(part("bars"))
  const axes = new Axes(part("plane"), cast), later = new Later("hand", part("more"))
  const tour = new TourCard(root, model.steps, model.all, ({ scene, mu: at }) => {
    if (scene !== body?.scene.name) ask(model, view, at === undefined ? { scene } : { scene, mu: at })
    else if (at !== undefined) setMu(at)
    Object.assign(part("card").style, { background: colours().paper, color: colours().ink })
  }, () => leave("many", "&tour=1"))

  // What is seen

  const colours = (dark = model.dark) => palette(dark)

  const dress = () => { root.style.colorScheme = model.dark ? "dark" : "light" } // for the browser's own controls

  function paint() {
    waiting = 0
    if (!body || !root.isConnected) return
    const was = space.fog
    hide()
    if (was !== space.fog) say()
    const wall = builder.held?.wall === undefined ? [] : builder.walls[builder.held.wall]
    const cursor = builds() && root.getRootNode().activeElement === part("packing") ? builder.cursor : null
    const dressed = colours(), onAxes = new Map(space.axed.map((force, k) => [force, [dressed.across, dressed.up][k]]))
    const look = { ...dressed, ...now, wall, cursor, axes: onAxes, dots: now.filled && space.dots.length }
    if (body.scene !== arrows.body?.scene || arrows.wide !== part("packing").clientWidth) {
      arrows.fit(body, body.scene.name === "own" && arrows.own === part("packing").clientWidth)
      arrows.own = body.scene.name === "own" ? part("packing").clientWidth : 0
      arrows.wide = part("packing").clientWidth
    }
    arrows.draw({ ...look, contacts: lit() })
    if (space.draw(body, look, now.path)) soon()
    root.painted = (root.painted ?? 0) + 1
    if (!going.frame || root.painted % 2) bars.draw(body, lit(), now.bounds, now.fresh) // numbers on a walk: every second frame
  }

  /** Contacts that light up among disks and bars: those looked at, and those the point is read by. */
  const lit = () => new Set([...now.contacts, ...now.read])

  const soon = () => { waiting ||= requestAnimationFrame(paint) }

  /** Words into a part of the page, if they are others: what stays the same is not laid out anew. */
  function tell(name, text, how = "textContent") {
    if (told[name] !== text) part(name)[how] = told[name] = text
  }

  function say(note = pushed.on ? now.note : "") {
    quest.ask(space, { ...now, hides: hides() })
    hide()
    tell("count", counted(body, space.fog), "innerHTML")
    tell("legend", legend(body))
    tell("special", special(body, space.fog))
    tell("key", barred(body))
    const seen = { ...now, fog: space.fog }
    tell("what", pictured(body, seen))
    tell("says", note || sentence(body, mu, seen))
    tell("mend", `Set μ = ${now.enough}`)
    part("mend").hidden = !now.enough
    part("says").classList.toggle("note", Boolean(note))
    part("says").classList.toggle("bad", body.empty && !body.scene.idle)
    part("undo").disabled = !now.undo.length
  }

  /** What the first question asks for is not seen by who was never here; but of scenes in the tour, which speaks of S. */
  function hides() {
    if (root.classList.contains("touring")) toured.add(body.scene.name)
    return later.new && !toured.has(body.scene.name)
  }

  function hide() {
    space.fog = hides() && quest.fog
    part("ranges").hidden = space.fog // which would tell
  }

  // What is done

  function heard(what, given) {
    if (what === "words") return stopping(body, given)
    if (what === "name") return forceName(body.scene, given)
    if (what === "hover" || what === "select") {
      now.disk = given ? given.disk : null
      if (what === "select" || !now.chosen) choose(given && !given.loose ? given.contact : null)
      if (what === "select") now.chosen = Boolean(given && !given.loose)
      if (what === "select" && given && !given.loose) remember()
      now.side = null
    }
    if (what === "point") Object.assign(now, { side: null, read: given, contacts: new Set(now.contact === null ? [] : [now.contact]) })
    if (what === "side") {
      now.read = []
      now.side = given ? given.corners.join() : null
      now.contacts = new Set(given ? given.stops.map(([c]) => c) : now.contact === null ? [] : [now.contact])
    }
    if (what === "begin") remember()
    if (what === "go" || what === "pull") byHand()
    if (what === "go") { going.pause(); body.goTo(given); say() }
    if (what === "pull") { going.pause(); body.pull(given.contact, given.normal, given.tangential); say() }
    if (what === "guess") say() // by the flag
    if (what === "press") return press(given)
    if (what === "carry") carry(given)
    if (what === "release" && builds()) builder.release()
    soon()
  }

  function byHand() {
    Object.assign(now, { fresh: false, moved: true })
    later.offer()
  }

  function walk() {
    now.fresh = false
    going.toggle(body)
    soon()
  }

  function choose(contact) {
    now.contact = contact
    now.contacts = new Set(contact === null ? [] : [contact])
  }

  function remember() {
    now.undo.push([...body.u])
    if (now.undo.length > 100) now.undo.shift()
    part("undo").disabled = false
  }

  function undo() {
    const u = now.undo.pop()
    if (u) { going.pause(); body.goTo(u); say() }
    part("undo").disabled = !now.undo.length
    soon()
  }

  /** Cones of another μ, or other loads, on the same disks: S is cut anew, the point stays if it can. */
  function cut() {
    body.cut(mu)
    now.fall = now.bounds = now.enough = null
    quest.again()
    space.outline.stale = true
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
    address() // first: where the server is gone, asking it fails
    if (!body.empty && now.filled && !space.dots.length && body.bounded) { space.fill(); soon() }
    if (body.empty && !body.scene.idle && !now.enough) { now.enough = body.enough(MOST_MU); say(); soon() }
    if (body.empty && !body.scene.idle) find("fall")
    measure()
  }

  /** Ask the server for a file, how the disks fall, or what is exact, of what is in hand. */
  function find(what) {
    ask(model, view, { find: what, scene: body.scene.name, built: body.scene.built, mu, load: [...body.load], plane: space.shadow })
  }

  /** Above three dimensions, what only linear programs tell. */
  function measure() {
    if (!body.empty && !body.whole) find("measured")
  }

  function measured({ bounds, outline, endless }, plane) {
    now.bounds = bounds
    body.bounded = !endless
    if (endless) space.dots = []
    if (plane.join() === space.shadow.join()) space.outline = { points: outline ?? [], stale: false }
    say()
    soon()
  }

  // The address: a scene is a step to go back to, friction is not

  function query() {
    const { name, built } = body.scene
    return new URLSearchParams({ scene: name, mu: String(Number(mu.toPrecision(6))), ...(built ? { built } : {}), ...(model.dark ? { dark: 1 } : {}) })
  }

  function address() {
    if (returning) return
    const there = new URLSearchParams(location.search).get("scene"), step = there && there !== body.scene.name
    history[step ? "pushState" : "replaceState"](null, "", `?${query()}`)
  }

  function returned() {
    const { search } = location
    if (new URLSearchParams(search).get("scene") === "many") return location.reload()
    returning = true
    ask(model, view, { query: search })
  }

  /** To a page of its own; the theme goes along, and the friction if it was chosen by hand. */
  function leave(name, more = "") {
    clearTimeout(asleep)
    window.location.assign(`?scene=${name}${chosenMu ? `&mu=${query().get("mu")}` : ""}${model.dark ? "&dark=1" : ""}${more}`)
  }

  function show() {
    const { scene } = model, same = scene.name === "own" && body?.scene.name === "own"
    part("own").hidden = scene.name !== "own"
    part("lesson").hidden = scene.name !== "groove"
    part("board").classList.toggle("reading", part("lesson").open && scene.name === "groove")
    root.classList.toggle("waiting", !scene.i)
    if (!scene.i) {
      part("name").value = new URLSearchParams(location.search).get("scene") ?? part("name").value
      return void tell("says", "The disks are being pressed together …")
    }
    Object.assign(now, untouched())
    pushes(false)
    going.pause()
    quest.begin()
    space.flag.begin()
    mu = scene.mu
    body = new Body(scene).cut(mu)
    returning = false
    if (scene.name === "own" && builder.read(scene.built, scene.begins)) arrows.own = 0
    Object.assign(space, { body, dots: [], outline: { points: [], stale: true } })
    space.shadow = axes.show(body, (force) => heard("name", force))
    if (body.whole && !body.empty) body.u = [...body.middle]
    else if (!body.empty && !body.goInside()) body.empty = true
    if (!body.whole) toMean(space)
    if (now.filled) space.fill()
    part("name").value = scene.name
    part("ranges").open = body.count <= FEW || tall(scene)
    root.classList.toggle("explained", Boolean(scene.box[0]) || scene.name === "own")
    root.classList.toggle("tall", tall(scene))
    follow()
    say(root.opened ? "" : model.note)
    if (root.opened && !same) address()
    clearTimeout(asleep)
    asleep = setTimeout(rest, REST_MS)
    root.opened = true
    soon()
  }

  /** Which two forces S casts its shadow on. */
  function cast(shadow) {
    Object.assign(space, { shadow, outline: { points: [], stale: true }, sceneDrawn: null })
    quest.again()
    say()
    measure()
    soon()
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

  function chooseMu(value) {
    chosenMu = true
    now.fresh = false
    setMu(value)
  }

  // A push on a disk

  const builds = () => body?.scene.name === "own" && !pushed.on

  function pushes(on) {
    pushed.on = on
    pushed.stop()
    part("push").classList.toggle("on", on)
    part("push").setAttribute("aria-pressed", on)
    now.note = on ? "Drag a disk, or choose one with N and push with the arrow keys: S shrinks until nothing balances. Press the button again to let go." : ""
  }

  function press({ found, at }) {
    if (builds()) return builder.press(at)
    if (!pushed.on || !found || found.disk === undefined) return false
    const before = pushed.disk === found.disk ? pushed.force : [0, 0]
    now.grip = { disk: found.disk, from: at.map((v, k) => v - before[k] * arrows.forceUnit) }
    going.pause()
    return true
  }

  function carry({ at }) {
    if (builds()) return builder.carry(at)
    const { disk, from } = now.grip
    pushBy(disk, at.map((v, k) => (v - from[k]) / arrows.forceUnit))
  }

  function pushBy(disk, force) {
    pushed.load(body, disk, force)
    cut()
    now.note = pushed.told(body) || now.note
    say()
  }

  /** Arrow keys push the disk that was chosen. */
  function pushByKey(key) {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[key]
    if (!step || !pushed.on) return false
    const disk = now.disk ?? pushed.disk ?? 0, force = pushed.disk === disk ? pushed.force : [0, 0]
    now.disk = disk
    pushBy(disk, force.map((v, k) => v + 0.02 * step[k] * body.scaleOf()))
    return true
  }

  // Widgets

  part("name").innerHTML = model.titles.map(([name, title]) => `<option value="${name}">${title}</option>`).join("")
  part("name").addEventListener("change", (event) => {
    const name = event.target.value
    if (name === "many") return leave(name)
    if (!gone.hidden) { // the page opens anew with its address, once there is a server again
      history.pushState(null, "", `?scene=${name}`)
      return say("This scene opens once the connection is back.")
    }
    tell("says", `Making “${event.target.selectedOptions[0].textContent}” …`)
    ask(model, view, chosenMu ? { scene: name, mu } : { scene: name })
  })
  part("range").addEventListener("input", (event) => chooseMu(Number(event.target.value)))
  part("typed").addEventListener("change", (event) => {
    const value = Number(event.target.value.replace(",", "."))
    if (Number.isFinite(value) && value >= 0) chooseMu(value)
    else { say("μ is a number from 0 on"); follow() }
  })
  part("play").addEventListener("click", walk)
  part("fill").addEventListener("click", () => {
    now.fresh = false
    now.filled = !now.filled
    if (now.filled) space.fill()
    part("fill").classList.toggle("on", now.filled)
    say()
    soon()
  })
  part("undo").addEventListener("click", undo)
  later.listeners.push(() => { say(); soon() })
  part("push").addEventListener("click", () => {
    const was = pushed.disk !== null
    pushes(!pushed.on)
    if (was) { body.load = Float64Array.from(body.scene.load); body.reload(); cut() }
    say()
  })
  part("save").addEventListener("click", () => find("file"))
  teach(root, heard, () => ({ body, look: { ...colours(false), ...now, contact: null, disk: null, side: null, contacts: new Set(), dots: 0, fresh: false } }))
  part("mend").addEventListener("click", () => chooseMu(now.enough))
  part("tourist").addEventListener("click", () => tour.go(1))
  part("bars").addEventListener("pointerover", (event) => {
    const row = event.target.closest("[data-contact]")
    if (row) { choose(Number(row.dataset.contact)); soon() }
  })
  part("bars").addEventListener("pointerleave", () => { if (!now.chosen) { choose(null); soon() } })

  function key(event) {
    if (event.metaKey || event.ctrlKey || !root.isConnected) return
    const { key } = event, over = (names) => event.composedPath().some((node) => node.matches?.(names))
    if (over("input, select, textarea") || (key === " " && over("button, summary"))) return
    if (pushByKey(key)) return event.preventDefault()
    if (builds() && over(".packing") && builder.key(key, arrows.middle)) { event.preventDefault(); return soon() }
    if (key === "z" || key === "Z") undo()
    else if (key === " ") walk()
    else if (key === "Escape") { tour.go(0); choose(null); now.chosen = false }
    else if (key === "[" || key === "]") {
      const contact = now.contact ?? 0, F = body.forces(), push = (key === "]" ? 0.05 : -0.05) * body.scaleOf()
      if (body.empty || !body.count) return
      choose(contact)
      now.chosen = true
      remember()
      byHand()
      body.pull(contact, F[2 * contact] + push, F[2 * contact + 1])
      say()
    } else if ((key === "n" || key === "N") && pushed.on) {
      now.disk = ((now.disk ?? -1) + 1) % body.scene.r.length
    } else if (key === "n" || key === "N") {
      choose(body.count ? ((now.contact ?? -1) + 1) % body.count : null)
      now.chosen = true
    } else return
    event.preventDefault()
    soon()
  }

  const sized = new ResizeObserver(() => { arrows.wide = 0; soon() })
  for (const seen of [root, part("packing"), part("space")]) sized.observe(seen)
  window.addEventListener("keydown", key)
  window.addEventListener("popstate", returned)
  model.on("remove", () => {
    window.removeEventListener("keydown", key)
    window.removeEventListener("popstate", returned)
    sized.disconnect()
    going.pause()
  })
  model.on("scene", show)
  model.on("dark", () => { dress(); soon(); if (body) address() })
  model.on("msg:custom", (news) => {
    if (news.fall && body.empty) { now.fall = news.fall.length ? news.fall : null; say(); soon() }
    if (news.measured && news.scene === body.scene.name && news.mu === mu && !body.whole) measured(news.measured, news.plane)
    if (news.file) saveBytes(news.file, `${body.scene.name}.npz`)
    if (news.error && !body) return tell("says", news.error)
    if (news.error) { returning = false; part("name").value = body.scene.name; say(news.error) }
  })
  Object.defineProperty(root, "small", { get: () => ({ body, now, space, arrows, builder, pushed, mu }) })
  dress()
  show()
  if (model.step) tour.go(model.step)
  else if (model.first && !tour.seen) tour.go(1)
  return root
}
