"""A button that copies a text, or the address of the page."""

import param

from ..browser.bundle import Scripted


class CopyButton(Scripted):
    """Copies `text`, or the page's address where it is empty, and says so for a moment.

    Not Panel's Button with js_on_click: one keeps the page's thread for 13 ms, this for 5 ms.
    """

    label = param.String()
    text = param.String()
