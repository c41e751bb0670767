// What stands on the page of a small scene, before it is filled.

/** Its HTML; most: μ at the end of the slider. */
export function desk(most) {
  return `
    <p class="whole">Many different sets of forces can hold the same disks at rest.
      <span>So no photograph of a heap of sand, however sharp, can show how much each grain carries. Here you can try out such sets of forces.</span></p>
    <div class="strip">
      <label>Scene <select class="name" aria-label="Scene"></select></label>
      <label class="mu">friction μ <input class="range" type="range" min="0" max="${most}" step="0.005" aria-label="friction μ">
        <input class="typed" inputmode="decimal" aria-label="μ"></label>
      <span class="buttons">
        <button type="button" class="play" title="Go at random through S, from one set of forces to the next">Random walk</button>
        <button type="button" class="fill" title="Fill S with points, everywhere equally many">Random points</button>
        <button type="button" class="undo" title="Take the last pull back (Z)" disabled>Undo</button>
        <button type="button" class="push" title="Drag a disk, or use the arrow keys, to push it" aria-pressed="false">Test push</button>
        <button type="button" class="save" title="This scene as a file for granforce: gf.load_packing">Download data</button>
        <button type="button" class="more" title="Walk, points, push, data">More …</button>
        <button type="button" class="tourist">Tour</button>
      </span>
    </div>
    <p class="says" aria-live="polite"></p><button type="button" class="mend" hidden></button>
    <div class="own" hidden></div>
    <section class="card" role="dialog" aria-labelledby="small-title" hidden>
      <div><h2 id="small-title" tabindex="-1"></h2><p></p></div>
      <div class="row"><span class="of"></span><button type="button" class="earlier">Back</button>
        <button type="button" class="next">Next</button><button type="button" class="close">Close</button></div>
    </section>
    <div class="board">
    <p class="quest none" aria-live="polite"></p>
    <div class="pair">
      <figure><figcaption class="legend"></figcaption>
        <canvas class="packing" tabindex="0" role="img" aria-label="Disks, and the force on them at every contact"></canvas></figure>
      <figure><figcaption class="what"></figcaption>
        <canvas class="space" tabindex="0" role="img" aria-label="S: every point is one set of forces. Arrow keys move the point"></canvas>
        <div class="plane" hidden><label>horizontal axis <select aria-label="force shown across"></select></label>
          <label>vertical axis <select aria-label="force shown upwards"></select></label></div></figure>
      <div class="sums"><p class="special"></p><p class="count"></p>
        <details class="ranges"><summary class="key"></summary><div class="bars" role="list"></div></details></div>
    </div>
    <details class="lesson" hidden><summary>The groove: a one-page lesson with three questions</summary>
      <button type="button" class="print">Print</button> <button type="button" class="print answered">Print with answers</button>
      <article></article></details>
    </div>`
}
