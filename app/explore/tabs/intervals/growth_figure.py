"""η1, η2 and 0.15 η3 of the stored networks, as their number grows."""

import numpy as np
from bokeh.models import ColumnDataSource, Range1d, Span

from ....results import progress_feed
from ....results.replays import Replay
from ....widgets.parts import MOVES, figure
from ....widgets.plot_style import SERIES, legend_above
from .bars_figure import set_range

FACTORS = {"eta3": 0.15}
LABELS = {"eta1": "η₁", "eta2": "η₂", "eta3": "0.15 η₃"}


class GrowthFigure:
    """Curves over all stored networks; the player extends them during a walk. Dashed: ends."""

    def __init__(self) -> None:
        self.growth = ColumnDataSource({name: [] for name in ("state", *LABELS)}, name="growth")
        self.finals = [
            Span(dimension="width", line_dash="dashed", line_color=colour) for colour in SERIES
        ]
        self.figure = fig = figure(
            "eta_so_far", None, "", "indeterminacy η", height=210, tools="",
            x_range=Range1d(0, 1), y_range=Range1d(0, 1, name="growth_range"),
        )  # fmt: skip
        fig.name = "growth_figure"
        for (name, label), colour in zip(LABELS.items(), SERIES, strict=True):
            line = fig.line(
                "state", name, source=self.growth, line_width=2, color=colour, legend_label=label
            )
            line.tags = MOVES
        for span in self.finals:
            fig.add_layout(span)
        legend_above(fig)

    def show(self, replay: Replay, growing: bool) -> None:
        """Curves of a Replay, or of a walk in progress with unknown end."""
        number = progress_feed.numbers(replay.summary) if growing else replay.number
        stored = f"{len(number) - 1} of {replay.summary['states']}"
        self.figure.xaxis.axis_label = f"network; η over the stored ones up to it ({stored})"
        unseen = np.full(len(number), np.nan)
        columns = {
            name: unseen.copy() if growing else FACTORS.get(name, 1.0) * replay.growth[name]
            for name in LABELS
        }
        self.growth.data = {"state": number.astype(np.int32)} | {
            name: values.astype(np.float32) for name, values in columns.items()
        }
        set_range(self.figure.x_range, 0, max(1, int(number[-1])))
        for span in self.finals:
            span.visible = not growing
        if growing:
            return
        # Of the states shown, like the curves: the states of the whole walk span more.
        ends = [float(np.nan_to_num(values[-1])) for values in columns.values()]
        for span, end in zip(self.finals, ends, strict=True):
            span.location = end
        set_range(self.figure.y_range, 0, 1.25 * max(ends) if max(ends) > 1e-9 else 1)
