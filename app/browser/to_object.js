// A dict from the server arrives as a Map or as an object.

/** Convert data from the server, a Map or a plain object, to a plain object. */
export function plain(given) {
  return given instanceof Map ? Object.fromEntries(given) : given
}
