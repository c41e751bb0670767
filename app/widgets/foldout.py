"""Sentences under a line that opens them."""

import param

from ..browser.bundle import Scripted


class Foldout(Scripted):
    """What was opened stays open while it changes; see foldout.js."""

    line = param.String()
    inside = param.String(doc="HTML; empty where there is nothing to say")
    open = param.Boolean()
