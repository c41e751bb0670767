"""A place to drop files on; their content stays in memory and is handed over when all are there."""

from collections.abc import Callable
from typing import Any

import param

from ..browser.bundle import Scripted
from ..browser.messages import Message

NAME_LENGTH = 120  # of a file's name, as shown in messages
MOST_FILES = 16  # of one drop; a packing has two at most


class Dropper(Scripted):
    """Collects files, up to `most` bytes a drop, for `on_files([(name, content), …])`.

    Not Panel's FileInput: told to take 1 kB, it held 100 MB of unfinished files sent to it.
    """

    label = param.String()
    most = param.Integer(doc="bytes of all files of one drop together")

    _files: Any  # {name: content}; None once the drop was refused

    def __init__(
        self,
        on_files: Callable[[list[tuple[str, bytes]]], object],
        on_refusal: Callable[[str], object],
        **params: Any,
    ) -> None:
        """on_refusal(line): told why a drop was refused."""
        super().__init__(**params)
        self._on_files, self._on_refusal = on_files, on_refusal
        self._files, self._size = {}, 0

    def _heard(self, message: Message) -> None:
        """One message of the page: a beginning, a piece of a file, or the end."""
        # A page may have been altered: the limits hold here, whatever it sends.
        if "begin" in message:
            self._files, self._size = {}, 0
        elif "end" in message:
            files, self._files = self._files, {}
            if files:
                self._on_files([(name, bytes(content)) for name, content in files.items()])
        elif self._files is not None:
            self._take(message["name"][:NAME_LENGTH], message["data"])

    def _take(self, name: str, data: Any) -> None:
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
        """Forget the drop, and whatever else of it is to come."""
        self._files = None
        self._on_refusal(f"{why}; nothing was read")
