"""What is being computed, sent to one page's player as fast as its browser paints it."""

from functools import partial
from typing import Any

from bokeh.document import Document

from ...browser.messages import Message
from ...browser.panel_patches import together
from ...state.app_state import AppState
from ..player import Player

TICK_MS = 40  # how often it is looked for something new
AHEAD = 2  # messages that the browser may have got and not yet painted


class Stream:
    """Sends what a page's `state.follow()` has to show to its player; nothing to hidden tabs."""

    def __init__(self, state: AppState, player: Player, document: Document | None = None) -> None:
        """document: on which the time is kept; without one, call `tick` yourself."""
        self.state, self.work, self.player = state, state.work, player
        self._document = document
        self._sent = self._painted = 0
        self._awake, self._ticking = False, None
        player.hears["live"] = self.heard
        self.work.param.watch(self._follow, ["live", "arriving"])
        state.param.watch(self._show, ["missing", "selection", "cell"])
        self.work.param.watch(self._show, "busy")
        self._follow()

    def heard(self, message: Message) -> None:
        """The browser tells that it draws anew, what it has painted, and whether it is seen."""
        if "anew" in message:
            self._sent = self._painted = 0
            if self.work.live is not None:
                self.work.live.rewind()
        self._painted = message.get("painted", self._painted)
        self._awake = message.get("seen", self._awake)

    def _show(self, *events: Any) -> None:
        self.player.asked = self.state.asked

    def _follow(self, *events: Any) -> None:
        self._show()
        self.player.live = self.work.live is not None
        ticking = self.player.live or self.work.arriving is not None
        if self._document is None or ticking == (self._ticking is not None):
            return
        if ticking:
            tick = partial(together, self.tick)
            self._ticking = self._document.add_periodic_callback(tick, TICK_MS)
        else:
            self._document.remove_periodic_callback(self._ticking)
            self._ticking = None

    def tick(self) -> None:
        """Send what is new, if the browser waits for it."""
        following = self.state.follow()
        while following and self._awake and self._sent - self._painted < AHEAD:
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
                self.work.fourfold = following.fourfold  # type: ignore[union-attr]  # no Arriving
