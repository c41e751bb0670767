"""The list of scenes, first of the controls of large packings."""

from typing import ClassVar

import param

from .. import scenes
from .scripts import FOLDER, Scripted, joined


class SceneList(Scripted):
    """Names of all scenes; choosing one opens it; see scenelist.js."""

    titles = param.List(doc="[name, title] of every scene")
    shown = param.String(default=scenes.MANY)

    _esm = joined("scenelist")
    _stylesheets: ClassVar = [FOLDER / "scenelist.css"]

    def __init__(self, **params):
        super().__init__(titles=scenes.titles(), **params)
