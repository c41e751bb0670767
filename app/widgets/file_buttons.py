"""Buttons for files that are made on request and saved by the browser."""

from collections.abc import Callable
from typing import Any

import param

from ..browser.bundle import Scripted
from ..browser.messages import from_browser
from ..results.saved_file import File


class Handover(Scripted):
    """A button for each of `files`; `on_ask(key)` later leads to a call of `hand_over`.

    Not Panel's FileDownload, which makes files on the page's thread: seven take 107 ms, here 5 ms.
    """

    to_browser = (
        {"name": str, "mime": str, "content": object},  # a file
        {"name": str, "caption": dict},  # a picture or movie made by the browser
        {"name": str, "caption": dict, "width": int},  # with the plots, in mm
    )
    files = param.Dict(default={}, doc="{heading: {key: words}}")

    def __init__(self, on_ask: Callable[[str], object], **params: Any) -> None:
        super().__init__(**params)
        self._on_ask = on_ask

    def hand_over(self, file: File) -> None:
        """Make the browser save a File."""
        self.tell(file._asdict())

    def hand_over_picture(
        self, name: str, caption: dict[str, Any], width: int | None = None
    ) -> None:
        """Make the browser draw the packing (SVG, PNG) or record it (WebM), and save it.

        caption: background, ink, bar {low, high, stops} and lines of text; width: in mm, for one
        figure with the visible plots (SVG, or PDF by printing).
        """
        self.tell({"name": name, "caption": caption} | ({"width": width} if width else {}))

    @from_browser(key=str)
    def _request(self, key: str) -> None:
        if any(key in group for group in self.files.values()):
            self._on_ask(key)
