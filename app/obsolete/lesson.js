// A lesson of one page, for the groove, made to be printed: the numbers, and three questions.

import { Arrows } from "../learn/drawing/scene_canvas.js"
import { print } from "../browser/download.js"
import { Space } from "../learn/drawing/space.js"

const AT = [0, 0.2, 0.5, 0.8, 1]
const QUESTIONS = [
  ["What presses on the walls without friction, and how many answers are there?",
    "One: f<sub>t</sub> = 0 and f<sub>n</sub> = 1/√2 = 0.707 at both walls. With μ = 0 the line S shrinks to a point."],
  ["A foil under the left wall reads f<sub>n</sub> = 0.9 at μ = 0.5. What are the other three forces?",
    "Sideways balance: f<sub>n</sub> = 0.9 at the right wall, too. Up and down: f<sub>t</sub> = 0.707 − 0.9 = −0.193 at both, " +
    "down along the walls: the disk has been pressed in. It may be: 0.193 ≤ 0.5 · 0.9. One measured number determines all."],
  ["The groove is made narrower, to an opening of 60°. From which friction on does the disk wedge itself?",
    "From μ = tan 30° = 0.577 on. In general from the tangent of half the opening: then the force on each wall may point " +
    "at the other wall's place of contact, and two such forces balance each other, however large they are."],
]

/** Put the lesson in its place on a page, to be opened and printed; seen(): {body, look} to be printed with it. */
export function teach(root, told, seen) {
  const [folded, board] = [".lesson", ".board"].map((name) => root.querySelector(name))
  folded.querySelector("article").innerHTML = lesson()
  for (const button of folded.querySelectorAll(".print")) {
    button.addEventListener("click", () => printed(pictures(root, told, seen()), button.classList.contains("answered")))
  }
  folded.addEventListener("toggle", () => {
    board.classList.toggle("reading", folded.open && !folded.hidden)
    if (folded.open) board.scrollIntoView()
  })
}

/** The disk and S as they are, for white paper, with words that can be read at their size. */
function pictures(root, told, { body, look }) {
  return [Arrows, Space].map((Picture) => {
    const canvas = root.appendChild(document.createElement("canvas"))
    canvas.style.cssText = "position: absolute; visibility: hidden; width: 400px; height: 230px; border: 0"
    const picture = new Picture(canvas, told, 3)
    if (picture.fit) { picture.fit(body); picture.draw(look) }
    else picture.draw(body, look, [])
    canvas.remove()
    return canvas.toDataURL()
  })
}

/** The lesson as HTML; answers behind a click. */
function lesson() {
  const ends = (mu) => [Math.SQRT1_2 / (1 + mu), mu < 1 ? (Math.SQRT1_2 / (1 - mu)).toFixed(3) : "no end"]
  const rows = AT.map((mu) => `<tr><td>${mu}</td><td>${ends(mu)[0].toFixed(3)}</td><td>${ends(mu)[1]}</td></tr>`).join("")
  return `
    <h2>The groove: why forces are not determined</h2>
    <p>A disk of weight 1 lies between two walls at 45°. Each wall presses on it with a normal force f<sub>n</sub> ≥ 0 and
    rubs with a tangential force f<sub>t</sub>, counted up along the wall, which friction allows up to μ f<sub>n</sub>:
    <b>four forces</b>. A disk at rest gives <b>three equations</b>:</p>
    <ol>
      <li>it does not turn: f<sub>t</sub> is the same at both walls;</li>
      <li>nothing moves sideways: then f<sub>n</sub> is the same at both walls, too;</li>
      <li>nothing moves up or down: 2 (f<sub>n</sub> + f<sub>t</sub>)/√2 = 1, or f<sub>n</sub> = 1/√2 − f<sub>t</sub>.</li>
    </ol>
    <p><b>4 − 3 = 1</b> number stays free. All sets of forces that hold the disk form a line, called <b>S</b>. It ends where
    the disk is about to slide, |f<sub>t</sub>| = μ f<sub>n</sub>, down or up:</p>
    <p class="formula">1/(√2 (1 + μ)) ≤ f<sub>n</sub> ≤ 1/(√2 (1 − μ))</p>
    <table><thead><tr><th>μ</th><th>least f<sub>n</sub></th><th>largest f<sub>n</sub></th></tr></thead><tbody>${rows}</tbody></table>
    <p>Which of these the walls really bear depends on how the disk came there: laid down, pressed in, or drawn up. Nothing in
    the picture of the disk at rest tells. In a packing of 400 disks there are hundreds of such free numbers.</p>
    <h3>Questions</h3>
    <ol>${QUESTIONS.map(([asked, answer]) => `<li>${asked}<details><summary>Answer</summary>${answer}</details></li>`).join("")}</ol>`
}

/** Have it printed alone, with the pictures of the disk and of S; open: with its answers. */
function printed(pictures, open) {
  print("The lesson, to be printed", `<!doctype html><meta charset="utf-8"><title>The groove</title><style>
    body { font: 10.5pt/1.35 sans-serif; max-width: 17cm; margin: 0 auto; } figure { display: flex; gap: 4mm; margin: 3mm 0; } img { flex: 1; min-width: 0; border: 1px solid #ccc; }
    sub { line-height: 0; } td, th { padding: 1px 14px 1px 0; text-align: left; } h2 { margin: 0; } .formula { text-align: center; }
    ${open ? "" : "details { height: 1.2cm; overflow: hidden; color: transparent; }"}</style>
    ${open ? lesson().replaceAll("<details>", "<details open>") : lesson()}`.replace(
      "</h2>", `</h2><figure>${pictures.map((picture) => `<img src="${picture}" alt="">`).join("")}</figure>`))
}
