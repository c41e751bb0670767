"""The page's address: a copy of it reopens the view, and Back and Forward go through the views."""

from typing import Any

import param

from ..browser.bundle import Scripted
from ..browser.messages import from_browser
from ..state.app_state import PASSING, AppState
from ..state.links import VIEW, key


class Address(Scripted):
    """Keeps the address and the state in sync; see page_address.js.

    It also reports a lost server, and reopens the view when it returns. Not Panel's Location, which
    stores every frame in the history and does not report Back.
    """

    query = param.String(doc="of the address, as the state has it")
    first = param.String(doc="the query of the first view")
    settled = param.Integer(doc="number of Back and Forward requests that have been handled")
    passing = param.List(
        default=[key(name) for name in PASSING],
        doc="what changes the address but is not gone back to",
    )

    def __init__(self, state: AppState, **params: Any) -> None:
        super().__init__(**params)
        self._state, self._requests = state, 0
        state.work.reader.param.watch(self._settle, "running")
        state.param.watch(self._tell, ["selection", "cell"])
        for part in state.parts:
            part.param.watch(self._tell, [name for name in VIEW if name in part.param])
        state.looks.param.watch(self._tell, "pulled")
        self._tell()

    def _tell(self, *events: Any) -> None:
        if self._state.cell is not None:
            query = f"?{self._state.link()}"
            self.param.update(query=query, first=self.first or query)

    def _settle(self, *events: Any) -> None:
        if not self._state.work.reader.running:
            self.settled = self._requests

    @from_browser(query=str)
    def _return(self, query: str) -> None:
        """Open the view to which the visitor went back or forward."""
        self._requests += 1
        self._state.open(query)
        self._settle()
