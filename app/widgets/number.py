"""A field for a whole number."""

from collections.abc import Callable
from typing import Any

import param

from ..browser.bundle import Scripted
from ..browser.messages import Message


class NumberField(Scripted):
    """A whole number, taken over by Enter or on leaving the field; see number.js.

    Not panel-material-ui's IntInput: after Enter it took no more typing until it lost focus, and
    what did not fit beside its buttons was cut.
    """

    label = param.String()
    value = param.Integer(default=0)
    start = param.Integer(default=0)
    end = param.Integer(default=2**53 - 1)
    step = param.Integer(default=1, doc="of the arrow keys and buttons")
    disabled = param.Boolean()

    def __init__(self, on_wrong: Callable[[str], object], **params: Any) -> None:
        """on_wrong(line): told what is wrong with what was typed, if anything."""
        super().__init__(**params)
        self._on_wrong = on_wrong

    def _heard(self, message: Message) -> None:
        """Something was typed that is no whole number."""
        typed, within = message["typed"][:30], f"{self.start} to {self.end}"
        self._on_wrong(f"{self.label} must be a whole number from {within}, got {typed!r}")
