"""Buttons that hand files over: made when asked for, saved by the browser."""

from typing import ClassVar

import param
from panel.custom import JSComponent

from .scripts import joined


class Handover(JSComponent):
    """A button for each of `files`; `on_ask(key)` has `hand_over` called in time."""

    files = param.Dict(default={}, doc="{heading: {key: words}}")

    _esm = joined("ask", "handover")
    _stylesheets: ClassVar = [
        """
        :host { display: block; }
        section { display: flex; flex-wrap: wrap; gap: 6px; margin-bottom: 14px; }
        h4 {
          flex: 1 0 100%; margin: 0; font-size: 12px; font-weight: 400; letter-spacing: 0.08em;
          text-transform: uppercase;
        }
        button {
          padding: 7px 12px; border-radius: 5px; background: transparent; font: inherit;
          font-size: 13px; color: inherit; border: 1px solid rgba(128, 128, 128, 0.5);
          cursor: pointer;
        }
        button:hover { background: rgba(128, 128, 128, 0.15); }
        button:focus-visible { outline: 2px solid #e8710a; }
        button.busy { opacity: 0.5; }
        """
    ]

    def __init__(self, on_ask, **params):
        super().__init__(**params)
        self._on_ask = on_ask

    def hand_over(self, file, png=False):
        """Have the browser save an exports.File; png: rendered from an SVG."""
        self._send_msg({**file._asdict(), "png": png})

    def _handle_msg(self, message):
        key = message.get("key")
        if any(key in group for group in self.files.values()):
            self._on_ask(key)
