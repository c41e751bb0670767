// A list of scenes: first those of this page, then those that open the other one; and what to try after the lesson.

import { lastPacking } from "./local_storage.js"

/** HTML for titles [[name, title, door]]; here: the door of this page, "Explore" or "Learn". */
export function sceneOptions(titles, here) {
  const options = (given, where = "") => given.map(([name, title]) => `<option value="${name}">${title}${where}</option>`).join("")
  const elsewhere = titles.filter(([, , door]) => door !== here)
  const there = elsewhere[0][2]
  return `${options(titles.filter(([, , door]) => door === here))}<optgroup label="opens in ${there}">${options(elsewhere, ` → ${there}`)}</optgroup>`
}

/** The query of a scene, at a friction unless it is null; a visitor's packing at that of its last view. */
export function sceneQuery(scene, mu) {
  const last = scene === "imported" ? lastPacking() : ""
  return last || `?${new URLSearchParams(mu === null ? { scene } : { scene, mu })}`
}

/** What to try after the lesson, by name: the query of a page, a title, and a question, which that page shows. */
export const ONWARDS = {
  stones: ["scene=stones", "An arch of stones", "Change the friction: from which μ on do three stones stand as an arch?"],
  disks: ["scene=own", "Build your own", "Add a third disk: how many numbers can three disks leave free?"],
  hold: ["colour=known", "400 disks", "Click a line and press H to hold its force: which others does it bind?"],
}

/** The question with which a page was opened; empty without one. */
export const asked = () => ONWARDS[new URLSearchParams(window.location.search).get("asked")]?.[2] ?? ""
