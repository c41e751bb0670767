"""The plot of intervals: a pale and a dark bar per contact, and a dot for its present force."""

from collections.abc import Callable

import numpy as np
from bokeh.models import ColumnDataSource, Range1d

from granforce.types import Floats, Integers

from ....packing.legend import Bounds
from ....results.replays import Replay
from ....widgets.parts import MOVES, figure, on_tap
from ....widgets.plot_style import DARK, DOT, LOST, ORIGINAL, PALE, hover, now

COLUMNS = ("at", "rank", "contact", "original", "exact_low", "exact_high", "low", "high", "now")
COLUMNS += ("whole_low", "whole_high")  # exact intervals without known forces
APART = 100  # number of bars up to which there are gaps between them, and large dots
# Widths of the bars for previously possible, possible and seen forces, in that of one contact, and
# size of the dots, px; for few bars, and for many, where dots shrink so as not to hide the bars.
FEW, MANY = (0.8, 0.8, 0.4, 7.5), (1.0, 1.0, 0.9, 2.6)
CLOSE, LEAST_DOT = 300, 1.0  # number of contacts from which dots shrink, and their least size, px
# Rows of the tooltip, without and with known forces.
PACKED = ("as packed", "@original{0.000}")
NOW = ("contact", "@contact"), ("now", "@now{0.000}"), PACKED
EXACT = "@exact_low{0.000} … @exact_high{0.000}"
FREE = *NOW, ("interval, exact", EXACT), ("interval, seen", "@low{0.000} … @high{0.000}")
GIVEN = (
    *NOW,
    ("interval, exact given the held forces", EXACT),
    ("interval, exact without them", "@whole_low{0.000} … @whole_high{0.000}"),
)
CARRYING = 0.1  # ⟨f_n⟩ as packed above which a contact counts for the axis in its own unit


class BarsFigure:
    """Bars of contacts; the player updates `now` and, during a walk, low and high."""

    def __init__(self, choose: Callable[[int], object]) -> None:
        """choose(contact): called when a bar is clicked."""
        self.bars = ColumnDataSource({column: [] for column in COLUMNS}, name="bars")
        self.chosen = ColumnDataSource({"rank": [], "low": [], "high": []}, name="chosen")
        self.contacts: Integers = np.array([], dtype=int)
        self.figure = fig = figure(
            "intervals", None, "contacts", "normal force fₙ", height=320,
            x_range=Range1d(0, 1), y_range=Range1d(0, 1, name="bars_range"),
        )  # fmt: skip
        fig.name = "bars_figure"
        fig.xgrid.visible = False
        fig.xaxis.update(major_label_text_alpha=0, major_tick_line_color=None)
        self.layers = [
            fig.vbar(
                x="rank", bottom=f"{of}low", top=f"{of}high", width=1, source=self.bars,
                line_color=None, fill_color=colour,
            )
            for of, colour in (("whole_", LOST), ("exact_", PALE), ("", DARK))
        ]  # fmt: skip
        _, exact, sampled = self.layers
        sampled.name = "seen"  # see plot_layer.js
        # Points, because neighbours in an order are not neighbours in the packing.
        self.packed = fig.scatter(
            "rank", "original", source=self.bars, color=ORIGINAL, name="packed"
        )
        self.dots = fig.scatter("rank", "now", source=self.bars, color=now(False), name="dots")
        for moving in (sampled, self.packed, self.dots):
            moving.tags = MOVES
        fig.segment("rank", "low", "rank", "high", source=self.chosen, color=DOT, line_width=2)
        self.tip = hover([sampled, exact])
        fig.add_tools(self.tip)
        marks = *self.layers, self.packed, self.dots
        on_tap(fig, lambda row, data: choose(int(data["at"][row])), *marks)

    def show(
        self,
        replay: Replay,
        contacts: Integers,
        exact: Bounds,
        before: Bounds,
        *,
        seen: bool,
        relative: bool,
    ) -> int:
        """Draw these contacts; return how many bars extend beyond the axis.

        before: exact bounds without known forces; seen: whether to draw what the networks span;
        relative: forces in units of that as packed.
        """
        self.contacts = contacts
        spanned = {"low": replay.low[:, 0], "high": replay.high[:, 0]} if seen else {}
        original = replay.normal[0, contacts]
        unit = original if relative else np.ones_like(original)
        ends = {
            **_ends("whole_", before, contacts),
            **_ends("exact_", exact, contacts),
            **_ends("", spanned, contacts),
            "now": original,
            "original": original,
        }
        with np.errstate(invalid="ignore", divide="ignore"):
            scaled = {name: (values / unit).astype(np.float32) for name, values in ends.items()}
        self.bars.data = scaled | {
            "rank": np.arange(1, len(contacts) + 1, dtype=np.float32),
            "at": contacts.astype(np.int32),
            "contact": replay.backbone[contacts].astype(np.int32),
        }
        *widths, size = FEW if len(contacts) <= APART else MANY
        size = max(LEAST_DOT, size * min(1.0, float(np.sqrt(CLOSE / max(1, len(contacts))))))
        for renderer, width in zip(self.layers, widths, strict=True):
            renderer.glyph.width = width
        self.dots.glyph.size = size
        # Not hidden by `visible`, which the player sets.
        self.packed.glyph.size = 0.8 * size if replay.given else 0
        rows = GIVEN if before else FREE
        self.tip.tooltips = [row for row in rows if replay.given or row is not PACKED]
        set_range(self.figure.x_range, 0, len(contacts) + 1)
        ends = [scaled[name] for name in ("whole_high", "exact_high", "high")]
        highest = np.fmax.reduce([np.where(np.isinf(end), np.nan, end) for end in ends])
        counted = original >= CARRYING if relative else np.ones(len(original), dtype=bool)
        top = 1.04 * float(np.nanmax(highest[counted], initial=1.0))
        set_range(self.figure.y_range, 0, top)
        return int(np.sum(highest > top))

    def mark(self, contact: int | None) -> None:
        """Mark a contact if it is drawn."""
        at = np.flatnonzero(self.contacts == contact)
        low, high = self.figure.y_range.start, self.figure.y_range.end
        rank = self.bars.data["rank"][at].tolist() if len(at) else []
        self.chosen.data = {"rank": rank, "low": [low] * len(at), "high": [high] * len(at)}


def _ends(of: str, bounds: Bounds, contacts: Integers) -> dict[str, Floats]:
    none = np.full(len(contacts), np.nan)
    return {f"{of}{side}": bounds[side][contacts] if bounds else none for side in ("low", "high")}


def set_range(axis: Range1d, low: float, high: float) -> None:
    """Set the range of an axis, also after a reset."""
    axis.update(start=low, end=high, reset_start=low, reset_end=high)
