"""A small scene and the whole of its S: drawn, cut and pulled in the browser by workbench.js."""

import base64
from typing import Any

import param

from granforce.packing import scenes as made
from granforce.records import InputError, NotJammedError, UndecidedError

from ...background.jobs import Job, Task
from ...browser.bundle import Scripted
from ...browser.messages import Message
from ...state import scene_links
from ..model import small_scenes


class Workbench(Scripted):
    """A small scene with all its tools."""

    scene = param.Dict(default={}, doc="see small_scenes.drawn")
    titles = param.List(doc="[name, title, page] of every scene")
    large = param.List(default=[*scene_links.LARGE], doc="names of those that Explore shows")
    note = param.String(doc="error in the link")
    dark = param.Boolean()

    def __init__(
        self,
        request: scene_links.Request,
        task: Task,
        saving: Task,
        pushing: Task,
        **params: Any,
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
        for task in (
            self._task,
            self._saving,
            self._pushing,
        ):  # drop pending results for the previous scene
            task.cancel()
        self._ready = True
        self.scene = scene

    def _failed(self, event: Any) -> None:
        if event.new:
            self._ready = True
            self.tell({"error": event.new})

    def _heard(self, message: Message) -> None:
        """Handle a request for another scene, another μ, or results on the present one."""
        try:
            match message:
                case {
                    "find": what,
                    "S": number,
                    "scene": scene,
                    "built": built,
                    "mu": mu,
                    "load": load,
                    "plane": plane,
                }:
                    self._find(what, number, scene, built, mu, load, plane)
                case {"scene": name} if name in (*scene_links.SMALL, scene_links.OWN):
                    self._show(name, message.get("mu"))
                case {"query": query}:
                    request = scene_links.request_of(query)
                    self._show(request.scene, request.mu, request.built)
                case {"built": built, "mu": mu}:
                    self._show(scene_links.OWN, mu, built[: scene_links.LONGEST])
        except (InputError, NotJammedError, UndecidedError) as error:
            self.tell({"error": str(error)})

    def _find(
        self,
        what: str,
        number: int,
        scene: str,
        built: str,
        mu: float,
        load: list[float],
        plane: list[int],
    ) -> None:
        """Send results for a scene at this μ, under these loads; number: by which the page knows S.

        Nothing for a scene that was replaced, or is about to be: the answer would stop the
        computation of the next one.
        """
        if not self._ready or (scene, built) != (self.scene["name"], self.scene["built"]):
            return

        def compute(job: Job) -> Message:
            packing = small_scenes.packing_of(scene, mu, built)
            match what:
                case "file":
                    file = base64.b64encode(small_scenes.file_of(packing, load))
                    return {"file": file.decode()}
                case "limit":
                    return {"limit": small_scenes.limit(packing, load), "S": number}
                case "fall":
                    return {"fall": small_scenes.falling(packing, load).tolist(), "S": number}
                case _:
                    found = small_scenes.measured(packing, load, plane)
                    return {"measured": found, "plane": plane, "S": number}

        tasks = {"file": self._saving, "limit": self._pushing}
        tasks.get(what, self._task).start(compute, self.tell)
