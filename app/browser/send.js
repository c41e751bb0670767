/** Tell the server something. */
export function ask(model, view, message) {
  knownThere(view.model.document)
  model.send_msg(message)
}

/** Have nothing sent along with messages that the server knows anyway. */
export function knownThere(page) {
  if (!page || page.knownThere) return
  page.knownThere = true
  // Bokeh takes what came from the server for new until the page next tells the server something, and
  // would send it along, functions and all: names of the server's models tell them from our own.
  const create = page.create_json_patch.bind(page)
  page.create_json_patch = (events) => {
    for (const model of page._new_models) if (/^p\d+$/.test(model.id)) page._new_models.delete(model)
    return create(events)
  }
}
