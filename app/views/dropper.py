"""A place to drop files on; their content stays in memory and is handed over when all are there."""

from pathlib import Path
from typing import ClassVar

import param
from panel.custom import JSComponent

from .scripts import joined

FOLDER = Path(__file__).parent
NAME_LENGTH = 120  # of a file's name, as shown in messages


class Dropper(JSComponent):
    """Collects files, up to `most` bytes a drop, for `on_files([(name, content), …])`."""

    label = param.String()
    most = param.Integer(doc="bytes of all files of one drop together")

    _esm = joined("ask", "dropper")
    _stylesheets: ClassVar = [FOLDER / "dropper.css"]

    def __init__(self, on_files, on_refusal, **params):
        """on_refusal(line): told why a drop was refused."""
        super().__init__(**params)
        self._on_files, self._on_refusal = on_files, on_refusal
        self._pieces, self._size = {}, 0

    def _handle_msg(self, message):
        """One message of the page: a beginning, a piece of a file, or the end."""
        if message.get("begin"):
            self._pieces, self._size = {}, 0
        elif message.get("end"):
            pieces, self._pieces = self._pieces, {}
            if self._size <= self.most and pieces:
                self._on_files([(name, b"".join(parts)) for name, parts in pieces.items()])
            self._size = 0
        else:
            self._take(str(message.get("name", ""))[:NAME_LENGTH], message.get("data", b""))

    def _take(self, name, data):
        # A page may have been altered: the limit holds here, whatever it sends.
        size = data.nbytes if isinstance(data, memoryview) else len(data)
        within, self._size = self._size <= self.most, self._size + size
        if self._size <= self.most:
            self._pieces.setdefault(name, []).append(bytes(data))
        elif within:
            self._pieces = {}
            self._on_refusal(f"more than {self.most / 1e6:g} MB were sent; nothing was read")
