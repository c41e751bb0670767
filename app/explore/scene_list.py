"""The list of scenes, the first of the controls."""

from typing import Any

import param

from granforce.packing.scenes import SCENES

from ..browser.bundle import Scripted
from ..state import scene_links


class SceneList(Scripted):
    """Names of all scenes; choosing one opens it; see scene_list.js."""

    titles = param.List(doc="[name, title] of every scene")
    shown = param.String(default=scene_links.MANY)
    usual = param.Number(doc="μ of the page as it opens, which is not taken along")

    def __init__(self, **params: Any) -> None:
        super().__init__(titles=scene_links.titles(), usual=SCENES[scene_links.MANY].mu, **params)
