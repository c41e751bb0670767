"""One visitor's page from start to end: its thread, its visitor, and its work."""

from collections.abc import Callable
from functools import partial
from typing import Any
from urllib.parse import parse_qsl

import panel as pn
from bokeh.document import Document
from tornado.ioloop import IOLoop

from ..background import gc_pauses
from ..background.jobs import Visitor
from ..browser.panel_patches import in_transit, once_loaded, together, unseen_ms
from ..results.library import Library
from .page_tasks import Work

POLL_MS = 200  # interval at which the page polls running work
# Time without a browser after which a page's work is ended; the page itself stays longer.
DISCONNECTED_MS = 3000


def library() -> Library:
    """The stores, opened once for all visitors."""
    return pn.state.as_cached("library", _open_library)


def _open_library() -> Library:
    gc_pauses.settle()
    return Library()


def dark(query: str) -> bool:
    """Whether the visitor chose the dark theme; without a choice that of the link, for frames."""
    given = dict(parse_qsl(query.lstrip("?")))
    return pn.state.cookies.get("dark", given.get("dark")) == "1"


def at_end(*closes: Callable[[], object]) -> None:
    """Count the page as open, and call these functions when it is closed; once for a page."""
    closed = gc_pauses.opened()

    def end(context: object) -> None:
        for close in closes:
            close()
        closed()

    pn.state.on_session_destroyed(end)


def waker(document: Document) -> Callable[[Callable[[], object]], None]:
    """wake(function): call it soon on the page's thread, when its changes can be sent."""
    loop = IOLoop.current()

    def come(function: Callable[[], object]) -> None:
        call = partial(together, function)
        if document.session_context is not None:  # otherwise the page has ended
            document.add_next_tick_callback(partial(once_loaded, document, call))

    def wake(function: Callable[[], object]) -> None:
        # From any thread; the page can end at any time except within a turn of the loop.
        loop.add_callback(come, function)

    return wake


def visitor(document: Document) -> Visitor | None:
    """The visitor of a page: network address and page id."""
    context: Any = document.session_context
    if context is None:
        return None
    # Behind a proxy it is the proxy's address, unless the server runs with --use-xheaders.
    return Visitor(getattr(context.request, "remote_ip", None) or "", context.id)


def poll_while_running(work: Work, document: Document) -> None:
    """Poll tasks while there are any; end them when no browser is connected any more."""
    polling: list[Any] = []
    loaded: list[bool] = []

    def poll() -> None:
        if loaded and unseen_ms(document.session_context) > DISCONNECTED_MS:
            work.cancel()
        if not in_transit(document):
            work.poll()

    def switch(*events: Any) -> None:
        if work.busy and not polling:
            polling.append(document.add_periodic_callback(partial(together, poll), POLL_MS))
        elif polling and not work.busy:
            document.remove_periodic_callback(polling.pop())

    pn.state.onload(lambda: loaded.append(True))
    work.param.watch(switch, "busy")
    switch()
