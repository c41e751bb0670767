"""A small scene and the whole of its S: drawn, cut and pulled in the browser by workbench.js."""

import base64
from typing import Any

import param

from granforce.packing import scenes as made
from granforce.records import InputError, NotJammedError, UndecidedError

from ...background.jobs import Job, Task
from ...browser.bundle import Scripted
from ...browser.messages import Message, from_browser
from ...state import scene_links
from ..model import small_scenes

MEASURED = {"plane": [int, int], "S": int}  # S: the number in the request


class Workbench(Scripted):
    """A small scene with all its tools."""

    to_browser = (
        {"error": str},
        {"fall": [float, ...], "S": int},  # motion (3 N) of the disks; empty if nothing falls
        {"file": str},  # base64
        {"limit": float, "S": int},  # times the push that the disks can bear
        {"limit": None, "S": int},  # however hard it is
        {"measured": {"most": float, "outline": list}, **MEASURED},
        {"measured": {"bounds": list, "outline": list}, **MEASURED},
    )

    scene = param.Dict(default={}, doc="see small_scenes.drawn")
    titles = param.List(doc="[name, title, page] of every scene")
    large = param.List(default=[*scene_links.LARGE], doc="names of those that Explore shows")
    note = param.String(doc="error in the link")
    dark = param.Boolean()

    def __init__(
        self, request: scene_links.Request, task: Task, saving: Task, pushing: Task, **params: Any
    ) -> None:
        """request: the request in the link. task, saving, pushing: for longer work, files, limits.

        A file is delivered even if other results are requested meanwhile.
        """
        super().__init__(titles=scene_links.titles(), **params)
        self._task, self._saving, self._pushing = task, saving, pushing
        self._ready = True  # the scene requested last
        for one in (task, saving, pushing):
            one.param.watch(self._failed, "message")
        self._show(request.scene, request.mu, request.built)

    def _show(self, name: str, mu: float | None = None, built: str = "") -> None:
        if name in scene_links.LARGE:  # has its own page
            return
        self._ready = name not in made.EVERY or not made.EVERY[name].packed
        if not self._ready:
            self._task.start(lambda job: small_scenes.drawn(name, mu), self._replace)
            return
        try:
            self._replace(small_scenes.drawn(name, mu, built))
        except (InputError, NotJammedError) as error:
            if self.scene:
                self.tell({"error": str(error)})
            else:  # an invalid link: its page starts with the initial scene, and says why
                self.note = str(error)
                self._show(name)

    def _replace(self, scene: dict[str, Any]) -> None:
        for task in (self._task, self._saving, self._pushing):  # results for the previous scene
            task.cancel()
        self._ready = True
        self.scene = scene

    def _failed(self, event: Any) -> None:
        if event.new:
            self._ready = True
            self.tell({"error": event.new})

    def hear(self, message: Any) -> None:
        """Handle a message, and send what was wrong with it."""
        try:
            super().hear(message)
        except (InputError, NotJammedError, UndecidedError) as error:
            self.tell({"error": str(error)})

    @from_browser(scene=str)
    @from_browser(scene=str, mu=float)
    def _choose(self, scene: str, mu: float | None = None) -> None:
        if scene in (*scene_links.SMALL, scene_links.OWN):
            self._show(scene, mu)

    @from_browser(query=str)
    def _return(self, query: str) -> None:
        """Show the scene to which the visitor went back or forward."""
        request = scene_links.request_of(query)
        self._show(request.scene, request.mu, request.built)

    @from_browser(built=str, mu=float)
    def _build(self, built: str, mu: float) -> None:
        self._show(scene_links.OWN, mu, built[: scene_links.LONGEST])

    @from_browser(
        find=str, S=int, scene=str, built=str, mu=float, load=[float, ...], plane=[int, int]
    )
    def _find(self, find: str, S: int, scene: str, built: str, mu: float, **given: Any) -> None:
        """Send "file", "fall", "limit" or "measured" for a scene with a load (3 N) on its disks.

        S: by which the page knows it. Nothing for a scene that was replaced, or is about to be: the
        answer would stop the computation of the next one.
        """
        load, plane = given["load"], given["plane"]
        if not self._ready or (scene, built) != (self.scene["name"], self.scene["built"]):
            return

        def compute(job: Job) -> Message:
            packing = small_scenes.packing_of(scene, mu, built)
            match find:
                case "file":
                    file = base64.b64encode(small_scenes.file_of(packing, load))
                    return {"file": file.decode()}
                case "limit":
                    return {"limit": small_scenes.limit(packing, load), "S": S}
                case "fall":
                    return {"fall": small_scenes.falling(packing, load).tolist(), "S": S}
                case _:
                    found = small_scenes.measured(packing, load, plane)
                    return {"measured": found, "plane": plane, "S": S}

        tasks = {"file": self._saving, "limit": self._pushing}
        tasks.get(find, self._task).start(compute, self.tell)
