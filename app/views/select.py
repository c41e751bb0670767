"""One of several, chosen from a list."""

from typing import ClassVar

import param

from .scripts import FOLDER, Scripted, module


class Select(Scripted):
    """A list of which one is chosen; see select.js.

    Not panel-material-ui's Select: its open menu is told to screen readers as one without options.
    """

    label = param.String()
    options = param.Dict(default={}, doc="{words: value}")
    value = param.String()

    _esm = module("select")
    _stylesheets: ClassVar = [FOLDER / "select.css"]
