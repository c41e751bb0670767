"""The controls: the scene, its friction, and the options of the packing and its states."""

from typing import Any

import panel as pn
import panel_material_ui as pmui

from granforce.records import InputError, friction

from ..background.jobs import reading
from ..background.limits import LIMITS, MOST_SEED
from ..background.notifications import observe
from ..results import study_data
from ..results.selection import SOLVERS, Selection, differing, select, typed, unusual
from ..state.app_state import AppState
from ..widgets.copy_button import CopyButton
from ..widgets.disclosure import Disclosure
from ..widgets.number import NumberField
from ..widgets.parts import PLAIN, by_words
from ..widgets.select import Select
from .friction_slider import FrictionSlider
from .scene_list import SceneList

FIELD = {"width": 150, "margin": (4, 12, 4, 0)}
LIST = FIELD | {"width": 250}
MADE = "How it is made"
SAME = "the same μ"  # for a packing made with the friction of the ensemble


def offered(state: AppState) -> dict[str, Any]:
    """Options and value of the list of precomputed results: each series and the μ of its states."""
    # The series on screen is included even before the catalogue is read again.
    on_screen = [] if state.cell is None else [state.cell]
    series: dict[str, set[float]] = {}
    for cell in [*state.catalogue, *on_screen]:
        series.setdefault(cell.series, set()).add(cell.mu)
    options = {
        f"{name} — {_frictions(sorted(frictions))}": name for name, frictions in series.items()
    }
    if state.missing:  # no such states: those on screen are of another packing
        return {"options": {f"none with {differs(state)}": "", **options}, "value": ""}
    return {"options": options, "value": state.cell.series if state.cell else ""}


def _frictions(frictions: list[float]) -> str:
    if len(frictions) > 2:
        return f"{len(frictions)} μ from {frictions[0]:g} to {frictions[-1]:g}"
    return "μ = " + ", ".join(f"{mu:g}" for mu in frictions)


def differs(state: AppState) -> str:
    """The requested selection that is not on screen, in words."""
    return differing(state.selection, state.cell and state.cell.selection)


def _opener(state: AppState) -> str:
    """The line that opens the options, with the number of disks requested."""
    n = None if state.selection is None else state.selection.packing.get("n")
    return MADE if n is None else f"{n} disks\n{MADE}"


class Controls:
    """Widgets for the state's selection: the `line`, and `options`, which it opens."""

    def __init__(self, state: AppState) -> None:
        self.state, self.work = state, state.work
        self._following = False
        self.scene, self.mu = SceneList(state.open, margin=0), FrictionSlider(self._typed, margin=0)
        draw = self.mu.param.update
        self.work.task(reading).start(
            lambda job: study_data.against_friction("eta2"), lambda hill: draw(hill=hill)
        )
        self.n = self._number("Disks N", 3, LIMITS.n, 100)
        self.seed = self._number("Seed", 0, MOST_SEED)
        self.packed = pmui.TextInput(
            label="Friction during packing", value=SAME, size="small", **FIELD | {"width": 180}
        )
        self.states = self._number("Networks", 1, LIMITS.states, 100)
        self.relax = Select(label="Relaxation", options=by_words(SOLVERS), **LIST)
        self.series = Select(
            label="Precomputed results", margin=FIELD["margin"], max_width=580,
            sizing_mode="stretch_width",
        )  # fmt: skip
        self.go = pmui.Button(label="Compute", color="primary", visible=False, margin=0, sx=PLAIN)
        self.command = CopyButton(label="Copy CLI command", **FIELD)
        self.opens = Disclosure(line=MADE, margin=0)
        self._connect()
        self._follow()
        self.line = pn.FlexBox(
            self.scene, self.mu, self.opens, self.go, gap="6px 28px", margin=0,
            align_items="center", css_classes=["controls-line"], sizing_mode="stretch_width",
        )  # fmt: skip
        self.options = pn.FlexBox(
            self.n, self.seed, self.packed, self.states, self.relax, self.series, self.command,
            align_items="center", margin=0, visible=False, css_classes=["made"],
            sizing_mode="stretch_width",
        )  # fmt: skip
        self.opens.link(self.options, open="visible")
        state.looks.sync_opened(self.opens, "made")

    def _number(self, label: str, start: int, end: float, step: int = 1) -> NumberField:
        return NumberField(self.work.say, label=label, start=start, end=end, step=step, **FIELD)

    def _connect(self) -> None:
        state = self.state
        self.mu.param.watch(lambda event: self._ask(), "mu")
        for widget in (self.n, self.seed, self.packed, self.states, self.relax):
            widget.param.watch(lambda event: self._ask(), "value")
        self.series.param.watch(self._choose, "value")
        self.go.on_click(lambda event: state.compute())
        observe(self._follow, state, "selection", "missing", "catalogue", "cell")
        observe(self._command, state, "selection", "missing", "replay", "knowledge.known")
        self._command()
        observe(self._refused, self.work, "message")
        observe(self._offer_computation, self.work, "computation.running")

    # From the widgets

    def _typed(self, text: str) -> None:
        try:
            self.mu.mu = friction(typed(text.replace(",", ".")))
        except InputError as error:
            self.work.message = str(error)

    def _ask(self) -> None:
        """Select the values of the widgets."""
        state = self.state
        if self._following or state.selection is None:
            return
        try:
            state.ask(state.given_held(self._selection()), at_once=True)
        except InputError as error:
            self.work.message = str(error)

    def _selection(self) -> Selection:
        now, packing = self.state.selection, self.state.selection.packing
        packing_mu = self.packed.value.strip()
        packed_mu = None if packing_mu in ("", SAME) else friction(typed(packing_mu))
        details = {
            "kind": now.kind, "relax": self.relax.value, "states": self.states.value,
            "seed": now.seed,
        }  # fmt: skip
        if now.imported:
            return now._replace(mu=friction(self.mu.mu), **details)
        selection = select(self.n.value, self.mu.mu, self.seed.value, packed_mu, **details)
        same = {name: value for name, value in unusual(packing).items() if name != "radii"}
        return selection._replace(packing=selection.packing | same)

    def _choose(self, event: Any) -> None:
        if not self._following and event.new:
            self.state.choose(series=event.new)

    def _refused(self, event: Any) -> None:
        """Remove a refused value from its field."""
        if event.new:
            self._follow()

    # From the state

    def _follow(self, *events: Any) -> None:
        """Update widgets from the state."""
        state = self.state
        if state.selection is None:
            return
        selection, packing = state.selection, state.selection.packing
        self._following = True
        self.scene.follow(packing)
        fixed, stored = selection.imported, [cell.mu for cell in state.cells()]
        self.mu.param.update(fixed=fixed, stored=stored, mu=selection.mu)
        if not selection.imported:
            self.n.value, self.seed.value = packing["n"], packing["seed"]
        known = state.cell is not None and state.cell.selection.packing == packing
        if selection.imported and known:
            self.n.value = state.replay.summary["n"]
        self.opens.line = _opener(state)
        self.n.param.update(disabled=selection.imported, visible=known or not selection.imported)
        self.seed.visible = self.packed.visible = not selection.imported
        self.packed.value = SAME if selection.same_mu else f"{packing['mu']:g}"
        self.states.value = selection.states
        self.relax.value = selection.relax
        self.relax.visible = selection.kind == "walk"
        self.series.param.update(**offered(state))
        self._following = False
        self._offer_computation()

    def _command(self, *events: Any) -> None:
        if self.state.selection is not None:
            self.command.text = self.state.command

    def _offer_computation(self, *events: Any) -> None:
        """Show the button if the selection is missing, and neither under way nor just failed."""
        state = self.state
        task = self.work.computation
        self.go.visible = state.missing and not task.running and not task.message
        if state.missing:
            self.go.label = f"Compute {differs(state)}"
