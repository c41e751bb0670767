"""The page's address: a copy of it reopens the view, Back and Forward go through the views."""

from typing import Any

import param

from ..browser.bundle import Scripted
from ..browser.messages import Message
from ..state.app_state import PASSING, AppState
from ..state.links import VIEW, key


class Address(Scripted):
    """Keeps the address like the state and the state like the address; see address.js.

    It also says when the server is gone, and reopens the view when there is one again. Not Panel's
    Location, which remembers every frame, and tells nobody when the visitor goes back.
    """

    query = param.String(doc="of the address, as the state has it")
    passing = param.List(
        default=[key(name) for name in PASSING],
        doc="what changes the address but is not gone back to",
    )

    def __init__(self, state: AppState, **params: Any) -> None:
        super().__init__(**params)
        self._state = state
        state.param.watch(self._tell, "selection")
        for part in state.parts:
            part.param.watch(self._tell, [name for name in VIEW if name in part.param])
        self._tell()

    def _tell(self, *events: Any) -> None:
        if self._state.cell is not None:
            self.query = f"?{self._state.link()}"

    def _heard(self, message: Message) -> None:
        """The visitor went back or forward to another view."""
        self._state.open(message["query"])
