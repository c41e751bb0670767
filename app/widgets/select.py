"""A choice from a list."""

import param

from ..browser.bundle import Scripted


class Select(Scripted):
    """A list with one chosen entry; see select.js.

    Not panel-material-ui's Select: screen readers find no options in its open menu.
    """

    label = param.String()
    options = param.Dict(default={}, doc="{words: value}")
    value = param.String()
