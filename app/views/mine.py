"""My computations: what is in the visitor's own cache, to be opened, named or deleted."""

from typing import Any

import param

from granforce.records import InputError

from .. import mine, names
from ..jobs import reading
from ..state import AppState
from .messages import Message
from .scripts import Scripted


class Mine(Scripted):
    """A table of what was computed here, the newest first; see mine.js."""

    rows = param.List(doc="dicts, see mine.rows; and `here`, whether it is on screen")

    def __init__(self, state: AppState, **params: Any) -> None:
        super().__init__(sizing_mode="stretch_width", **params)
        self._state, self._task = state, state.work.task(reading)
        state.param.watch(self._list, ["catalogue", "cell"])
        self._list()

    def _list(self, *events: Any) -> None:
        if self._state.library.cache is not None:
            self._task.start(lambda job: mine.rows(self._state.library), self._show)

    def _show(self, rows: list[dict[str, Any]]) -> None:
        on_screen = self._state.cell and self._state.cell.name
        self.rows = [row | {"here": row["entry"] == on_screen} for row in rows]

    def _heard(self, message: Message) -> None:
        """The visitor opens, names or deletes one of the rows."""
        state, known = self._state, {row["entry"] for row in self.rows}
        match message:
            case {"open": str(entry)} if entry in known:
                for cell in state.catalogue:
                    if cell.name == entry:
                        state.show(cell)
            case {"call": [str(entry), str(name)]} if entry in known:
                try:
                    names.call(state.library.own, entry, name)
                except InputError as error:
                    state.work.message = str(error)
                self._list()
            case {"delete": str(entry)} if entry in known:
                self._task.start(
                    lambda job: mine.delete(state.library, entry), lambda nothing: state.refresh()
                )
