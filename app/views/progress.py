"""How far tasks are, with a button that cancels; nothing is seen while they rest."""

from typing import Any, ClassVar

import param

from ..jobs import Task
from .messages import Message
from .scripts import Scripted, module

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

    _esm = module("progress")
    _stylesheets: ClassVar = [
        """
        :host { display: block; width: 100%; }
        :host(.titled) { flex: 1 1 0; min-width: 0; }
        :host(.titled) .task {
          max-width: 560px; margin: 0 auto; padding: 6px 12px; border-radius: 8px;
          background: #10233d; color: #ffffff;
        }
        :host(.titled) .bar { background: rgba(255, 255, 255, 0.25); }
        :host(.titled) .bar div { background: #7db7ff; }
        :host(.titled) span { overflow: hidden; text-overflow: ellipsis; white-space: nowrap; }
        /* No room in the title: at the lower edge, where the page leaves it free, see page.py. */
        @media (max-width: 899.95px) {
          :host(.titled) { position: fixed; inset: auto 0 0; z-index: 1500; }
          :host(.titled) .task { max-width: none; border-radius: 0; }
        }
        .task { display: flex; flex-wrap: wrap; align-items: center; gap: 4px 10px;
          padding: 4px 10px; font-size: 12.5px; width: 100%; box-sizing: border-box; }
        .task[hidden] { display: none; }
        .bar { flex: 1 0 100%; height: 4px; border-radius: 2px; overflow: hidden;
          background: rgba(20, 100, 200, 0.2); }
        .bar div { height: 100%; background: #1464c8; transition: width 0.2s; }
        .bar.unknown div { animation: pass 1.4s linear infinite; }
        @keyframes pass { from { margin-left: -40%; } to { margin-left: 100%; } }
        span { flex: 1; font-variant-numeric: tabular-nums; }
        button {
          padding: 4px 10px; border-radius: 5px; background: transparent; font: inherit;
          color: inherit; border: 1px solid rgba(128, 128, 128, 0.5); cursor: pointer;
        }
        button:hover { background: rgba(128, 128, 128, 0.15); }
        button:focus-visible { outline: 2px solid #e8710a; }
        """
    ]

    def __init__(self, *tasks: Task, titled: bool = False) -> None:
        """titled: in the page's title bar, where it moves and covers nothing."""
        classes = ["titled"] if titled else []
        super().__init__(sizing_mode="stretch_width", margin=0, css_classes=classes)
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
