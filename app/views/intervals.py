"""Intervals of each contact's normal force seen so far (Fig. 3 of PRE 79, 052302), and η3."""

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, Range1d, Span

from .style import DOT, ORIGINAL, PALE, SERIES, hover, plot, quiet_legend

BARS, GROWTH = "bars", "growth"  # names under which the player finds the sources


class IntervalsView:
    """One bar a contact, growing as the walk goes; the player rewrites low, high and now."""

    def __init__(self, state):
        self.bars = ColumnDataSource(name=BARS)
        self.growth = ColumnDataSource(name=GROWTH)
        self.final = Span(dimension="width", line_dash="dashed", line_color=SERIES[1])
        self.figure = self._bars_figure()
        self.growth_figure = self._growth_figure()
        self.show(state.replay)

    def panel(self):
        """The bars."""
        return pn.pane.Bokeh(self.figure, sizing_mode="stretch_width", margin=0)

    def growth_panel(self):
        """η3 against the number of states."""
        return pn.pane.Bokeh(self.growth_figure, sizing_mode="stretch_width", margin=0)

    def show(self, replay):
        """Take over contacts and their original forces."""
        if replay is None:
            return
        order = replay.order
        original = replay.normal[0, order]
        columns = {name: original.copy() for name in ("low", "high", "now", "original")}
        count = len(order)
        self.bars.data = columns | {
            "rank": np.arange(1, count + 1, dtype=np.float32),
            "contact": order.astype(np.int32),
        }
        _set_range(self.figure.x_range, 0, count + 1)
        _set_range(self.figure.y_range, 0, 1.04 * float(replay.normal.max(initial=1)))
        unseen = np.full(len(replay.number), np.nan, dtype=np.float32)
        self.growth.data = {"state": replay.number.astype(np.int32), "eta3": unseen}
        eta3 = replay.summary["eta3"]
        self.final.location = eta3
        _set_range(self.growth_figure.x_range, 0, max(1, int(replay.number[-1])))
        _set_range(self.growth_figure.y_range, 0, 1.15 * eta3 if eta3 > 1e-9 else 1)

    def _bars_figure(self):
        fig = plot(
            "Interval of each contact's normal force seen so far",
            "contacts, sorted by original fₙ",
            "fₙ / ⟨fₙ⟩",
            x_range=Range1d(0, 1),
            y_range=Range1d(0, 1),
            height=280,
        )
        bars = fig.vbar(
            x="rank",
            bottom="low",
            top="high",
            width=1,
            source=self.bars,
            fill_color=PALE,
            fill_alpha=0.75,
            line_color=None,
            legend_label="seen",
        )
        fig.scatter("rank", "now", source=self.bars, size=2.2, color=DOT, legend_label="now")
        fig.line(
            "rank",
            "original",
            source=self.bars,
            color=ORIGINAL,
            line_width=1.5,
            legend_label="original",
        )
        quiet_legend(fig, "top_left")
        fig.add_tools(
            hover(
                [bars],
                ("contact", "@contact"),
                ("fₙ now", "@now{0.000} ⟨fₙ⟩"),
                ("original", "@original{0.000} ⟨fₙ⟩"),
                ("seen", "@low{0.000} … @high{0.000}"),
            )
        )
        return fig

    def _growth_figure(self):
        fig = plot(
            "η3 of the states shown so far (dashed: of all states)",
            "states of the walk",
            "η3",
            x_range=Range1d(0, 1),
            y_range=Range1d(0, 1),
            height=170,
        )
        fig.line("state", "eta3", source=self.growth, line_width=2, color=SERIES[0])
        fig.add_layout(self.final)
        return fig


def _set_range(axis, low, high):
    axis.update(start=low, end=high, reset_start=low, reset_end=high)
