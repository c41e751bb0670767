"""The sidebar: what to see, and what to compute."""

import panel as pn
import panel_material_ui as pmui

from ..data import SOLVERS

HELP = (
    "Computed in the background and kept in your cache: a packing takes some 5–20 s at N = 400, "
    "200 states by the nearest admissible state a few seconds, by Gauss–Seidel a minute or more."
)


class Controls:
    """Widgets for the state's selection and for a walk that no store holds yet."""

    def __init__(self, state):
        self.state = state
        wide = {"sizing_mode": "stretch_width"}
        self.series = pmui.Select(name="Series", **wide)
        self.mu = pmui.Select(name="Friction coefficient μ", **wide)
        self.new_mu = pmui.TextInput(name="μ", value="0.3", **wide)
        self.n = pmui.IntInput(name="Disks N", value=400, start=3, end=4000, step=100, **wide)
        self.seed = pmui.IntInput(name="Seed", value=1, start=0, **wide)
        self.states = pmui.IntInput(name="States", value=200, start=1, end=5000, step=100, **wide)
        self.relax = pmui.Select(
            name="Relaxation", options={label: name for name, label in SOLVERS.items()}, **wide
        )
        self.go = pmui.Button(name="Show or compute", color="primary", **wide)
        self.cancel = pmui.Button(name="Cancel", variant="outlined", visible=False, **wide)
        self.bar = pmui.LinearProgress(visible=False, **wide)
        self.stage = pmui.Typography("", variant="caption", visible=False, **wide)
        self.error = pmui.Alert(severity="error", visible=False, **wide)
        self._offer()
        self.series.param.watch(lambda event: self._choose(series=event.new), "value")
        self.mu.param.watch(lambda event: self._choose(mu=event.new), "value")
        state.param.watch(self._offer, ["catalogue", "series", "mu"])
        self.go.on_click(self._compute)
        self.new_mu.param.watch(self._compute, "enter_pressed")
        self.cancel.on_click(lambda event: state.cancel())
        state.param.watch(self._progress, ["running", "stage", "fraction", "seconds_left"])
        state.param.watch(self._tell, "message")

    def panel(self):
        """The widgets in order."""
        heading = {"variant": "subtitle1", "margin": (10, 10, 0, 10)}
        return [
            pmui.Typography("Show", **heading),
            self.series,
            self.mu,
            pmui.Typography("Another walk", **heading),
            pn.Row(self.new_mu, self.n, sizing_mode="stretch_width"),
            pn.Row(self.seed, self.states, sizing_mode="stretch_width"),
            self.relax,
            self.go,
            self.cancel,
            self.bar,
            self.stage,
            self.error,
            pmui.Typography(HELP, variant="caption"),
        ]

    def _offer(self, *events):
        """Options and selection as the state has them."""
        state = self.state
        values = {f"{cell.mu:g}": cell.mu for cell in state.cells()}
        self._following = True
        self.series.param.update(options=state.series_offered(), value=state.series)
        self.mu.param.update(options=values, value=state.mu)
        self._following = False

    def _choose(self, **wanted):
        if not self._following:
            self.state.choose(**wanted)

    def _compute(self, event):
        self.state.compute(
            n=self.n.value,
            mu=self.new_mu.value_input or self.new_mu.value,
            seed=self.seed.value,
            states=self.states.value,
            relax=self.relax.value,
        )

    def _progress(self, *events):
        state = self.state
        self.go.disabled = state.running
        for widget in (self.cancel, self.bar, self.stage):
            widget.visible = state.running
        known = state.fraction is not None
        self.bar.param.update(
            variant="determinate" if known else "indeterminate",
            value=round(100 * state.fraction) if known else -1,
        )
        left = state.seconds_left
        self.stage.object = state.stage + (
            f" — about {left:.0f} s more" if left is not None else ""
        )

    def _tell(self, *events):
        self.error.param.update(title=self.state.message, visible=bool(self.state.message))
