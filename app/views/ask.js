/** Tell the server something. */
function ask(model, view, message) {
  // Bokeh takes what came from the server for new until the page next tells the server something,
  // and would send this component, functions and all, along with its first message.
  view.model.document?._new_models?.delete(view.model)
  model.send_msg(message)
}
