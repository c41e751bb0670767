// The empty layout of the workbench.

import { lastChapter } from "../../browser/local_storage.js"
import { asked } from "../../browser/scene_options.js"

/** Its HTML; most: μ at the end of the slider. */
export function layout(most) {
  return `
    <div class="strip">
      <a href="?learn=${lastChapter()}">◂ Lesson</a>
      <label>Scene <select class="name" aria-label="Scene"></select></label>
      <label class="mu">friction μ <input class="range" type="range" min="0" max="${most}" step="0.005" aria-label="friction μ">
        <input class="typed" inputmode="decimal" aria-label="μ"></label>
      <span class="buttons">
        <button type="button" class="soft play" title="Go at random through S, from one set of forces to the next">Random walk</button>
        <button type="button" class="soft fill" title="Fill S with points, everywhere equally many">Random points</button>
        <button type="button" class="soft undo" title="Undo the last pull (Z)" disabled>Undo</button>
        <button type="button" class="soft push" title="Drag a disk, or use the arrow keys, to push it" aria-pressed="false">Test push</button>
        <button type="button" class="soft save" title="This scene as a file for granforce: gf.load_packing">Download data</button>
      </span>
    </div>
    <p class="asked">${asked()}</p><p class="says" aria-live="polite"></p><button type="button" class="soft mend" hidden></button>
    <div class="own" hidden></div>
    <div class="pair">
      <figure><figcaption class="legend"></figcaption>
        <canvas class="packing" tabindex="0" role="img" aria-label="Disks, and the force on them at every contact"></canvas></figure>
      <figure><figcaption class="what"></figcaption>
        <canvas class="space" tabindex="0" role="img" aria-label="S: every point is one set of forces. Arrow keys move the point"></canvas>
        <div class="plane" hidden><label>horizontal axis <select aria-label="force shown across"></select></label>
          <label>vertical axis <select aria-label="force shown upwards"></select></label></div></figure>
      <div class="sums"><p class="special"></p><p class="count"></p>
        <details class="ranges"><summary class="key"></summary><div class="bars" role="list"></div></details></div>
    </div>`
}
