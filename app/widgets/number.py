"""A field for a whole number."""

from collections.abc import Callable
from typing import Any

import param

from ..browser.bundle import Scripted
from ..browser.messages import from_browser


class NumberField(Scripted):
    """A whole number, applied by Enter or on leaving the field; see number.js.

    Not panel-material-ui's IntInput: after Enter it accepted no input until it lost focus, and
    numbers too wide for the space next to its buttons were cut off.
    """

    label = param.String()
    value = param.Integer(default=0)
    start = param.Integer(default=0)
    end = param.Integer(default=2**53 - 1)
    step = param.Integer(default=1, doc="of the arrow keys and buttons")
    disabled = param.Boolean()

    def __init__(self, on_wrong: Callable[[str], object], **params: Any) -> None:
        """on_wrong(line): called with the reason if the input is invalid, or an empty line."""
        super().__init__(**params)
        self._on_wrong = on_wrong

    @from_browser(typed=str)
    def _refuse(self, typed: str) -> None:
        """Refuse input that is not a whole number."""
        within = f"{self.start} to {self.end}"
        self._on_wrong(f"{self.label} must be a whole number from {within}, got {typed[:30]!r}")
