"""The sidebar: which states to see, how to see them, and how to take them along."""

import panel as pn
import panel_material_ui as pmui

from granforce.records import InputError, friction

from ..data import SOURCES
from ..limits import LIMITS
from ..selection import KINDS, SOLVERS, command, select
from ..state import COLOURS, WIDTHS
from .copying import CopyButton
from .friction import FrictionSlider
from .progress import Progress

WIDE = {"sizing_mode": "stretch_width"}
SMALL = {"sizing_mode": "stretch_width", "size": "small", "margin": (5, 10)}
HEADING = {"variant": "overline", "margin": (6, 10, -4, 10)}
HELP = "Computed in the background and kept in your cache."
SAME = "as S"  # a packing made with the friction of the ensemble


def _swap(labels):
    return {label: name for name, label in labels.items()}


class Controls:
    """Widgets for the state's selection and view; they follow what is on screen."""

    def __init__(self, state):
        self.state = state
        self._following = False
        self.mu = FrictionSlider(self._typed, **WIDE)
        self.n = pmui.IntInput(label="Disks N", start=3, end=LIMITS.n, step=100, **SMALL)
        self.seed = pmui.IntInput(label="Seed", start=0, **SMALL)
        self.packed = pmui.TextInput(label="Packed at μ", placeholder=SAME, **SMALL)
        self.states = pmui.IntInput(label="States", start=1, end=LIMITS.states, step=100, **SMALL)
        kinds = {name: label for name, label in KINDS.items() if name in SOURCES}
        self.kind = pmui.Select(label="States from", options=_swap(kinds), **SMALL)
        self.relax = pmui.Select(label="Relaxation", options=_swap(SOLVERS), **SMALL)
        self.series = pmui.Select(label="In the store", options=[], **SMALL)
        self.go = pmui.Button(label="Compute", color="primary", visible=False, **WIDE)
        self.colour = pmui.Select(label="Colour", options=_swap(COLOURS), **SMALL)
        self.thickness = pmui.Select(label="Width", options=_swap(WIDTHS), **SMALL)
        self.overlay = pmui.Switch(
            label="Strong and undetermined contacts", value=state.overlay, margin=(2, 10)
        )
        self.error = pmui.Alert(severity="error", visible=False, **WIDE)
        self.link = CopyButton(label="Copy link", margin=(4, 10), **WIDE)
        self.command = CopyButton(label="Copy CLI command", margin=(4, 10), **WIDE)
        self.progress = Progress(state.computation)
        self._connect()
        self._follow()
        self._look()

    def panel(self):
        """The widgets in order."""
        return [
            self.mu,
            pn.Row(self.n, self.seed, **WIDE),
            pn.Row(self.states, self.packed, **WIDE),
            self.kind,
            self.relax,
            self.go,
            self.progress,
            self.error,
            self.series,
            pmui.Typography("Force chains", **HEADING),
            self.colour,
            self.thickness,
            self.overlay,
            pmui.Typography("Take along", **HEADING),
            pn.Row(self.link, self.command, **WIDE),
        ]

    def _connect(self):
        state = self.state
        self.mu.param.watch(lambda event: self._ask(), "mu")
        for widget in (self.n, self.seed, self.packed, self.states, self.kind, self.relax):
            widget.param.watch(lambda event: self._ask(), "value")
        self.series.param.watch(self._choose, "value")
        self.go.on_click(lambda event: state.compute())
        for name in ("colour", "thickness", "overlay"):
            widget = getattr(self, name)
            widget.param.watch(
                lambda event, name=name: state.param.update({name: event.new}), "value"
            )
        state.param.watch(self._follow, ["selection", "missing", "catalogue", "cell"])
        state.param.watch(self._look, ["colour", "thickness", "overlay"])
        state.param.watch(self._tell, "message")
        state.computation.param.watch(self._rest, "running")
        self._tell()

    # From the widgets

    def _set(self, name, event):
        setattr(self.state, name, event.new)

    def _typed(self, text):
        try:
            self.mu.mu = friction(text)
        except InputError as error:
            self.state.message = str(error)

    def _ask(self):
        """Select what the widgets say."""
        state = self.state
        if self._following or state.selection is None:
            return
        try:
            state.ask(self._selection())
        except InputError as error:
            state.message = str(error)

    def _selection(self):
        now, packing = self.state.selection, self.state.selection.packing
        if None in (self.n.value, self.seed.value, self.states.value):
            raise InputError("fill in every field")
        own = self.packed.value.strip()
        packed_mu = friction(own) if own else None
        details = {
            "kind": self.kind.value,
            "relax": self.relax.value,
            "states": self.states.value,
            "seed": now.seed,
        }
        if now.imported:
            return now._replace(mu=friction(self.mu.mu), **details)
        made = select(self.n.value, self.mu.mu, self.seed.value, packed_mu, **details)
        same = {name: packing[name] for name in packing if name not in ("n", "mu", "seed", "radii")}
        return made._replace(packing=made.packing | same)

    def _choose(self, event):
        if not self._following:
            self.state.choose(series=event.new)

    # From the state

    def _follow(self, *events):
        """Widgets as the state has them."""
        state = self.state
        if state.selection is None:
            return
        asked, packing = state.selection, state.selection.packing
        self._following = True
        self.mu.param.update(stored=[cell.mu for cell in state.cells()], mu=asked.mu)
        if not asked.imported:
            self.n.value, self.seed.value = packing["n"], packing["seed"]
        for widget in (self.n, self.seed, self.packed):
            widget.disabled = asked.imported
        self.packed.value = "" if asked.same_mu else f"{packing['mu']:g}"
        self.states.value = asked.states
        self.kind.value, self.relax.value = asked.kind, asked.relax
        self.relax.visible = asked.kind == "walk"
        offered = list(dict.fromkeys(cell.series for cell in state.catalogue))
        self.series.param.update(options=offered, value=state.cell.series if state.cell else None)
        self.command.text = command(asked)
        self._following = False
        self._rest()

    def _rest(self, *events):
        state = self.state
        self.go.visible = state.missing and not state.computation.running
        if state.missing:
            self.go.label = f"Compute μ = {state.selection.mu:g}"

    def _look(self, *events):
        for name in ("colour", "thickness", "overlay"):
            getattr(self, name).value = getattr(self.state, name)

    def _tell(self, *events):
        self.error.param.update(title=self.state.message, visible=bool(self.state.message))
