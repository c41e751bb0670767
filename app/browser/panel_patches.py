"""Private features of Panel, Bokeh and Material UI, and workarounds: only in this file."""

from collections.abc import Callable
from typing import Any

import panel as pn
import panel_material_ui as pmui
import param
from bokeh.document import Document
from bokeh.models import CustomJS
from panel.io import document as panel_document
from panel.io import location as panel_location
from panel.io import unlocked
from panel.links import Callback
from panel.reactive import Syncable
from panel.util import edit_readonly  # type: ignore[attr-defined]  # not exported by panel

# Fetch and run Material UI as soon as possible, not after the page's contents: saves 0.13 s. Its
# address must be the one that Panel requests, or it would run twice. On navigation the old page
# stays until the new one is visible, and fades into it.
EARLY = """{%% extends "base.html" %%}
{%% block preamble %%}{{ super() }}<style>@view-transition { navigation: auto; }</style><script>
  document.addEventListener("load", (event) => {
    if (event.target.src?.includes("es-module-shims")) importShim("%s")
  }, true)
</script>{%% endblock %%}"""

# Panel builds the views of a new child before React mounts them; if the window is resized in
# between, Bokeh measures plots without a layout, fails, and leaves everything unchanged.
UNMOUNTED = """
const view = Bokeh.Models.get("Figure").prototype.default_view.prototype
for (const name of ["measure_layout", "after_layout"]) {
  const usual = view[name]
  view[name] = function () { if (this.layout != null) usual.call(this) }
}
"""

# Where fingers scroll the page, a plot under them would block scrolling.
FINGERS = """
const {prototype} = Bokeh.Models.get("Figure").prototype.default_view
const {initialize} = prototype
prototype.initialize = function () {
  if (matchMedia("(pointer: coarse)").matches) this.model.toolbar.active_drag = null
  initialize.call(this)
}
"""

# Panel's React components listen to changes only some time after they were first drawn; changes in
# between would be lost.
LATE_LISTENERS = """
const {prototype} = Bokeh.Models.get("panel.models.esm.ReactComponent")
const {watch} = prototype
prototype.watch = function (view, name, changed, state) {
  watch.call(this, view, name, changed, state)
  if (state) changed()  // what a component draws, which costs nothing where it is the same
}
"""


def mend_late_views(document: Document) -> None:
    """Make the browser tolerate changes of views that it has not mounted yet.

    The page layout skips plots that are not on the page yet, plots under fingers let the page
    scroll, and components that begin to listen apply the changes since they were drawn.
    """
    mended = [CustomJS(code=code) for code in (UNMOUNTED, FINGERS, LATE_LISTENERS)]
    document.js_on_event("document_ready", *mended)


def answer_with_lock() -> None:
    """Handle browser events while holding Bokeh's lock, as Panel does for changes of parameters."""
    # Panel handles them without the lock while earlier changes are still queued; Bokeh, through
    # which plots are changed, then refuses, and the whole change is lost.
    Syncable._event_coroutine.lock = True  # type: ignore[attr-defined]  # the attribute acts as a mark


def leave_links_alone() -> None:
    """Keep Panel from parsing the address, which the page reads by itself."""
    # Panel converts everything that looks like a number, and fails beyond 4300 digits: the page
    # would stay empty. Other values that it cannot parse go to the log at full length.
    vars(panel_location)["parse_query"] = lambda query: {}  # not exported by panel


_process_links = Callback._process_callbacks


def _process_present_links(*given: Any, **options: Any) -> None:
    if any(Callback.registry.values()):
        _process_links(*given, **options)


def search_for_present_links_only() -> None:
    """Keep Panel from searching the whole page for links at every change, where there are none."""
    Callback._process_callbacks = _process_present_links  # type: ignore[method-assign]


def send_what_waits(document: Document) -> None:
    """Send messages that Panel holds back although nothing blocks them any more."""
    # One of its tasks, after sending its own messages, removes the mark that tells the next task to
    # send; the messages would wait for the next change.
    if document in panel_document._WRITE_MSGS:
        panel_document._WRITE_BLOCK[document] = True
        panel_document._dispatch_write_task(document, panel_document._dispatch_msgs, document)


def together(function: Callable[..., object], **arguments: Any) -> None:
    """Call a function, and send all its changes of the page as one message, in order."""
    # Bokeh sends by itself what Panel does not hold, which may overtake Panel's queue: changes of a
    # plot would reach a browser before the plot.
    with unlocked():
        function(**arguments)


def early_template() -> str:
    """A template of the page that makes the browser fetch Material UI as soon as possible."""
    return EARLY % pmui.Page._render_esm(server=True)


def without_busy_watch(whole: pmui.Page) -> None:
    """Remove the page from Panel's busy tracking, which would keep every closed page in memory."""
    with edit_readonly(whole):
        whole.busy = param.rx(False)


def in_transit(document: Document) -> bool:
    """Whether the browser has connected but not yet confirmed that it has the page.

    Panel drops changes before that, as if the browser had yet to fetch the page: changes after the
    fetch would be lost.
    """
    context: Any = document.session_context
    session = None if context is None else context.session
    return not pn.state.loaded and session is not None and session.connection_count > 0


def once_loaded(document: Document | None, function: Callable[[], object]) -> None:
    """Call a function now or, if its page is in transit, once the browser has confirmed it."""
    if document is None or not in_transit(document):
        function()
    else:  # on the next tick: Panel marks the page as loaded after its onload callbacks
        pn.state.onload(lambda: document.add_next_tick_callback(function))


def unseen_ms(context: Any) -> float:
    """Time in ms without a browser connected to a page's session; 0 while one is connected."""
    session = None if context is None else context.session
    if session is None or session.connection_count:
        return 0.0
    return float(session.milliseconds_since_last_unsubscribe)
