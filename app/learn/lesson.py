"""The eight chapters of Learn: predict, do, see; drawn and played in the browser by lesson.js."""

from collections.abc import Callable
from functools import partial
from typing import Any

import param

from granforce.packing.scenes import EVERY

from ..background.jobs import Task, Visitor, computing, reading
from ..browser.bundle import Scripted
from ..browser.messages import from_browser
from ..widgets.plot_style import palettes
from .model import lesson_data
from .model.lesson_data import Packings

# The networks from which a contact is pushed, by name.
STARTS = {str(start): start for start in range(lesson_data.STARTS)}


class Lesson(Scripted):
    """The lesson; the data of a chapter are sent when the chapter requests them."""

    to_browser = (
        {"what": str, "name": str, "given": dict},  # the requested data
        {"what": str, "name": str, "error": str},
    )

    dark = param.Boolean()
    alone = param.Boolean(doc="whether one chapter is shown in a frame of another page")
    palettes = param.Dict(doc="colours of packings, see plot_style.palettes")

    def __init__(
        self,
        packings: Packings,
        wake: Callable[[Callable[[], object]], object] | None = None,
        visitor: Visitor | None = None,
        **params: Any,
    ) -> None:
        """wake: as for Task."""
        super().__init__(**params)
        self._packings = packings
        self._task = partial(Task, wake=wake, visitor=visitor)
        self._tasks: dict[str, Task] = {}
        self.palettes = palettes(self.dark)
        self.param.watch(self._dress, "dark")

    def close(self) -> None:
        """End all computations."""
        for task in self._tasks.values():
            task.close()

    def _dress(self, event: Any) -> None:
        self.palettes = palettes(event.new)

    @from_browser(want=str, name=str)
    @from_browser(want=str, name=str, network=[float, ...])
    def _provide(self, want: str, name: str, network: list[float] | None = None) -> None:
        """Send the data of a chapter, or of a contact in a network."""
        packings = self._packings
        by_friction = {f"{mu:g}": mu for mu in packings.frictions}
        match want:
            case "scene" if name in lesson_data.SCENES:
                pool = computing if EVERY[name].packed else reading
                self._send("scene", name, lambda: lesson_data.scene(name), pool)
            case "packing":
                mu = by_friction.get(name, float("nan"))
                self._send("packing", name, lambda: packings.packing(mu))
            case "shadow":
                self._send("shadow", "", packings.shadow, computing)
            case "rail" if network is not None:
                self._send("rail", name, lambda: packings.rail_from(name, network), computing)
            case "rail" if name in lesson_data.MARKED:
                self._send("rail", name, lambda: packings.rail(name), computing)
            case "push" if name in STARTS:
                self._send("push", name, lambda: packings.push(STARTS[name]), computing)
            case "curve":
                self._send("curve", "", packings.curve)

    def _send(self, what: str, name: str, compute: Callable[[], Any], pool: Any = reading) -> None:
        """Compute the data off the event loop and send them, or the reason for a failure."""
        task = self._tasks.get(what + name)
        if task is None:
            task = self._tasks[what + name] = self._task(pool)
            task.param.watch(partial(self._failed, what, name), "message")
        if not task.running:
            task.start(lambda job: compute(), lambda answer: self._tell(what, name, given=answer))

    def _tell(self, what: str, name: str, **answer: Any) -> None:
        self._tasks.pop(what + name, None)
        self.tell({"what": what, "name": name, **answer})

    def _failed(self, what: str, name: str, event: Any) -> None:
        if event.new:
            self._tell(what, name, error=event.new)
