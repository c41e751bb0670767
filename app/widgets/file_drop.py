"""A place to drop files; their content stays in memory and is passed on when all have arrived."""

from collections.abc import Callable
from typing import Any

import param

from ..browser.bundle import Scripted
from ..browser.messages import from_browser

NAME_LENGTH = 120  # characters of a file name in messages
MOST_FILES = 16  # per drop; a packing has at most two


class Dropper(Scripted):
    """Collects files, up to `most` bytes a drop, for `on_files([(name, content), …])`.

    Not Panel's FileInput, which kept 100 MB of unfinished files when limited to 1 kB.
    """

    label = param.String()
    most = param.Integer(doc="bytes of all files of one drop together")

    _files: Any  # {name: content}; None after the drop was refused

    def __init__(
        self,
        on_files: Callable[[list[tuple[str, bytes]]], object],
        on_refusal: Callable[[str], object],
        **params: Any,
    ) -> None:
        """on_refusal(line): called with the reason if a drop is refused."""
        super().__init__(**params)
        self._on_files, self._on_refusal = on_files, on_refusal
        self._files, self._size = {}, 0

    @from_browser(begin=True)
    def _begin(self) -> None:
        self._files, self._size = {}, 0

    @from_browser(end=True)
    def _end(self) -> None:
        files, self._files = self._files, {}
        if files:
            self._on_files([(name, bytes(content)) for name, content in files.items()])

    @from_browser(name=str, data=object)
    def _take(self, name: str, data: Any) -> None:
        """Add a piece of a file; a page may have been altered, so the limits are enforced here."""
        if self._files is None:
            return None
        name = name[:NAME_LENGTH]
        if not isinstance(data, (bytes, bytearray, memoryview)):
            return self._refuse("the upload is not a file")
        self._size += memoryview(data).nbytes
        if self._size > self.most:
            return self._refuse(f"more than {self.most / 1e6:g} MB were sent")
        self._files[name] = self._files.get(name, bytearray())
        self._files[name] += data
        if len(self._files) > MOST_FILES:
            self._refuse(f"more than {MOST_FILES} files were sent")

    def _refuse(self, why: str) -> None:
        """Discard the drop and the rest of its pieces."""
        self._files = None
        self._on_refusal(f"{why}; nothing was read")
