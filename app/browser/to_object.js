// What the server sends as a dict comes as a Map, or as an object.

/** Takes what the server sent, a Map or a plain object, as a plain object. */
export function plain(given) {
  return given instanceof Map ? Object.fromEntries(given) : given
}
