// Messages to the server, and data from it.

/** Send a message to the server. */
export function ask(model, view, message) {
  knownThere(view.model.document)
  model.send_msg(message)
}

/** Do not send along with messages what the server already knows. */
export function knownThere(page) {
  if (!page || page.knownThere) return
  page.knownThere = true
  // Until the page next sends a message, Bokeh treats what came from the server as new and would
  // send it along, functions included: the names of the server's models distinguish them from our
  // own.
  const create = page.create_json_patch.bind(page)
  page.create_json_patch = (events) => {
    for (const model of page._new_models) if (/^p\d+$/.test(model.id)) page._new_models.delete(model)
    return create(events)
  }
}

/** Data from the server, a Map or a plain object, as a plain object. */
export function plain(given) {
  return given instanceof Map ? Object.fromEntries(given) : given
}
