"""How far a task is, with a button that cancels it; nothing is seen while it rests."""

import panel as pn
import panel_material_ui as pmui


class Progress:
    """Bar, stage, time left and Cancel of one jobs.Task."""

    def __init__(self, task):
        self.task = task
        self.bar = pmui.LinearProgress(sizing_mode="stretch_width")
        self.stage = pmui.Typography("", variant="caption", sizing_mode="stretch_width")
        self.cancel = pmui.Button(
            label="Cancel", variant="outlined", size="small", on_click=lambda event: task.cancel()
        )
        self.column = pn.Column(
            self.bar, self.stage, self.cancel, sizing_mode="stretch_width", visible=task.running
        )
        task.param.watch(self._follow, ["running", "stage", "fraction", "seconds_left"])

    def panel(self):
        """The three, or nothing."""
        return self.column

    def _follow(self, *events):
        task = self.task
        self.column.visible = task.running
        if not task.running:
            return
        known = task.fraction is not None
        self.bar.param.update(
            variant="determinate" if known else "indeterminate",
            value=round(100 * task.fraction) if known else -1,
        )
        left = task.seconds_left
        self.stage.object = task.stage + (f" — about {left:.0f} s more" if left is not None else "")
