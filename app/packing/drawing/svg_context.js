// A minimal canvas context that records drawings as SVG, with only the methods that the scene uses.

export const PIXELS = 900 // of the picture's side
const BELOW = 60 // pixels from the picture to the first line of its caption
const LINE = 21 // pixels
const FONT = { family: "Helvetica, Arial, sans-serif", size: 15 }
const WIDE = PIXELS - 24 // pixels of a line of the caption
const THICK = 16 // pixels, most of the line that shows the width of a force
const SCALE_LENGTH = 5 // of the scale, in largest radii

const written = (value) => (typeof value === "number" ? Number(value.toPrecision(5)) : value)

export class Sheet {
  constructor() {
    this.canvas = {}
    this.drawn = []
    this.shapes = []
    this.globalAlpha = 1
    this.lineCap = "butt"
    this.dash = []
  }

  beginPath() { this.shapes = [] }

  moveTo(x, y) { this.at = [x, y] }

  lineTo(x, y) { this.add("line", { x1: this.at[0], y1: -this.at[1], x2: x, y2: -y }) }

  arc(x, y, r) { this.add("circle", { cx: x, cy: -y, r }) }

  polygon(corners) {
    this.add("polygon", { points: corners.map(([x, y]) => [x, -y].map(written)).join(" ") })
  }

  add(name, places) {
    const shape = { name, ...places, fill: "none" }
    this.shapes.push(shape)
    this.drawn.push(shape)
  }

  fill() { for (const shape of this.shapes) shape.fill = this.fillStyle }

  stroke() {
    const paint = { stroke: this.strokeStyle, "stroke-width": this.lineWidth }
    if (this.lineCap !== "butt") paint["stroke-linecap"] = this.lineCap
    if (this.globalAlpha < 1) paint.opacity = this.globalAlpha
    if (this.dash.length) paint["stroke-dasharray"] = this.dash.join(" ")
    for (const shape of this.shapes) Object.assign(shape, paint)
  }

  setLineDash(dash) { this.dash = dash }

  // The whole is shown on an empty canvas.
  setTransform() {}
  clearRect() {}

  /** The drawing as text, with colour bar, scale and caption below. */
  svg([left, right, bottom, top], { background, ink, bar, width, lines: caption, unit, bodies }) {
    const [high, remark] = bar.high.split(/ (?=\()/) // which may be long
    const lines = [remark ? `Colours: ${remark.slice(1, -1)}.` : "", ...caption].filter(Boolean).flatMap(wrapped)
    const scale = PIXELS / (right - left)
    const place = `x="${left}" y="${-top}" width="${right - left}" height="${top - bottom}"`
    const element = ({ name, ...given }) =>
      `<${name} ${Object.entries(given).map(([key, value]) => `${key}="${written(value)}"`).join(" ")}/>`
    const full = PIXELS + BELOW + LINE * lines.length
    return [
      `<svg xmlns="http://www.w3.org/2000/svg" width="${PIXELS}" height="${full}" viewBox="0 0 ${PIXELS} ${full}"` +
        ` font-family="${FONT.family}" font-size="${FONT.size}">`,
      `<desc>${lines.map(safe).join(" ")}</desc>`,
      `<rect width="${PIXELS}" height="${full}" fill="${background}"/>`,
      `<svg width="${PIXELS}" height="${PIXELS}" viewBox="${left} ${-top} ${right - left} ${top - bottom}">`,
      `<rect ${place} fill="${background}"/>`,
      ...this.drawn.map(element),
      "</svg>",
      `<g fill="${ink}">`,
      ...colourBar({ ...bar, high }),
      ...widthBar(scale * unit * width),
      ...scaleBar(scale, SCALE_LENGTH * unit, bodies),
      ...lines.map((line, k) => `<text x="12" y="${PIXELS + BELOW + LINE * k}">${safe(line)}</text>`),
      "</g>",
      "</svg>",
    ].join("\n")
  }
}

/** Break a line into lines that fit, between words, or within a word that is too long. */
function wrapped(line) {
  const context = document.createElement("canvas").getContext("2d"), lines = [""]
  context.font = `${FONT.size}px ${FONT.family}`
  const fits = (text) => context.measureText(text).width <= WIDE
  for (const word of line.match(/\S+\s*/g) ?? []) {
    if (fits(lines.at(-1) + word.trimEnd())) { lines[lines.length - 1] += word; continue }
    if (lines.at(-1) && fits(word.trimEnd())) lines.push("")
    for (const letter of word) {
      if (!fits(lines.at(-1) + letter.trimEnd())) lines.push("")
      lines[lines.length - 1] += letter
    }
  }
  return lines.map((part) => part.trimEnd())
}

const safe = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;")

function colourBar({ low, high, stops }) {
  const parts = stops.map((stop, k) => {
    const [colour, at] = stop.split(" ")
    return `<stop offset="${at ?? `${(100 * k) / (stops.length - 1)}%`}" stop-color="${colour}"/>`
  })
  return [
    `<linearGradient id="colours">${parts.join("")}</linearGradient>`,
    `<text x="140" y="${PIXELS + 27}" text-anchor="end">${safe(low)}</text>`,
    `<rect x="148" y="${PIXELS + 14}" width="200" height="16" fill="url(#colours)"/>`,
    `<text x="356" y="${PIXELS + 27}">${safe(high)}</text>`,
  ]
}

/** A line as wide as a round force; wide: pixels of the mean force. */
function widthBar(wide) {
  const force = [5, 2, 1, 0.5, 0.2, 0.1, 0.05, 0.02].find((value) => value * wide <= THICK) ?? 0.01
  return [
    `<rect x="588" y="${PIXELS + 22 - (force * wide) / 2}" width="40" height="${force * wide}" opacity="0.65"/>`,
    `<text x="634" y="${PIXELS + 27}">width: ${force} ⟨fₙ⟩</text>`,
  ]
}

/** A bar of SCALE_LENGTH; of bodies, of a round length in their own unit. */
function scaleBar(scale, most, bodies) {
  const ten = 10 ** Math.floor(Math.log10(most)), round = ten * [5, 2, 1].find((k) => k * ten <= most)
  const length = scale * (bodies ? round : most)
  const words = bodies ? `${Number(round.toPrecision(1))}, in the unit of the bodies` : `${SCALE_LENGTH} largest radii`
  return [
    `<rect x="${PIXELS - 20 - length}" y="${PIXELS + 26}" width="${length}" height="4"/>`,
    bodies
      ? `<text x="${PIXELS - 20}" y="${PIXELS + 20}" text-anchor="end">${words}</text>`
      : `<text x="${PIXELS - 20 - length / 2}" y="${PIXELS + 20}" text-anchor="middle">${words}</text>`,
  ]
}
