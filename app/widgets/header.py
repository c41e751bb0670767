"""The thin header of every page: entry pages, a copy of the link, help, and the theme."""

from typing import Any

import param

from ..browser.bundle import Scripted


class Header(Scripted):
    """granforce, Explore and Learn, Copy link, ? and the theme; see header.js.

    On a narrow page `middle` is placed below the links, so that nothing is covered.
    """

    door: Any = param.Selector(default="explore", objects=["explore", "learn"])
    dark = param.Boolean(doc="theme; changed by the page")
    keys = param.List(doc="[keys, what they do], listed by ?")
    help = param.String(doc="HTML above the keys")
