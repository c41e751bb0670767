"""Limit loads of all contacts against their forces as packed."""

from collections.abc import Callable

import numpy as np
from bokeh.models import ColumnDataSource, TapTool

from ....results.replays import Replay
from ....state.perturbations import Loads
from ....widgets.hints import term
from ....widgets.parts import figure
from ....widgets.plot_style import DARK, DOT, hover

ASKED = (
    f"<b>How hard can each contact be pushed?</b> The {term('limit_load', 'limit load')}: the "
    "largest pair of opposite forces on its two disks for which a balanced network exists."
)
HELD = " Held forces are ignored here: all admissible networks count."


class LimitLoads:
    """One dot per contact; a click selects it."""

    def __init__(self, replay: Replay, loads: Loads, choose: Callable[[int], object]) -> None:
        self.normal, self.loads = replay.normal[0], loads
        self.chosen = ColumnDataSource({"x": [], "y": []})
        self.figure = fig = figure(
            "limit_loads", None, "normal force fₙ as packed, in mean forces",
            "limit load, in mean forces", height=340,
        )  # fmt: skip
        source = ColumnDataSource({"x": self.normal, "y": loads.load, "contact": replay.backbone})
        points = fig.scatter(
            "x", "y", source=source, size=4.5, color=DARK, alpha=0.75, nonselection_alpha=0.75
        )
        fig.scatter(
            "x", "y", source=self.chosen, size=13, fill_alpha=0, line_color=DOT, line_width=2
        )
        rows = ("contact", "@contact"), ("fₙ", "@x{0.000}"), ("limit load", "@y{0.000}")
        fig.add_tools(hover([points], *rows), TapTool(renderers=[points]))

        def tapped(name: str, old: object, new: list[int]) -> None:
            if new:
                choose(int(new[0]))

        source.selected.on_change("indices", tapped)

    def mark(self, contact: int | None) -> None:
        """Draw a ring around this contact."""
        here = [] if contact is None else [contact]
        self.chosen.data = {"x": self.normal[here], "y": self.loads.load[here]}

    def sentence(self) -> str:
        """The loads that contacts bear, as HTML."""
        median, most = np.percentile(self.loads.load, [50, 90])
        return (
            f"<b>Half of the contacts withstand a push of {median:.2f} mean forces, one in ten "
            f"more than {most:.2f}.</b> Each dot is one contact: click it to select it in the "
            "packing."
        )

    def computed(self) -> str:
        """How the loads were computed."""
        return (
            f"One linear program for each of {len(self.loads.load)} contacts, certified to "
            f"{self.loads.gap:.0e} of the mean force, in {self.loads.seconds:.1f} s."
        )
