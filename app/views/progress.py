"""How far a task is, with a button that cancels it; nothing is seen while it rests."""

from typing import ClassVar

import param
from panel.custom import JSComponent

from .scripts import joined


class Progress(JSComponent):
    """Bar, stage, time left and Cancel of one jobs.Task."""

    running = param.Boolean()
    fraction = param.Number(default=None, allow_None=True)
    words = param.String()

    # One component of ours, not a column of three others: those take Panel five times as long.
    _esm = joined("ask", "progress")
    _stylesheets: ClassVar = [
        """
        :host { display: block; width: 100%; }
        .progress { display: flex; flex-wrap: wrap; align-items: center; gap: 4px 10px;
          padding: 4px 10px; font-size: 12.5px; width: 100%; box-sizing: border-box; }
        .progress[hidden] { display: none; }
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

    def __init__(self, task):
        super().__init__(sizing_mode="stretch_width", margin=0)
        self._task = task
        self._follow()
        task.param.watch(self._follow, ["running", "stage", "fraction", "seconds_left"])

    def _handle_msg(self, message):
        if message.get("cancel"):
            self._task.cancel()

    def _follow(self, *events):
        task, left = self._task, self._task.seconds_left
        words = task.stage + (f" — about {left:.0f} s more" if left is not None else "")
        self.param.update(running=task.running, fraction=task.fraction, words=words)
