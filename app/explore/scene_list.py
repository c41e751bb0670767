"""The list of scenes, the first of the controls."""

from collections.abc import Callable
from typing import Any

import param

from granforce.packing.scenes import EVERY
from granforce.study.keys import Parameters

from ..browser.bundle import Scripted
from ..browser.messages import from_browser
from ..state import scene_links


class SceneList(Scripted):
    """Names of all scenes; choosing one opens it; see scene_list.js."""

    titles = param.List(doc="[name, title, page] of every scene")
    shown = param.String(default=scene_links.MANY)
    usual = param.Number(doc="μ of the scene on screen, which is not taken along")

    def __init__(self, opens: Callable[[str], object], **params: Any) -> None:
        """opens(query): shows the large packing of a link."""
        super().__init__(titles=scene_links.titles(), **params)
        self._opens = opens
        self.follow({})

    @from_browser(query=str)
    def _open(self, query: str) -> None:
        self._opens(scene_links.request_of(query).query)

    def follow(self, packing: Parameters) -> None:
        """Show the scene of a packing with these parameters."""
        if scene_links.IMPORTED in packing:
            self.param.update(shown=scene_links.IMPORTED, usual=packing["mu"])
            return
        shown = packing.get("scene", scene_links.MANY)
        self.param.update(shown=shown, usual=EVERY[shown].mu)
