"""My computations: the visitor's own cache, to open, name or delete entries."""

from typing import Any

import param

from granforce.records import InputError

from ....background.jobs import reading
from ....browser.bundle import Scripted
from ....browser.messages import Message
from ....results import entry_labels, my_results
from ....state.app_state import AppState


class Mine(Scripted):
    """A table of stored computations, newest first; see my_computations.js."""

    rows = param.List(doc="dicts, see my_results.rows; and `shown`, whether it is on screen")

    def __init__(self, state: AppState, **params: Any) -> None:
        super().__init__(sizing_mode="stretch_width", **params)
        self._state, self._task = state, state.work.task(reading)
        state.param.watch(self._list, ["catalogue", "cell"])
        self._list()

    def _list(self, *events: Any) -> None:
        if self._state.library.cache is not None:
            self._task.start(lambda job: my_results.rows(self._state.library), self._show)

    def _show(self, rows: list[dict[str, Any]]) -> None:
        on_screen = self._state.cell and self._state.cell.name
        self.rows = [row | {"shown": row["entry"] == on_screen} for row in rows]

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
                    entry_labels.call(state.library.writable_cache, entry, name)
                except InputError as error:
                    state.work.message = str(error)
                self._list()
            case {"delete": str(entry)} if entry in known:
                self._task.start(
                    lambda job: my_results.delete(state.library, entry),
                    lambda nothing: state.refresh(),
                )
