"""How far tasks are, with a button that cancels; nothing is seen while they rest."""

from typing import Any

import param

from ..background.jobs import Task
from ..browser.bundle import Scripted
from ..browser.messages import Message

FOLLOWED = ("running", "fraction", "keeps")


class Progress(Scripted):
    """Bar, stage, time left and Cancel of a jobs.Task: of several, the first that is running.

    Where what is there so far would be a result, Stop and keep, and Discard in place of Cancel.

    Not Panel's LinearProgress, text and button: they keep the page's thread for 40 ms, this 4 ms.
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
    def _told(self) -> Task:
        """The task that is told of."""
        return next((task for task in self._tasks if task.running), self._tasks[0])

    def _heard(self, message: Message) -> None:
        if "cancel" in message:
            self._told.dismiss()
        if "stop" in message:
            self._told.stop()

    def _follow(self, *events: Any) -> None:
        task = self._told
        left = task.seconds_left
        words = task.stage + ("" if left is None else f" — about {_duration(left)} more")
        followed = {name: getattr(task, name) for name in FOLLOWED}
        self.param.update(words=words, **followed)


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
