"""Figures of the packing on screen alone: ΔF_n against f_n, and the distribution of f_n."""

from collections.abc import Callable

import numpy as np
from bokeh.plotting import figure as Figure

from granforce.measures import statistics

from ....packing.legend import Bounds
from ....results.replays import Replay, worded
from ....widgets.contact_scatter import ContactScatter
from ....widgets.parts import figure
from ....widgets.plot_style import DARK, ORIGINAL, PALE, legend_above

LARGEST, BINS = 6.0, 40  # of P(f_n): end of the axis in ⟨f_n⟩, and number of bins


def extents(replay: Replay, exact: Bounds, select: Callable[[int], object]) -> ContactScatter:
    """ΔF_n of each contact against f_n as packed."""
    layers = [("interval ΔFₙ, seen", (replay.high - replay.low)[:, 0], DARK, 4.5)]
    if exact:
        layers.insert(0, ("interval ΔFₙ, exact", exact["high"] - exact["low"], PALE, 6))
    words = "interval ΔFₙ, in mean forces", "ΔFₙ, seen"
    drawn = ContactScatter("extent_against_force", words, replay, layers, select)
    legend_above(drawn.figure)
    return drawn


def forces(replay: Replay) -> tuple[Figure, str]:
    """P(f_n) of the original network and of all states shown: figure and sentence."""
    fig = figure(
        "force_distribution", None, "normal force fₙ, in mean forces", "P(fₙ)", height=300,
        y_axis_type="log",
    )  # fmt: skip
    layers = [(worded(replay, "as packed"), replay.normal[0], ORIGINAL)]
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
