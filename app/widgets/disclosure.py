"""A button that opens and closes something below it."""

import param

from ..browser.bundle import Scripted


class Disclosure(Scripted):
    """`line` with a triangle; whoever shows what it opens watches `open`; see disclosure.js."""

    line = param.String()
    open = param.Boolean()
