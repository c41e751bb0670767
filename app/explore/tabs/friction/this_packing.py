"""Figures of the packing on screen alone: ΔF_n against f_n, and the distribution of f_n."""

from collections.abc import Callable

import numpy as np
from bokeh.models import ColumnDataSource, TapTool
from bokeh.plotting import figure as Figure

from granforce.measures import statistics

from ....packing.view import Bounds
from ....results.replays import Replay
from ....widgets.parts import figure
from ....widgets.plot_style import DARK, DOT, ORIGINAL, PALE, hover, legend_above

LARGEST, BINS = 6.0, 40  # of P(f_n): end of the axis in ⟨f_n⟩, and number of bins


class Scatter:
    """ΔF_n against f_n as packed, one point per contact; a click selects the contact."""

    def __init__(self, replay: Replay, exact: Bounds, select: Callable[[int], object]) -> None:
        self.original = replay.normal[0]
        self.seen = (replay.high - replay.low)[:, 0]
        self.chosen = ColumnDataSource({"x": [], "y": []})
        self.figure = fig = figure(
            "extent_against_force", None, "normal force fₙ as packed, in mean forces",
            "length ΔFₙ of its interval, in mean forces", height=320,
        )  # fmt: skip
        layers = [("seen in the networks", self.seen, DARK, 4.5)]
        if exact:
            layers.insert(0, ("possible (exact)", exact["high"] - exact["low"], PALE, 6))
        for label, extent, colour, size in layers:
            source = ColumnDataSource(
                {
                    "x": self.original,
                    "y": extent.astype(np.float32),
                    "contact": replay.backbone,
                }
            )
            points = fig.scatter(
                "x", "y", source=source, color=colour, size=size, alpha=0.75, legend_label=label,
                nonselection_alpha=0.75,
            )  # fmt: skip

            def tapped(
                name: str, old: object, new: list[int], of: ColumnDataSource = source
            ) -> None:
                if new:
                    select(int(new[0]))
                    of.selected.indices = []

            source.selected.on_change("indices", tapped)
        rows = ("contact", "@contact"), ("fₙ", "@x{0.000}"), ("ΔFₙ", "@y{0.000}")
        fig.add_tools(hover([points], *rows), TapTool())
        fig.scatter(
            "x", "y", source=self.chosen, size=13, fill_alpha=0, line_color=DOT, line_width=2
        )
        legend_above(fig)

    def mark(self, contact: int | None) -> None:
        """Draw a ring around this contact."""
        chosen = [] if contact is None else [contact]
        self.chosen.data = {"x": self.original[chosen], "y": self.seen[chosen]}


def forces(replay: Replay) -> tuple[Figure, str]:
    """P(f_n) of the original network and of all states shown: figure and sentence."""
    fig = figure(
        "force_distribution", None, "normal force fₙ, in mean forces", "P(fₙ)", height=300,
        y_axis_type="log",
    )  # fmt: skip
    layers = [("as packed", replay.normal[0], ORIGINAL)]
    if len(replay.normal) > 1:
        layers.insert(0, ("networks shown", replay.normal[1:], DARK))
    edges = np.linspace(0, min(LARGEST, float(replay.normal.max())), BINS + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    for label, values, colour in layers:
        density = statistics.density(values.ravel(), edges)
        height = np.where(density > 0, density, np.nan)
        fig.line(middle, height, color=colour, line_width=2, legend_label=label)
        fig.scatter(middle, height, color=colour, size=5)
    legend_above(fig)
    weak = np.mean(replay.normal < 1)
    return fig, (
        f"{weak:.0%} of the forces are smaller than the mean force, the largest is "
        f"{replay.normal.max():.1f} times as large."
    )
