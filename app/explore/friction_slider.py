"""Slider for the friction coefficient."""

from collections.abc import Callable
from typing import Any

import param

from ..browser.bundle import Scripted
from ..browser.messages import from_browser
from ..results.library import LEAST_PLACE

MOST_PLACE = 1.0  # log10 of the largest μ on the slider; larger ones can be typed


class FrictionSlider(Scripted):
    """μ on a logarithmic scale that snaps to the values in `stored`; see friction_slider.js."""

    to_browser = ({"settled": True},)  # the typed value was accepted or refused

    mu = param.Number(default=0.1)
    hill = param.List(default=[], doc="[(μ, η2)] to be drawn along it")
    fixed = param.Boolean(doc="whether the packing does not depend on μ")
    stored = param.List(default=[], doc="values of μ that need no computing")
    least = param.Number(default=LEAST_PLACE, constant=True, doc="stands for μ = 0")
    most = param.Number(default=MOST_PLACE, constant=True)

    def __init__(self, on_typed: Callable[[str], object], **params: Any) -> None:
        """on_typed(text): called with a typed value, valid or not."""
        super().__init__(**params)
        self._on_typed = on_typed

    @from_browser(typed=str)
    def _take(self, typed: str) -> None:
        self._on_typed(typed)
        self.tell({"settled": True})
