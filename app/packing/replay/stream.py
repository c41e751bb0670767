"""Results in progress, sent to one page's player as fast as its browser paints them."""

from functools import partial
from typing import Any

from bokeh.document import Document

from ...background.notifications import observe
from ...browser.panel_patches import together
from ...state.app_state import AppState

TICK_MS = 40  # interval of polling
AHEAD = 2  # messages that the browser may have received but not yet painted


class Stream:
    """Sends results of a page's `state.follow()` to its player, but not to hidden tabs."""

    def __init__(self, state: AppState, player: Any, document: Document | None = None) -> None:
        """document: provides the timer; without one, call `tick` yourself."""
        self.state, self.work, self.player = state, state.work, player
        self._document = document
        self._sent = self._painted = 0  # numbers of the last messages sent, and painted
        self._visible, self._ticking = False, None
        self.work.param.watch(self._follow, "live")
        observe(self._show, state, "missing", "selection", "cell", "work.busy")
        self._follow()

    def start(self, visible: bool) -> None:
        """Begin anew, for a page that has been redrawn."""
        self._sent, self._painted, self._visible = 0, 0, visible
        if self.work.live is not None:
            self.work.live.rewind()

    def look(self, visible: bool) -> None:
        """Send to a visible page only."""
        self._visible = visible

    def confirm(self, painted: int) -> None:
        """The page has painted the message with this number."""
        self._painted = painted

    def _show(self, *events: Any) -> None:
        self.player.requested = self.state.requested

    def _follow(self, *events: Any) -> None:
        self._show()
        self.player.live = self.work.live is not None
        if self._document is None or self.player.live == (self._ticking is not None):
            return
        if self.player.live:
            tick = partial(together, self.tick)
            self._ticking = self._document.add_periodic_callback(tick, TICK_MS)
        else:
            self._document.remove_periodic_callback(self._ticking)
            self._ticking = None

    def tick(self) -> None:
        """Send new results if the browser is ready for them."""
        following = self.state.follow()
        while following and self._visible and self._sent - self._painted < AHEAD:
            news = following.next()
            if news is None:
                return
            if "replay" in news:
                self.state.grow(news["replay"])
                continue
            if "picture" in news:
                self.work.moving = True
            self._sent += 1
            self.player.tell(news | {"number": self._sent})
            if "states" in news:
                self.work.fourfold = following.fourfold
