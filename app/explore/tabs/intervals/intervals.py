"""Intervals of each contact's normal force (Fig. 3 of PRE 79, 052302); η1, η2, η3 as they grow."""

from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui
from bokeh.core.properties import value
from bokeh.events import Tap
from bokeh.models import ColumnDataSource, Label, Node, Range1d, Span, TapTool
from bokeh.plotting import figure as Figure

from granforce.types import Integers

from ....packing.view import Bounds, exact_intervals
from ....results import progress_feed
from ....results.geometry import nearly
from ....results.replays import Replay
from ....state.app_state import AppState
from ....state.known import Narrowed
from ....state.view_settings import DRAWN, SCALES, SORTS
from ....widgets.hints import term
from ....widgets.parts import (
    LATER,
    MOVES,
    OUTLINED,
    TabView,
    figure,
    folded_away,
    note,
    plotted,
    question,
)
from ....widgets.plot_style import (
    DARK,
    DOT,
    GUESS,
    ORIGINAL,
    PALE,
    SERIES,
    corner,
    hover,
    legend_above,
)
from .contact_table import Contacts
from .known_forces import Known

MOST_BARS = 1500  # more than there are pixels would only cost time; of more, evenly many are shown
SOME = 16  # bars that can be told apart at a glance
APART = 100  # bars up to which there is room between them, and for large dots
GOAL = "goal {:g} →"
ALONE = "the marked line"
CORNER = "possible: exact; seen: in the networks so far"
CORNER_ALONE = "blue: found at random, so far; red: now"
ASK = "your guess: click here, higher or lower"
AROUND = 1.5  # of its width, beside a bar that is alone
BARS = ("at", "rank", "contact", "original", "exact_low", "exact_high", "low", "high", "now")
STRONGEST = 60  # contacts that are drawn by how much what is known shortened their interval
BARS += ("whole_low", "whole_high")  # exact intervals without what is known
# Widths of what was possible before, is possible, and was seen, in that of one contact, and size
# of dots, px; of few bars, and of many.
FEW, MANY = (0.8, 0.8, 0.4, 7.5), (1.0, 1.0, 0.9, 2.4)
ROOM = 1.4  # of the axis for forces of a walk under way, which exceed the original ones
ETAS = ("eta1", "eta2", "eta3")
SMALL = {"width": 146, "margin": (6, 2, 2, 8)}


GROWS = "How many networks does it take?"
LEAD = (
    "<b>How far can each force go?</b> Each bar is one contact, that is, one line in the packing. "
    "By chance a force hardly varies (dark); on purpose it can go much further (pale)."
)
LEAD_ALONE = (
    "<b>How large can this force get?</b> In {:d} sets of forces found at random it stayed between "
    "{:.1f} and {:.1f} (blue: so far). Can you beat that?"
)
LEAD_GROWING = (
    "<b>How large can this force get?</b> The blue bar grows as sets of forces are found at random."
)
FIXED = "<b>How far can each force go?</b> Nowhere: balance leaves every force one value."
HELP = f"""<details><summary>What do the bars and curves show?</summary>
Pale: every force that a contact can have in any network in balance
({term("exact", "possible")}); dark: what the networks passed so far had: chance rarely goes to the
ends; yellow: in the {term("original")}; dots: in the network on screen. Curves: η of the networks
passed so far (of η3, {term("eta3", "0.15 of it")}), and where it ends (dashed). Where forces are
{term("known", "known")}, the faintest part of a bar is what was possible without that knowledge.
Click a bar to find its contact in the packing.
</details>"""


class View(TabView):
    """One bar a contact, growing as the states go by; the player rewrites low, high and now."""

    name = "intervals"

    def __init__(self, state: AppState) -> None:
        super().__init__(
            state, "seen", "exact", looks=["drawn", "sort", "scale", "contact", "fresh"]
        )
        self.bars = _source("bars", BARS)
        self.growth = _source("growth", ("state", *ETAS))
        self.chosen = _source("chosen", ("rank", "low", "high"))
        self.invited = _source("invited", ("rank", "at", "words", "low", "high"))
        self.unknown = _source("unknown", ("rank", "at", "off"))  # beyond what was seen
        self.guess = Span(
            dimension="width", line_color=GUESS, line_width=2, line_dash="dashed", visible=False
        )
        self.guess_words = Label(
            x=Node(target="frame", symbol="left", offset=6), y=0, y_offset=3, text_color=GUESS,
            text_font_size="13px", padding=4, border_radius=4, visible=False,
        )  # fmt: skip
        self.finals = [
            Span(dimension="width", line_dash="dashed", line_color=colour) for colour in SERIES
        ]
        self.figure, self.growth_figure = self._bars_figure(), self._growth_figure()
        self.contacts = np.array([], dtype=int)
        self.alone = False  # whether only the contact is drawn that a visitor is asked to drag
        self._grown: Replay | None = None  # whose growth is drawn
        self._guessed_of: tuple[Replay | None, int | None] = None, None  # and its contact
        self.choices = [
            question("Contacts", DRAWN, self.looks, "drawn", **SMALL),
            question("Sorted by", SORTS, self.looks, "sort", **SMALL),
            question("Scale", SCALES, self.looks, "scale", **SMALL),
        ]
        self.exact = pmui.Button(label="Compute exact intervals", margin=(14, 8, 2, 8), **OUTLINED)
        self.lead, self.told = note(LEAD), note(HELP)
        self._connect()
        self.catch_up()

    def panel(self) -> pn.Column:
        """Choices and bars; growth, to be opened."""
        wide = {"sizing_mode": "stretch_width"}
        grows = folded_away(GROWS, plotted(self.growth_figure))
        return pn.Column(
            self.lead,
            plotted(self.figure),
            pn.FlexBox(*self.choices, styles=LATER, **wide),
            self.exact,  # below, as the plot must not move when the button goes
            pn.Column(
                Known(self.state), self.told, grows, Contacts(self.looks), styles=LATER, **wide
            ),
            **wide,
        )

    def _connect(self) -> None:
        state = self.state
        self.exact.on_click(lambda event: state.compute_exact())
        self.bars.selected.on_change("indices", self._tapped)
        self.figure.on_event(Tap, self._guess)
        state.knowledge.param.watch(self.refresh, "narrowed")
        state.hand.param.watch(lambda event: self._invite(), "pulls")
        state.param.watch(self._offer, ["seen", "exact"])
        state.work.param.watch(self._offer, "arriving")
        for task in (state.work.computation, state.knowledge.task):
            task.param.watch(self._offer, "running")
        self._offer()

    # Contents

    def update(self) -> None:
        """Take over contacts, exact intervals and the walk's length."""
        state, looks, replay = self.state, self.looks, self.state.seen
        if replay is None:
            return
        exact = exact_intervals(state.possible, replay)
        order = sorted_contacts(replay, exact, looks.sort, state.knowledge.narrowed)
        named = [one.contact for one in state.knowledge.known]
        named += self._invited() if looks.contact is None else [looks.contact]
        free = replay.summary["dimension"] > 0
        self.alone = looks.fresh and free and len(named) == 1  # one thing first, to be found out
        if self.alone:
            order, exact = np.array(named), {}
        self._forget_guess(replay, named)
        lead = self._challenge(replay, named[0]) if self.alone else LEAD
        self.lead.object = lead if free else FIXED
        self.contacts = order[picked(order, SOME if looks.drawn == "some" else MOST_BARS, named)]
        self._show_bars(replay, exact)
        self._offer()
        if replay is not self._grown:
            self._show_growth(replay)
        self._mark()

    def _offer(self, *events: Any) -> None:
        """Exact intervals are to be asked for only where none are there or under way."""
        state = self.state
        self.exact.visible = state.replay is not None and state.exact_wanted
        known = state.possible is not None or state.work.arriving is not None
        self.exact_item.visible = known and not self.alone

    def _show_bars(self, replay: Replay, exact: Bounds) -> None:
        contacts, of = self.contacts, len(replay.order)
        original = replay.normal[0, contacts]
        unit = original if self.looks.scale == "own" else np.ones_like(original)
        none = np.full_like(original, np.nan)
        low, high = (exact[name][contacts] if exact else none for name in ("low", "high"))
        whole, before = (none, none), {}
        if exact and self.state.knowledge.narrowed is not None:
            before = exact_intervals(self.state.knowledge.narrowed.before, replay)
            whole = before["low"][contacts], before["high"][contacts]
        few = len(contacts) <= APART
        *widths, size = FEW if few else MANY
        self.figure.xaxis.major_label_text_alpha = 0 if few else 1  # which says nothing of a few
        for renderer, width in zip(self.layers, widths, strict=True):
            renderer.glyph.width = width
        self.dots.glyph.size = size
        self.whole.visible = self.whole_item.visible = whole[0] is not none
        self.bars.data = {
            "rank": np.arange(1, len(contacts) + 1, dtype=np.float32),
            "at": contacts.astype(np.int32),
            "contact": replay.backbone[contacts].astype(np.int32),
            "original": original / unit,
            "whole_low": whole[0] / unit,
            "whole_high": whole[1] / unit,
            "exact_low": low / unit,
            "exact_high": high / unit,
            **{name: original / unit for name in ("low", "high", "now")},
        }
        around = AROUND * self.alone
        _set_range(self.figure.x_range, -around, len(contacts) + 1 + around)
        self.packed_item.visible = not self.alone  # a line through all bars
        self.figure.legend[0].visible = not self.alone
        self.figure.xgrid.visible = not self.alone
        self.figure.height = 440 if self.alone else 320
        self.corner.text = CORNER_ALONE if self.alone else CORNER
        told = self.alone and not self.state.growing
        ends = [replay.low[contacts[0], 0], replay.high[contacts[0], 0]] if told else []
        self.unknown.data = {"rank": [1.0] * len(ends), "at": ends, "off": [28, -10][: len(ends)]}
        top = 3.0 if self.looks.scale == "own" else _top(replay, before or exact)
        if self.state.growing or self.alone:
            top *= ROOM
        _set_range(self.figure.y_range, 0, top)
        some = f"{len(contacts)} of {of} " if len(contacts) < of else ""
        ranked = f"{some}contacts, sorted by {SORTS[self.looks.sort]}"
        self.figure.xaxis.axis_label = ALONE if self.alone else ranked
        name = "normal force" if self.alone else "normal force fₙ"
        self.figure.yaxis.axis_label = f"{name} ({SCALES[self.looks.scale]})"
        self.guess.visible = self.guess.visible and self.looks.scale == "mean"
        if self.alone and not self.guess.visible:
            self._word(0.3 * top, ASK, "white", DOT)
        elif not self.guess.visible:
            self.guess_words.visible = False

    def _show_growth(self, replay: Replay) -> None:
        self._grown, grows = replay, self.state.growing
        number = progress_feed.numbers(replay.summary) if grows else replay.number
        unseen = np.full(len(number), np.nan, dtype=np.float32)
        self.growth.data = {"state": number.astype(np.int32)} | {
            name: unseen.copy() for name in ETAS
        }
        _set_range(self.growth_figure.x_range, 0, max(1, int(number[-1])))
        for span in self.finals:
            span.visible = not grows
        if grows:  # how far they will grow is not known
            return
        # Of the states shown, like the curves: all states of the walk have seen more.
        finals = [replay.growth[name][-1] * (0.15 if name == "eta3" else 1) for name in ETAS]
        finals = [float(np.nan_to_num(final)) for final in finals]
        for span, final in zip(self.finals, finals, strict=True):
            span.location = final
        _set_range(self.growth_figure.y_range, 0, 1.25 * max(finals) if max(finals) > 1e-9 else 1)

    # Selection, linked with the packing

    def _tapped(self, name: str, old: Any, new: list[int]) -> None:
        if new:
            self.looks.contact = int(self.contacts[new[0]])
            self.bars.selected.indices = []

    def _challenge(self, replay: Replay, contact: int) -> str:
        """How far the force of a contact went by chance, as HTML."""
        if self.state.growing:
            return LEAD_GROWING
        reached = replay.low[contact, 0], replay.high[contact, 0]
        return LEAD_ALONE.format(replay.summary["states"], *map(float, reached))

    def _forget_guess(self, replay: Replay, named: list[int]) -> None:
        """A guess is of one force of one packing."""
        of, contact = self._guessed_of
        if replay is not of or (self.alone and contact != named[0]):
            self.guess.visible = self.guess_words.visible = False
            self._guessed_of = replay, named[0] if self.alone else None

    def _guess(self, event: Any) -> None:
        """Who is new clicks where the bar may end, before finding out."""
        if self.alone and event.y > 0:
            self.guess.update(location=event.y, visible=True)
            self._word(event.y, f"your guess {event.y:.1f}", GUESS, None)

    def _word(self, y: float, text: str, colour: str, behind: str | None) -> None:
        look = {"text_color": colour, "background_fill_color": behind}
        self.guess_words.update(y=y, text=text, visible=True, **look)

    def _mark(self) -> None:
        """Show where the selected contact stands, if it is drawn."""
        at = np.flatnonzero(self.contacts == self.looks.contact)
        low, high = self.figure.y_range.start, self.figure.y_range.end
        rank = self.bars.data["rank"][at].tolist()
        self.chosen.data = {"rank": rank, "low": [low] * len(at), "high": [high] * len(at)}
        self._invite()

    def _invited(self) -> list[int]:
        """The contact whose line in the packing says that it can be dragged, if there is one."""
        replay = self.state.seen
        if replay is None or replay.invited is None or not replay.summary["dimension"]:
            return []
        return [replay.invited]

    def _invite(self) -> None:
        """Say which bar is that line's, and what the force is to pass, until something was done."""
        wanted = self.looks.contact is None and not self.state.hand.pulls and not self.alone
        wanted &= self.looks.scale == "mean"
        at = np.flatnonzero(np.isin(self.contacts, self._invited() if wanted else []))
        at = at[np.isfinite(self.bars.data["exact_high"][at])]
        rank, low, high = (self.bars.data[name][at] for name in ("rank", "exact_low", "exact_high"))
        goals = [nearly(most) for most in high]
        words = [GOAL.format(goal) for goal in goals]
        columns = {"rank": rank, "at": goals, "words": words}
        self.invited.data = columns | {"low": low, "high": high}

    # Figures

    def _bars_figure(self) -> Figure:
        fig = figure(
            "intervals",
            None,
            "contacts",
            "normal force fₙ",
            x_range=Range1d(0, 1),
            y_range=Range1d(0, 1, name="bars_range"),
            height=320,
        )
        self.layers = [
            fig.vbar(
                x="rank", bottom=f"{of}low", top=f"{of}high", width=1, source=self.bars,
                line_color=None, fill_color=colour, fill_alpha=alpha, legend_label=label,
            )
            for label, of, colour, alpha in (
                ("before", "whole_", PALE, 0.3), ("possible", "exact_", PALE, 1.0),
                ("seen", "", DARK, 1.0),
            )
        ]  # fmt: skip
        for layer in self.layers:
            layer.nonselection_glyph = None
        self.whole, exact, seen = self.layers
        seen.name = "seen"  # see layer.js
        line = fig.line(
            "rank",
            "original",
            source=self.bars,
            color=ORIGINAL,
            line_width=1.5,
            legend_label="as packed",
        )
        self.dots = dots = fig.scatter(
            "rank",
            "now",
            source=self.bars,
            color=DOT,
            legend_label="now: drag it up or down",
            nonselection_alpha=1,
            name="dots",
        )
        for moving in (seen, line, dots):
            moving.tags = MOVES
        fig.vbar(
            "rank", FEW[0], "high", "low", source=self.invited, fill_alpha=0, line_color=DOT,
            line_width=2,
        )  # fmt: skip
        fig.scatter(
            "rank", "at", source=self.invited, marker="dash", color=DOT, size=34, line_width=2
        )
        fig.text(
            "rank", "at", "words", source=self.invited, x_offset=-12, text_baseline="middle",
            text_align="right", text_color="white", text_font_size="12px",
            background_fill_color=DOT, padding=3, border_radius=4, name="invited_bar",
        )  # fmt: skip
        fig.text(
            "rank", "at", value("?"), source=self.unknown, y_offset="off", text_align="center",
            text_font_size="20px", text_color=DARK,
        )  # fmt: skip
        fig.name = "bars_figure"
        fig.add_layout(self.guess)
        fig.add_layout(self.guess_words)
        fig.segment("rank", "low", "rank", "high", source=self.chosen, color=DOT, line_width=2)
        self.whole_item, self.exact_item = fig.legend[0].items[:2]
        self.packed_item = fig.legend[0].items[3]
        legend_above(fig, 5)
        self.corner = corner(fig, CORNER)
        fig.add_tools(
            hover(
                [seen, exact],
                ("contact", "@contact"),
                ("now", "@now{0.000}"),
                ("as packed", "@original{0.000}"),
                ("seen", "@low{0.000} … @high{0.000}"),
                ("possible", "@exact_low{0.000} … @exact_high{0.000}"),
            ),
            TapTool(renderers=[exact, seen, dots]),
        )
        return fig

    def _growth_figure(self) -> Figure:
        fig = figure(
            "eta_so_far",
            None,
            "networks shown so far",
            "how undetermined, η",
            x_range=Range1d(0, 1),
            y_range=Range1d(0, 1, name="growth_range"),
            height=210,
            tools="",
        )
        labels = ("eta1", "spread η1"), ("eta2", "distance η2"), ("eta3", "0.15 × range η3")
        for (name, label), colour in zip(labels, SERIES, strict=True):
            line = fig.line(
                "state", name, source=self.growth, line_width=2, color=colour, legend_label=label
            )
            line.tags = MOVES
        fig.name = "growth_figure"
        for span in self.finals:
            fig.add_layout(span)
        legend_above(fig)
        corner(fig, "seen so far; dashed: in all networks shown")
        return fig


def sorted_contacts(
    replay: Replay, exact: Bounds, by: str, narrowed: Narrowed | None = None
) -> Integers:
    """Positions of the contacts (N_c,), ascending in what `by`, one of looks.SORTS, names.

    narrowed: known.Narrowed; the STRONGEST whose interval it has shortened most, alone.
    """
    if by == "shortened":
        if not exact or narrowed is None:
            return replay.order
        return np.argsort(-narrowed.shortened, kind="stable")[:STRONGEST]
    if by == "original" or (by in ("exact", "position") and not exact):
        return replay.order
    if by == "extent":
        value = replay.high[:, 0] - replay.low[:, 0]
    else:
        value = exact["high"] - exact["low"]
        if by == "position":
            with np.errstate(invalid="ignore", divide="ignore"):
                value = (replay.normal[0] - exact["low"]) / value
    return np.argsort(value, kind="stable")


def picked(order: Integers, most: int, named: list[int]) -> Integers:
    """Ranks (k,) of contacts to be drawn of an order: evenly spaced, at most so many, and named."""
    step = -(-len(order) // most)
    return np.union1d(np.arange(0, len(order), step), np.flatnonzero(np.isin(order, named)))


def _top(replay: Replay, exact: Bounds) -> float:
    seen = float(replay.high[:, 0].max(initial=1))
    return 1.04 * max(seen, float(np.quantile(exact["high"], 0.995)) if exact else 0)


def _source(name: str, columns: tuple[str, ...]) -> ColumnDataSource:
    return ColumnDataSource({column: [] for column in columns}, name=name)


def _set_range(axis: Range1d, low: float, high: float) -> None:
    axis.update(start=low, end=high, reset_start=low, reset_end=high)
