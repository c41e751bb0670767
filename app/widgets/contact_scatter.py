"""A plot with one point per contact, against its force as packed."""

from collections.abc import Callable
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource

from granforce.types import Floats

from ..results.replays import Replay
from .parts import figure, on_tap
from .plot_style import DOT, hover

Layer = tuple[str, Floats, str, float]  # label, values (N_c,), colour and size of its points


class ContactScatter:
    """Points of one or more layers; a click selects the contact, which a ring marks."""

    def __init__(
        self,
        name: str,
        words: tuple[str, str],
        replay: Replay,
        layers: list[Layer],
        select: Callable[[int], object],
    ) -> None:
        """name: of the file; words: of the value axis, and short; the last layer has the ring."""
        self.normal, self.values = replay.normal[0], layers[-1][1]
        self.chosen = ColumnDataSource({"x": [], "y": []})
        long, brief = words
        self.figure = fig = figure(
            name, None, "normal force fₙ as packed, in mean forces", long, height=320
        )
        points: list[Any] = []
        for label, values, colour, size in layers:
            columns = {"x": self.normal, "y": values.astype(np.float32), "contact": replay.backbone}
            look = {"legend_label": label} if label else {}
            points.append(
                fig.scatter(
                    "x", "y", source=ColumnDataSource(columns), color=colour, size=size, alpha=0.75,
                    **look,
                )
            )  # fmt: skip
        rows = ("contact", "@contact"), ("fₙ", "@x{0.000}"), (brief, "@y{0.000}")
        fig.add_tools(hover(points[-1:], *rows))
        on_tap(fig, lambda row, data: select(row), *points)
        fig.scatter(
            "x", "y", source=self.chosen, size=13, fill_alpha=0, line_color=DOT, line_width=2
        )

    def mark(self, contact: int | None) -> None:
        """Draw a ring around this contact."""
        chosen = [] if contact is None else [contact]
        self.chosen.data = {"x": self.normal[chosen], "y": self.values[chosen]}
