"""A button that opens and closes the content below it."""

import param

from ..browser.bundle import Scripted


class Disclosure(Scripted):
    """`line` with a triangle; the owner of the content watches `open`; see disclosure.js."""

    line = param.String()
    open = param.Boolean()
