"""η1, η2 and 0.15 η3 of the stored networks, as their number grows."""

import numpy as np
from bokeh.models import ColumnDataSource, Range1d

from ....results import progress_feed
from ....results.replays import Replay
from ....widgets.parts import MOVES, figure
from ....widgets.plot_style import SERIES, legend_above
from .bars_figure import set_range

FACTORS = {"eta3": 0.15}
EXACT = "0.15 η₃ exact"
LABELS = {"eta1": "η₁", "eta2": "η₂", "eta3": "0.15 η₃"}


class GrowthFigure:
    """Curves over all stored networks, and exact 0.15 η3; the player extends them during a walk."""

    def __init__(self) -> None:
        self.growth = ColumnDataSource({name: [] for name in ("state", *LABELS)}, name="growth")
        self.exact = ColumnDataSource({"state": [], "eta3": []})
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
        fig.line(
            "state", "eta3", source=self.exact, line_width=2, line_dash="dashed",
            color=SERIES[list(LABELS).index("eta3")], legend_label=EXACT,
        )  # fmt: skip
        self._entry = fig.legend[0].items[-1]
        legend_above(fig)

    def show(self, replay: Replay, growing: bool, exact: float | None) -> None:
        """Curves of a Replay, or of a walk in progress with unknown end; exact: 0.15 η3 of S."""
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
        bound = [] if exact is None else [exact, exact]
        self.exact.data = {"state": [0, int(number[-1])][: len(bound)], "eta3": bound}
        self._entry.visible = bool(bound)
        if growing:
            return
        ends = [float(np.nan_to_num(values[-1])) for values in columns.values()]
        top = max(ends + bound)
        set_range(self.figure.y_range, 0, 1.25 * top if top > 1e-9 else 1)
