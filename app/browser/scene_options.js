// A list of scenes: first those of this page, then those that open the other one.

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
