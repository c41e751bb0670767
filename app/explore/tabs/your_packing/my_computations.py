"""My computations: the visitor's own cache, to open, name or delete entries."""

from typing import Any

import param

from granforce.records import InputError

from ....background.jobs import reading
from ....browser.bundle import Scripted
from ....browser.messages import from_browser
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

    def _has(self, entry: str) -> bool:
        return any(row["entry"] == entry for row in self.rows)

    @from_browser(open=str)
    def _open(self, open: str) -> None:
        for cell in self._state.catalogue:
            if cell.name == open and self._has(open):
                self._state.show(cell)

    @from_browser(entry=str, name=str)
    def _name(self, entry: str, name: str) -> None:
        state = self._state
        if self._has(entry):
            try:
                entry_labels.call(state.library.writable_cache, entry, name)
            except InputError as error:
                state.work.message = str(error)
            self._list()

    @from_browser(delete=str)
    def _delete(self, delete: str) -> None:
        library = self._state.library
        if self._has(delete):
            self._task.start(
                lambda job: my_results.delete(library, delete),
                lambda nothing: self._state.refresh(),
            )
