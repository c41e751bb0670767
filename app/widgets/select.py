"""One of several, chosen from a list."""

import param

from ..browser.bundle import Scripted


class Select(Scripted):
    """A list of which one is chosen; see select.js.

    Not panel-material-ui's Select: its open menu is told to screen readers as one without options.
    """

    label = param.String()
    options = param.Dict(default={}, doc="{words: value}")
    value = param.String()
