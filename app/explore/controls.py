"""The sidebar: which states to see, how to see them, and how to share them."""

from typing import Any

import panel as pn
import panel_material_ui as pmui

from granforce.records import InputError, friction

from ..background.jobs import reading
from ..background.limits import LIMITS, MOST_SEED
from ..results import study_data
from ..results.library import SOURCES
from ..results.selection import KINDS, SOLVERS, Selection, differing, select, unusual
from ..state.app_state import AppState
from ..state.view_settings import COLOURS, WIDTHS
from ..widgets.copy_button import CopyButton
from ..widgets.number import NumberField
from ..widgets.parts import EXTRA, by_words, folded_away, linked, question
from ..widgets.select import Select
from .friction_slider import FrictionSlider
from .scene_list import SceneList

WIDE = {"sizing_mode": "stretch_width"}
SMALL = {"sizing_mode": "stretch_width", "size": "small", "margin": (5, 10)}
FIELD = {"sizing_mode": "stretch_width", "margin": (5, 10)}
LOOKS, MADE = "Colours and widths of lines", "How this packing is made"
# What went wrong is told at the page's lower edge, whether the sidebar is open or closed.
AT_EDGE = """
:host { position: fixed; inset: auto 0 calc(var(--task, 0px) + var(--card, 0px)); z-index: 1400; }
@media (min-width: 1200px) { :host { inset: auto 16px 16px auto; max-width: 620px; } }
"""
SAME = "the same μ"  # of a packing made with the friction of the ensemble


def offered(state: AppState) -> dict[str, Any]:
    """Options and value of the precomputed results: each series with where it has states."""
    # The series on screen is among them even before the catalogue is read anew.
    on_screen = [] if state.cell is None else [state.cell]
    series: dict[str, set[float]] = {}
    for cell in [*state.catalogue, *on_screen]:
        series.setdefault(cell.series, set()).add(cell.mu)
    options = {f"{name} — {_frictions(sorted(found))}": name for name, found in series.items()}
    if state.missing:  # what was asked for has no states: those on screen are of another packing
        return {"options": {f"none with {differs(state)}": "", **options}, "value": ""}
    return {"options": options, "value": state.cell.series if state.cell else ""}


def _frictions(found: list[float]) -> str:
    if len(found) > 2:
        return f"{len(found)} μ from {found[0]:g} to {found[-1]:g}"
    return "μ = " + ", ".join(f"{mu:g}" for mu in found)


def meaningful(state: AppState, labels: dict[str, str], name: str) -> dict[str, str]:
    """Of what colour or width can show, what there is: a pinned state, known forces, or chosen."""
    pinned = state.looks.reference
    there = {"sign": pinned, "difference": pinned, "known": state.knowledge.known}
    there |= dict.fromkeys(("deviation", "measured"), state.measured is not None)
    chosen = getattr(state.looks, name)
    return {key: words for key, words in labels.items() if there.get(key, True) or key == chosen}


def differs(state: AppState) -> str:
    """What was asked for and is not on screen, in words."""
    return differing(state.selection, state.cell and state.cell.selection)


class Controls:
    """Widgets for the state's selection and view; they follow what is on screen."""

    def __init__(self, state: AppState) -> None:
        self.state, self.looks, self.work = state, state.looks, state.work
        self._following = False
        self.mu = FrictionSlider(self._typed, **WIDE)
        # Where the sidebar lies over the page, the one control that all need stays on the page.
        self.beside = FrictionSlider(self._typed, on_narrow=True, **WIDE)
        self.beside.link(self.mu, mu="mu", bidirectional=True)
        self.mu.link(self.beside, stored="stored", hill="hill")
        draw = self.mu.param.update
        self.work.task(reading).start(lambda job: study_data.hill(), lambda hill: draw(hill=hill))
        self.n = self._number("Disks N", 3, LIMITS.n, 100)
        self.seed = self._number("Seed", 0, MOST_SEED)
        self.packed = pmui.TextInput(label="Friction during packing", value=SAME, **SMALL)
        self.states = self._number("States", 1, LIMITS.states, 100)
        kinds = {name: label for name, label in KINDS.items() if name in SOURCES}
        self.kind = Select(label="States from", options=by_words(kinds), **FIELD)
        self.relax = Select(label="Relaxation", options=by_words(SOLVERS), **FIELD)
        self.series = Select(label="Precomputed results", **FIELD)
        self.go = pmui.Button(label="Compute", color="primary", visible=False, **WIDE)
        self.colour = question("Colour", COLOURS, self.looks, "colour", **FIELD)
        self.thickness = question("Width", WIDTHS, self.looks, "thickness", **FIELD)
        self.full = pmui.TextInput(
            label="Full colour, in mean forces", placeholder="by itself", **SMALL
        )
        self.stretch = pmui.TextInput(label="Width, times", **SMALL)
        marks = pmui.Switch(
            label="Strong and undetermined contacts", value=self.looks.overlay, margin=(2, 10)
        )
        self.overlay = linked(marks, self.looks, "overlay")
        self.error = pmui.Alert(
            severity="error", variant="filled", visible=False, closeable=True, margin=0,
            stylesheets=[AT_EDGE],
        )  # fmt: skip
        self.link = CopyButton(label="Copy link", margin=(4, 10), **WIDE)
        self.command = CopyButton(label="Copy CLI command", margin=(4, 10), **WIDE)
        self._connect()
        self._follow()
        self._look()

    def _number(self, label: str, start: int, end: float, step: int = 1) -> NumberField:
        def refuse(line: str) -> None:
            self.work.message = line

        return NumberField(refuse, label=label, start=start, end=end, step=step, **FIELD)

    def panel(self) -> list[Any]:
        """The widgets in order."""
        return [
            SceneList(**WIDE),
            self.mu,
            self.go,
            pn.Column(
                self._folded(),
                self.link,
                styles=EXTRA,
                **WIDE,
            ),
        ]

    def _folded(self) -> Any:
        """What only those need who look for, or compute, something of their own."""
        look = pn.Column(
            self.colour,
            self.thickness,
            self.overlay,
            pn.Row(self.full, self.stretch, **WIDE),
            margin=(-10, -14),
            **WIDE,
        )
        made = pn.Column(
            self.series,
            pn.Row(self.n, self.seed, **WIDE),
            self.states,
            self.packed,  # in a row of its own: its label would be cut in half of one
            self.kind,
            self.relax,
            self.command,
            margin=(-10, -14),
            **WIDE,
        )
        return folded_away(LOOKS, look, MADE, made)

    def _connect(self) -> None:
        state, looks = self.state, self.looks
        self.mu.param.watch(lambda event: self._ask(), "mu")
        for widget in (self.n, self.seed, self.packed, self.states, self.kind, self.relax):
            widget.param.watch(lambda event: self._ask(), "value")
        self.series.param.watch(self._choose, "value")
        self.go.on_click(lambda event: state.compute())
        self.full.param.watch(self._scale, "value")
        self.stretch.param.watch(self._scale, "value")
        state.param.watch(self._follow, ["selection", "missing", "catalogue", "cell"])
        state.param.watch(self._look, "measured")
        state.knowledge.param.watch(self._look, "known")
        looks.param.watch(self._look, ["colour", "thickness", "full", "stretch", "reference"])
        state.param.watch(self._command, ["selection", "missing", "replay"])
        state.knowledge.param.watch(self._command, "known")
        self._command()
        self.work.param.watch(self._tell, "message")
        self.error.param.watch(self._read, "closed")
        self.work.computation.param.watch(self._rest, "running")
        self._tell()

    # From the widgets

    def _typed(self, text: str) -> None:
        try:
            self.mu.mu = friction(text.replace(",", "."))
        except InputError as error:
            self.work.message = str(error)

    def _ask(self) -> None:
        """Select what the widgets say."""
        state = self.state
        if self._following or state.selection is None:
            return
        try:
            state.ask(self._selection(), at_once=True)
        except InputError as error:
            self.work.message = str(error)
        if self.work.message:  # what was refused does not stay in its box
            self._follow()

    def _selection(self) -> Selection:
        now, packing = self.state.selection, self.state.selection.packing
        own = self.packed.value.strip()
        packed_mu = None if own in ("", SAME) else friction(own)
        details = {
            "kind": self.kind.value,
            "relax": self.relax.value,
            "states": self.states.value,
            "seed": now.seed,
        }
        if now.imported:
            return now._replace(mu=friction(self.mu.mu), **details)
        made = select(self.n.value, self.mu.mu, self.seed.value, packed_mu, **details)
        same = {name: value for name, value in unusual(packing).items() if name != "radii"}
        return made._replace(packing=made.packing | same)

    def _choose(self, event: Any) -> None:
        if not self._following and event.new:
            self.state.choose(series=event.new)

    # From the state

    def _follow(self, *events: Any) -> None:
        """Widgets as the state has them."""
        state = self.state
        if state.selection is None:
            return
        asked, packing = state.selection, state.selection.packing
        self._following = True
        self.mu.param.update(stored=[cell.mu for cell in state.cells()], mu=asked.mu)
        if not asked.imported:
            self.n.value, self.seed.value = packing["n"], packing["seed"]
        known = state.cell is not None and state.cell.selection.packing == packing
        if asked.imported and known:
            self.n.value = state.replay.summary["n"]
        self.n.param.update(disabled=asked.imported, visible=known or not asked.imported)
        self.seed.visible = self.packed.visible = not asked.imported
        self.packed.value = SAME if asked.same_mu else f"{packing['mu']:g}"
        self.states.value = asked.states
        self.kind.value, self.relax.value = asked.kind, asked.relax
        self.relax.visible = asked.kind == "walk"
        self.series.param.update(**offered(state))
        self._following = False
        self._rest()

    def _command(self, *events: Any) -> None:
        if self.state.selection is not None:
            self.command.text = self.state.command

    def _rest(self, *events: Any) -> None:
        state = self.state
        self.go.visible = state.missing and not self.work.computation.running
        if state.missing:
            self.go.label = f"Compute {differs(state)}"

    def _scale(self, event: Any) -> None:
        """Where colours are full and how wide chains are, as typed; empty: by itself."""
        name = "full" if event.obj is self.full else "stretch"
        text = event.new.strip().replace(",", ".")
        low, high = self.looks.param[name].bounds
        try:
            value = float(text) if text else self.looks.param[name].default
            if value is not None and not low <= value <= high:
                raise ValueError
        except ValueError:
            label = event.obj.label
            self.work.message = f"{label}: a number from {low:g} to {high:g}, got {text[:30]!r}"
            self._look()
            return
        self.looks.param.update({name: value})

    def _look(self, *events: Any) -> None:
        for name, labels in (("colour", COLOURS), ("thickness", WIDTHS)):
            getattr(self, name).options = by_words(meaningful(self.state, labels, name))
        full = self.looks.full
        self.full.value = "" if full is None else f"{full:g}"
        self.stretch.value = f"{self.looks.stretch:g}"

    def _read(self, event: Any) -> None:
        """What was read and closed may be told again."""
        if event.new:
            self.work.message = ""

    def _tell(self, *events: Any) -> None:
        message = self.work.message
        self.error.param.update(title=message, visible=bool(message), closed=False)
