// Movies of a canvas, recorded by the browser.

const RATE = 6e6 // bits per second
const HELD_MS = 500 // hold on the last picture; a shorter one would be lost
const LONGEST_MS = 60000
const KINDS = ["video/mp4", "video/webm"] // the first that the browser records, unless one is asked for

/**
 * A movie, as a blob, of a canvas on which paint(ms since the beginning) draws the next frame; paint returns whether it was the
 * last one.
 */
export async function recorded(canvas, paint, mimeType = KINDS.find((kind) => MediaRecorder.isTypeSupported(kind))) {
  const recorder = new MediaRecorder(canvas.captureStream(30), { mimeType, videoBitsPerSecond: RATE }), pieces = []
  recorder.ondataavailable = (event) => pieces.push(event.data)
  const ended = new Promise((resolve) => { recorder.onstop = resolve })
  recorder.start(250)
  const begun = performance.now()
  let over // when the last frame was shown
  const frame = (now) => {
    if (paint(now - begun)) over ??= now
    if ((now - over > HELD_MS && pieces.some(({ size }) => size)) || now - begun > LONGEST_MS) recorder.stop()
    else requestAnimationFrame(frame)
  }
  requestAnimationFrame(frame)
  await ended
  return timed(new Blob(pieces, { type: mimeType }), performance.now() - begun)
}

// Recorders do not write the duration, without which players cannot seek.

const INFO = [0x15, 0x49, 0xa9, 0x66], DURATION = [0x44, 0x89, 0x88] // EBML: ids, and 8 bytes that follow

/** A WebM with its duration (ms) in its Info element; unchanged if that is not found. */
async function timed(movie, duration) {
  const bytes = new Uint8Array(await movie.arrayBuffer())
  const at = bytes.subarray(0, 1000).findIndex((_, k) => INFO.every((byte, n) => bytes[k + n] === byte))
  const size = bytes[at + 4] & 0x7f // one byte long, marked by its highest bit
  if (at < 0 || !(bytes[at + 4] & 0x80) || size === 0x7f) return movie
  const written = new DataView(new ArrayBuffer(8)), longer = new DataView(new ArrayBuffer(8)), end = at + 5 + size
  written.setFloat64(0, duration)
  longer.setBigUint64(0, (1n << 56n) | BigInt(size + DURATION.length + 8)) // a size of eight bytes
  const parts = [
    bytes.subarray(0, at + 4), longer, bytes.subarray(at + 5, end), new Uint8Array(DURATION), written, bytes.subarray(end),
  ]
  return new Blob(parts, { type: movie.type })
}
