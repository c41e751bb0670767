"""Buttons that hand files over: made when asked for, saved by the browser."""

from collections.abc import Callable
from typing import Any

import param

from ..browser.bundle import Scripted
from ..browser.messages import Message
from ..explore.tabs.export.files import File


class Handover(Scripted):
    """A button for each of `files`; `on_ask(key)` has `hand_over` called in time.

    Not Panel's FileDownload: it makes files on the page's thread, and seven take 107 ms, this 5 ms.
    """

    files = param.Dict(default={}, doc="{heading: {key: words}}")

    def __init__(self, on_ask: Callable[[str], object], **params: Any) -> None:
        super().__init__(**params)
        self._on_ask = on_ask

    def hand_over(self, file: File) -> None:
        """Have the browser save an exports.File."""
        self.tell(file._asdict())

    def hand_over_picture(
        self, name: str, caption: dict[str, Any], width: int | None = None
    ) -> None:
        """Have the browser draw the packing as on screen (SVG, PNG), or record it (WebM), and save.

        caption: background, ink, bar {low, high, stops} and lines of words; width: in mm, of one
        figure with the plots that are seen (SVG, or PDF by printing).
        """
        self.tell({"name": name, "caption": caption} | ({"width": width} if width else {}))

    def rest(self) -> None:
        """No file comes for what was asked."""
        self.tell({"rest": True})

    def _heard(self, message: Message) -> None:
        key = message["key"]
        if any(key in group for group in self.files.values()):
            self._on_ask(key)
