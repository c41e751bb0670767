"""A small scene and the whole of its S: drawn, cut and pulled in the browser; see small.js."""

import base64
from collections.abc import Callable
from typing import Any

import param

from granforce.packing import scenes as made
from granforce.records import InputError, NotJammedError, UndecidedError

from .. import scenes
from ..jobs import Task
from .messages import Message
from .scripts import Scripted

# Title, text, and what the scene shows, of the steps of the tour before those of large packings.
FIRST_STEPS = (
    (
        "One disk, two walls",
        "A disk of weight 1 lies in a groove. Each wall presses on it and rubs: four forces. But "
        "there are only three equations: no net force sideways, none up or down, no turning. One "
        "number stays free: how hard the walls squeeze the disk. Squeezed hard, it would pop up if "
        "friction did not hold it down.",
        {"scene": "groove", "mu": 0.5},
    ),
    (
        "Every way to hold it, at once",
        "The line is S: each of its points is one set of forces that holds the disk. Drag the "
        "point, or an arrow: the forces change and stay in balance. S ends where a force meets the "
        "edge of its wedge, the friction cone: there the disk is about to slide.",
        {"scene": "groove", "mu": 0.5},
    ),
    (
        "What friction does",
        "Drag the friction μ. At μ = 0 the wedges are closed, and S is one point. More friction "
        "opens the wedges, and S grows. At μ = 1, as steep as the walls, it has no end any more: "
        "the disk has jammed itself.",
        {"scene": "groove", "mu": 0.8, "see": "strip"},
    ),
    (
        "More disks, more free numbers",
        "Thirteen disks pressed together from all sides leave eight numbers free: S has eight "
        "dimensions, of which only a shadow can be drawn, on two of the forces. Drag the point, or "
        "an arrow: all forces follow. Next: 400 disks, with hundreds of free numbers.",
        {"scene": "thirteen"},
    ),
)


class Small(Scripted):
    """The page of a small scene."""

    scene = param.Dict(default={}, doc="see scenes.drawn")
    titles = param.List(doc="[name, title] of every scene")
    steps = param.List(doc="title, text and what is shown, of each step of the tour")
    all = param.Integer(doc="steps of the whole tour")
    step = param.Integer(doc="of the tour, to begin with; 0 for none")
    note = param.String(doc="what was wrong with the link")
    first = param.Boolean(doc="whether the page was opened without a view to show")
    dark = param.Boolean()

    def __init__(self, asked: scenes.Asked, task: Task, all_steps: int, **params: Any) -> None:
        """asked: scenes.Asked. task: a jobs.Task of the page, for scenes that take a while."""
        super().__init__(
            titles=scenes.titles(),
            steps=[list(step) for step in FIRST_STEPS],
            all=all_steps,
            **params,
        )
        self._task = task
        task.param.watch(self._failed, "message")
        self._show(asked.scene, asked.mu, asked.built)

    def _show(self, name: str, mu: float | None = None, built: str = "") -> None:
        if name == scenes.MANY:  # has a page of its own
            return
        if name in made.SCENES and made.SCENES[name].packed:
            self._task.start(lambda job: scenes.drawn(name, mu), self._put)
            return
        try:
            self._put(scenes.drawn(name, mu, built))
        except (InputError, NotJammedError) as error:
            if self.scene:
                self.tell({"error": str(error)})
            else:  # a link that cannot be: its page begins anew, and says why
                self.note = str(error)
                self._show(name)

    def _put(self, scene: dict[str, Any]) -> None:
        self.scene = scene

    def _failed(self, event: Any) -> None:
        if event.new:
            self.tell({"error": event.new})

    def _heard(self, message: Message) -> None:
        """Another scene, another μ, or the question how it falls."""
        try:
            match message:
                case {"scene": name} if name in (*made.SCENES, scenes.OWN):
                    self._show(name, message.get("mu"))
                case {"query": query}:
                    asked = scenes.asked(query)
                    self._show(asked.scene, asked.mu, asked.built)
                case {"built": built, "mu": mu}:
                    self._show(scenes.OWN, mu, built[: scenes.LONGEST])
                case {"save": of}:
                    self._answer(scenes.file_of, _as_text, **of)
                case {"fall": of}:
                    self._answer(scenes.falling, lambda motion: {"fall": motion.tolist()}, **of)
                case {"measure": of}:
                    asked = {"mu": of["mu"], "plane": of["plane"]}
                    self._answer(scenes.measured, lambda found: {"measured": found} | asked, **of)
        except (InputError, NotJammedError, UndecidedError) as error:
            self.tell({"error": str(error)})

    def _answer(
        self, find: Callable[..., Any], told: Callable[[Any], Message], mu: float, **options: Any
    ) -> None:
        """Tell what is found of the scene at this μ, under the loads among the options."""
        name, built = self.scene["name"], self.scene["built"]
        self._task.start(
            lambda job: find(scenes.packing_of(name, mu, built), **options),
            lambda found: self.tell(told(found)),
        )


def _as_text(file: bytes) -> Message:
    return {"file": base64.b64encode(file).decode()}
