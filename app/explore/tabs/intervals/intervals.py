"""Intervals of each contact's normal force (Fig. 3 of PRE 79, 052302); η1, η2, η3 as they grow."""

from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui

from ....background.notifications import observe
from ....packing.legend import Bounds, exact_intervals
from ....results.replays import Replay, worded
from ....state.app_state import AppState
from ....state.known import DETERMINED
from ....state.view_settings import DRAWN, SCALES, SORTS
from ....widgets.hints import term
from ....widgets.parts import (
    OUTLINED,
    TabView,
    by_words,
    folded_away,
    mark,
    note,
    plotted,
    question,
)
from ....widgets.plot_style import DARK, LOST, ORIGINAL, PALE, now
from .bars_figure import BarsFigure
from .contact_table import Contacts
from .growth_figure import GrowthFigure
from .known_forces import Known
from .order import MOST_BARS, SOME, ordered, picked

SMALL = {"width": 146, "margin": (4, 4, 2, 6)}
GROWS = "How many networks does it take?"
HEADING = "<b>How far can each force go while no disk moves?</b> "
FIXED = "Not at all: balance determines every force."


class View(TabView):
    """One bar per contact: pale for possible, dark for seen, a dot for the present force."""

    name = "intervals"

    def __init__(self, state: AppState) -> None:
        super().__init__(
            state, "shown", "exact", "looks.drawn", "looks.sort", "looks.scale", "looks.contact",
            "looks.dark", "work.arriving", "knowledge.narrowed", "knowledge.known",
        )  # fmt: skip
        self.drawing = BarsFigure(self._choose)
        self.growth = GrowthFigure()
        # Whose growth is drawn, and with which exact 0.15 η3.
        self._grown: tuple[Replay | None, float | None] = (None, None)
        # Whether bars are exact, how many extend beyond the axis, and how many have no upper end.
        self._drawn: tuple[bool, int, int] | None = None
        self.drawn = question("Contacts", DRAWN, self.looks, "drawn", **SMALL)
        self.sorts = question("Sort bars", SORTS, self.looks, "sort", **SMALL | {"width": 208})
        self.units = question("Unit", SCALES, self.looks, "scale", **SMALL)
        self.choices = [self.drawn, self.sorts, self.units]
        self.exact = pmui.Button(label="Compute exact intervals", margin=(14, 8, 2, 8), **OUTLINED)
        self.lead, self.details = note(), note()
        self.exact.on_click(lambda event: state.compute_exact())
        running = "work.computation.running"
        observe(self._explain, state, "hand.pulls", "missing", running, "work.reader.running")
        observe(self._offer, state, "shown", "exact", running, "knowledge.task.running")
        self._offer()
        self._explain()
        self.catch_up()

    def panel(self) -> pn.Column:
        """Choices and bars; collapsed table and growth."""
        wide = {"sizing_mode": "stretch_width"}
        grows = folded_away(GROWS, plotted(self.growth.figure))
        self.looks.sync_opened(grows, "growth")
        return pn.Column(
            self.lead, Known(self.state), plotted(self.drawing.figure),
            pn.FlexBox(*self.choices, self.exact, **wide), Contacts(self.looks), grows, **wide,
        )  # fmt: skip

    def update(self) -> None:
        """Update contacts, exact intervals and the walk's length."""
        state, looks, replay = self.state, self.looks, self.state.shown
        if replay is None:
            return
        narrowed, coming = state.knowledge.narrowed, state.work.arriving is not None
        exact = exact_intervals(state.possible, replay)
        before = exact_intervals(narrowed.before, replay) if exact and narrowed else {}
        found = exact or _found(state.work.arriving or {}, replay)
        order = ordered(replay, exact, looks.sort, narrowed, coming)
        named = [one.contact for one in state.knowledge.known]
        named += [] if looks.contact is None else [looks.contact]
        ranks = picked(order.contacts, SOME if looks.drawn == "some" else MOST_BARS, named)
        relative = looks.scale == "own"
        beyond = self.drawing.show(
            replay, order.contacts[ranks], found, before, seen=state.obeying, relative=relative
        )
        self.drawing.dots.glyph.update(fill_color=now(looks.dark), line_color=now(looks.dark))
        self.drawing.mark(looks.contact)
        self.drawing.figure.xaxis.axis_label = worded(
            replay, _across(len(replay.order), len(ranks), order.words) + _widest(replay, exact)
        )
        self.drawing.figure.yaxis.axis_label = worded(
            replay, f"normal force fₙ ({SCALES[looks.scale]})"
        )
        self.drawn.options = by_words(
            {"all": f"all {len(replay.order)}", "some": f"{SOME} of them"}
        )
        for select, labels in ((self.sorts, SORTS), (self.units, SCALES)):
            select.options = by_words({key: worded(replay, name) for key, name in labels.items()})
        endless = int(np.isinf(exact["high"]).sum()) if exact else 0
        self._drawn = bool(exact), beyond, endless
        self._explain()
        eta3 = None if state.growing else _exact_eta3(self._sampled())
        if replay is not self._grown[0] or eta3 != self._grown[1]:
            self._grown = replay, eta3
            self.growth.show(replay, state.growing, eta3)

    def _sampled(self) -> Any:
        """The exact intervals of the S from which the networks on screen were sampled, or None."""
        held = self.state.obeying and self.state.knowledge.known
        return self.state.possible if held else self.state.exact

    def _explain(self, *events: Any) -> None:
        """Say what is drawn."""
        replay = self.state.shown
        if replay is None:
            self.lead.object = self.state.nothing
        elif self._drawn is not None:
            self.lead.object = sentence(self.state, replay, *self._drawn)

    def _choose(self, contact: int) -> None:
        self.looks.contact = contact

    def _offer(self, *events: Any) -> None:
        """Offer exact intervals only if there are none and none are being computed."""
        self.exact.visible = self.state.replay is not None and self.state.exact_requested


def sentence(
    state: AppState, replay: Replay, exact: bool, beyond: int = 0, endless: int = 0
) -> str:
    """The present meaning of pale, dark and dots, as HTML."""
    if not replay.summary["dimension"]:
        return worded(replay, HEADING + FIXED)
    narrowed, held, parts = state.knowledge.narrowed, state.knowledge.known, []
    if exact:
        words = f"pale: {term('exact', state.bounds)}"
        if not narrowed:
            every = "network at this pressure" if replay.pressed else "admissible network"
            words += " without the held forces" if held else f", every {every}"
        parts.append(mark(PALE, words))
        if narrowed:
            parts.append(mark(LOST, "pink: lost by holding them"))
    elif state.work.arriving is not None:
        parts.append(mark(PALE, "pale: exact, as bounds are found"))
    count = replay.summary["states"]
    kind = "sample" if state.on_screen and state.on_screen.kind == "uniform" else "walk"
    networks = f"{'the' if state.growing else count} networks of the {kind}"
    networks += " so far" * state.growing
    if state.obeying:  # other networks can exceed these bounds
        parts.append(mark(DARK, f"dark: {term('seen', 'seen')} in {networks}"))
    parts.append(mark(now(state.looks.dark), _dot(state), "50%"))
    if replay.given:
        parts.append(mark(ORIGINAL, term("original", "as packed"), "50%"))
    text = worded(replay, HEADING) + "".join(f"{part}. " for part in parts)
    if beyond:
        text += f"Bars of contacts that carry almost nothing extend beyond the axis: {beyond}. "
    if endless:
        text += f"Pale bars up to the upper edge have no upper end: {endless}. "
    return text + "Drag a dot, or a line in the packing."


def _found(bounds: Bounds, replay: Replay) -> Bounds:
    """Exact bounds found so far; where only one is known, the bar ends at the value seen."""
    none = np.isnan(list(bounds.values())).all(axis=0)
    return {
        side: np.where(np.isnan(found) & ~none, getattr(replay, side)[:, 0], found)
        for side, found in bounds.items()
    }


def _dot(state: AppState) -> str:
    """The network whose forces are dots, and whether it may lack the held forces."""
    ignores = state.knowledge.known and not state.hand.pulls and not state.obeying
    return "dot: now, in a network of all of S" if ignores else "dot: now"


def _exact_eta3(exact: Any) -> float | None:
    """0.15 η3 of exact intervals, or None."""
    value = np.nan if exact is None else 0.15 * exact["eta3"].item()
    return value if np.isfinite(value) else None


def _across(every: int, drawn: int, words: str) -> str:
    some = f"{every} contacts" if drawn == every else f"{drawn} of {every} contacts"
    return f"{some}, sorted by {words}"


def _widest(replay: Replay, exact: Bounds) -> str:
    """The contact with the longest interval, and its length; empty if all are determined."""
    ends = exact or {"low": replay.low[:, 0], "high": replay.high[:, 0]}
    extent = np.nan_to_num(ends["high"] - ends["low"], posinf=np.inf)
    if not extent.max(initial=0.0) > DETERMINED:
        return ""
    longest = f"{extent.max():.3f}".replace("inf", "∞")
    which = "exact" if exact else "seen"
    return f"; widest: contact {replay.backbone[extent.argmax()]}, ΔFₙ {longest} ({which})"
