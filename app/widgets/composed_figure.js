// Packing and plots on screen as one figure of chosen width, in vector graphics except for the
// small marks of legends, which Bokeh draws as pixels.

import { print } from "../browser/download.js"

const SIDE_BY_SIDE_MM = 120 // from this width on the plots are next to the packing, otherwise below it
const COLUMN = 900 // units across the packing or a plot, as in its picture; see svg_context.js
const SPACE = 24 // units between them

/** The visible plots, from the top, as SVG. */
export async function plotsSeen(page) {
  const visible = []
  for (const fig of page._all_models.values()) {
    const view = fig.type === "Figure" && page.views_manager?.find_one(fig), box = view?.el?.getBoundingClientRect()
    if (box?.height) visible.push([box.top, view])
  }
  visible.sort(([a], [b]) => a - b)
  return Promise.all(visible.map(async ([, view]) => (await view.export("svg").to_blob()).text()))
}

/** A picture to embed in another: its root and its size; ids in it begin with `k`. */
function inset(text, k) {
  const unique = text.replace(/\bid="/g, `$&${k}-`).replace(/url\(#|href="#/g, `$&${k}-`)
  const root = new DOMParser().parseFromString(unique, "image/svg+xml").documentElement
  const [width, height] = ["width", "height"].map((name) => parseFloat(root.getAttribute(name)))
  if (!root.getAttribute("viewBox")) root.setAttribute("viewBox", `0 0 ${width} ${height}`)
  return { root, height: (COLUMN * height) / width }
}

/** One SVG of all of them: {text, height}, with width and height in mm. */
export function composed(packing, plots, width, ground) {
  const beside = plots.length > 0 && width >= SIDE_BY_SIDE_MM
  const wide = beside ? 2 * COLUMN + SPACE : COLUMN, down = [0, 0], parts = []
  for (const [k, text] of [packing, ...plots].entries()) {
    const column = k && beside ? 1 : 0, { root, height } = inset(text, `part${k}`)
    const place = { x: column * (COLUMN + SPACE), y: down[column], width: COLUMN, height }
    for (const [name, value] of Object.entries(place)) root.setAttribute(name, value)
    down[column] += height + SPACE
    parts.push(new XMLSerializer().serializeToString(root))
  }
  const high = Math.max(...down) - SPACE, height = (width * high) / wide
  const text = `<svg xmlns="http://www.w3.org/2000/svg" width="${width}mm" height="${height}mm" ` +
    `viewBox="0 0 ${wide} ${high}"><rect width="${wide}" height="${high}" fill="${ground}"/>${parts.join("\n")}</svg>`
  return { text, height }
}

/** Print a figure alone, on a page of its size: saved as PDF, it stays vector graphics. */
export function printFigure({ text, height }, width) {
  print("The figure, to be printed", `<!doctype html><meta charset="utf-8"><title>Figure</title><style>
    @page { size: ${width}mm ${height}mm; margin: 0 } body { margin: 0 } svg { display: block }</style>${text}`)
}
