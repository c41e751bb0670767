"""Scrolling to what is unfolded."""

from ..browser.bundle import Scripted


class Unfolding(Scripted):
    """Scrolls an opened fold into view, as its end may be below the window; see unfolding.js."""
