"""η1, η2 and 0.15 η3 of the stored networks played so far."""

import numpy as np
from bokeh.models import ColumnDataSource, Range1d, Span

from ....results import progress_feed
from ....results.replays import Replay
from ....widgets.parts import MOVES, figure
from ....widgets.plot_style import SERIES, legend_above
from .bars_figure import set_range

LABELS = {"eta1": "η₁", "eta2": "η₂", "eta3": "0.15 η₃"}


class GrowthFigure:
    """Curves that the player fills in; dashed: their final values over all networks shown."""

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
        counted = f"{len(number) - 1} stored of {replay.summary['states']} networks"
        self.figure.xaxis.axis_label = f"number of the network; η of the {counted} played so far"
        unseen = np.full(len(number), np.nan, dtype=np.float32)
        self.growth.data = {"state": number.astype(np.int32)} | {
            name: unseen.copy() for name in LABELS
        }
        set_range(self.figure.x_range, 0, max(1, int(number[-1])))
        for span in self.finals:
            span.visible = not growing
        if growing:
            return
        # Of the states shown, like the curves: the states of the whole walk span more.
        ends = [replay.growth[name][-1] * (0.15 if name == "eta3" else 1) for name in LABELS]
        ends = [float(np.nan_to_num(end)) for end in ends]
        for span, end in zip(self.finals, ends, strict=True):
            span.location = end
        set_range(self.figure.y_range, 0, 1.25 * max(ends) if max(ends) > 1e-9 else 1)
