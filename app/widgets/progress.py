"""The progress of tasks, with a button that cancels; hidden while idle."""

from typing import Any

import param

from ..background.jobs import Task
from ..browser.bundle import Scripted
from ..browser.messages import Message

FOLLOWED = ("running", "fraction", "keeps")


class Progress(Scripted):
    """Bar, stage, time left and Cancel of a jobs.Task: the first running one of several.

    If the partial result is a valid result, the buttons are Stop and keep, and Discard.

    Not Panel's LinearProgress, text and button, which block the page's thread for 40 ms; here 4 ms.
    """

    running = param.Boolean()
    fraction = param.Number(default=None, allow_None=True)
    words = param.String()
    keeps = param.Boolean()

    def __init__(self, *tasks: Task, **params: Any) -> None:
        super().__init__(**{"sizing_mode": "stretch_width", "margin": 0} | params)
        self._tasks = tasks
        self._follow()
        for task in tasks:
            task.param.watch(self._follow, [*FOLLOWED, "stage", "seconds_left"])

    @property
    def _shown(self) -> Task:
        """The task to show."""
        return next((task for task in self._tasks if task.running), self._tasks[0])

    def _heard(self, message: Message) -> None:
        if "cancel" in message:
            self._shown.dismiss()
        if "stop" in message:
            self._shown.stop()

    def _follow(self, *events: Any) -> None:
        task = self._shown
        left = task.seconds_left
        words = task.stage + ("" if left is None else f" — about {_duration(left)} more")
        followed = {name: getattr(task, name) for name in FOLLOWED}
        self.param.update(words=words, **followed)


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
