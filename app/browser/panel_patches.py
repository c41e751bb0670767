"""What is private to Panel, Bokeh and Material UI, and how their habits are mended: only here."""

from collections.abc import Callable
from typing import Any

import panel as pn
import panel_material_ui as pmui
import param
from bokeh.document import Document
from bokeh.models import CustomJS
from panel.io import document as panel_document
from panel.io import unlocked
from panel.reactive import Syncable
from panel.util import edit_readonly  # type: ignore[attr-defined]  # which panel says is no export

# Material UI is fetched and run as soon as the page can, not after the page's contents have come:
# 0.13 s. Its address must be the one that Panel asks for, or it would be run twice.
# From one page to another the old one stays until the new one is seen, and fades into it.
EARLY = """{%% extends "base.html" %%}
{%% block preamble %%}{{ super() }}<style>@view-transition { navigation: auto; }</style><script>
  document.addEventListener("load", (event) => {
    if (event.target.src?.includes("es-module-shims")) importShim("%s")
  }, true)
</script>{%% endblock %%}"""

# Panel builds the views of a new child before React mounts them; told of another size of the
# window in between, Bokeh measures plots that have no layout yet, fails, and leaves all as it was.
UNMOUNTED = """
const view = Bokeh.Models.get("Figure").prototype.default_view.prototype
for (const name of ["measure_layout", "after_layout"]) {
  const usual = view[name]
  view[name] = function () { if (this.layout != null) usual.call(this) }
}
"""

# Where fingers scroll the page, a plot that is dragged by them would hold it fast.
FINGERS = """
const {prototype} = Bokeh.Models.get("Figure").prototype.default_view
const {initialize} = prototype
prototype.initialize = function () {
  if (matchMedia("(pointer: coarse)").matches) this.model.toolbar.active_drag = null
  initialize.call(this)
}
"""

# Panel's React components listen to changes only some time after they were first drawn: what came
# in between would never be seen.
LATE_LISTENERS = """
const {prototype} = Bokeh.Models.get("panel.models.esm.ReactComponent")
const {watch} = prototype
prototype.watch = function (view, name, changed, state) {
  watch.call(this, view, name, changed, state)
  if (state) changed()  // what a component draws, which costs nothing where it is the same
}
"""


def mend_late_views(document: Document) -> None:
    """Have the browser bear with what is told to it of views that it has not mounted yet.

    Plots that are not on the page yet are passed over where it lays the page out, those under
    fingers let the page scroll, and components that begin to listen take over what has changed
    since they were drawn.
    """
    mended = [CustomJS(code=code) for code in (UNMOUNTED, FINGERS, LATE_LISTENERS)]
    document.js_on_event("document_ready", *mended)


def answer_with_lock() -> None:
    """Have events of a browser answered while Bokeh's lock is held, as its changes are."""
    # Panel does without it where changes told just before still wait for their turn, and answers
    # them, too: Bokeh, through which plots are changed, refuses then, and all of it is lost.
    Syncable._event_coroutine.lock = True  # type: ignore[attr-defined]  # a mark on it


def send_what_waits(document: Document) -> None:
    """Send messages that Panel keeps back although nothing holds them any more."""
    # One of its tasks, having sent its own, takes away the mark by which the next would know that
    # it has some to send; they would wait for the next change.
    if document in panel_document._WRITE_MSGS:
        panel_document._WRITE_BLOCK[document] = True
        panel_document._dispatch_write_task(document, panel_document._dispatch_msgs, document)


def together(function: Callable[..., object], **arguments: Any) -> None:
    """Call a function, and send all it changes on the page as one message, in its turn."""
    # Bokeh sends by itself what Panel does not hold, and that may overtake what waits in Panel's
    # queue: changes of a plot would reach a browser that has not got the plot yet.
    with unlocked():
        function(**arguments)


def early_template() -> str:
    """A template of the page that has the browser fetch Material UI as soon as it can."""
    return EARLY % pmui.Page._render_esm(server=True)


def without_busy_watch(whole: pmui.Page) -> None:
    """Free the page from Panel's record of what is busy, which would keep every closed page."""
    with edit_readonly(whole):
        whole.busy = param.rx(False)


def in_transit(document: Document) -> bool:
    """Whether the browser has connected but not yet said that it has the page.

    Panel forgets what changes before that, as if the browser were still to fetch the page: changes
    after it was fetched would be lost.
    """
    context: Any = document.session_context
    session = None if context is None else context.session
    return not pn.state.loaded and session is not None and session.connection_count > 0


def unseen_ms(context: Any) -> float:
    """For how long, in ms, no browser has been connected to a page's session; 0 while one is."""
    session = None if context is None else context.session
    if session is None or session.connection_count:
        return 0.0
    return float(session.milliseconds_since_last_unsubscribe)
