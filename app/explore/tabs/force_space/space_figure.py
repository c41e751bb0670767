"""The plot of force space: networks as dots, the one on screen, and the outline of S."""

from collections.abc import Callable
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, CustomJS, DataRange1d

from ....results import planes
from ....results.planes import Outlined, Plane
from ....results.replays import Replay
from ....widgets.parts import MOVES, figure, on_tap
from ....widgets.plot_style import DARK, DOT, ORIGINAL, PALE, SERIES, STATES, hover, lines, text

Columns = dict[str, Any]  # of a ColumnDataSource

# Data of a missing outline: Bokeh warns about a plot that starts without any point.
NOWHERE = {"x": [0.0], "y": [0.0]}
# The page's theme would give all axes one colour.
KEEP = "if (cb_obj.tags.length) cb_obj.axis_label_text_color = cb_obj.tags[0]"


class SpaceFigure:
    """A plane of force space; the player moves the state on screen along the path."""

    def __init__(self, tab: str, show: Callable[[int], object]) -> None:
        """tab: of the view; show(row): called when a dot is clicked."""
        none: Columns = {"x": [], "y": []}
        self.path = ColumnDataSource(none | {"state": []}, name="path")
        self.current = ColumnDataSource(none, name="current", tags=["follows", "path", tab])
        self.original, self.beside = ColumnDataSource(none), ColumnDataSource(none)
        self.inner, self.outer = (ColumnDataSource(none, name=n) for n in ("inner", "outer"))
        self.outer.data = NOWHERE
        self.half, self.cone = ColumnDataSource(none), ColumnDataSource(none)
        around = {"range_padding": 0.06, "only_visible": True}
        self.figure = fig = figure(
            "force_space", None, "", "", x_range=DataRange1d(**around),
            y_range=DataRange1d(**around), sizing_mode="scale_width",
        )  # fmt: skip
        fig.name = "path_figure"
        edges = [
            fig.patch(
                "x", "y", source=source, fill_color=PALE, fill_alpha=fill, line_color=DARK,
                line_alpha=line, line_width=wide,
            )
            for source, fill, line, wide in (
                (self.outer, 0.35, 1.0, 1.6), (self.inner, 0.0, 0.4, 1.0),
            )
        ]  # fmt: skip
        fig.patch(
            "x", "y", source=self.half, fill_alpha=0, line_color=DARK, line_dash="dotted",
            line_width=1.4,
        )  # fmt: skip
        fig.line("x", "y", source=self.cone, line_dash="dashed", color="#888888")
        states = fig.scatter("x", "y", source=self.path, size=5, color=STATES, alpha=0.9)
        fig.scatter(
            "x", "y", source=self.beside, marker="triangle", size=5, color=SERIES[2], alpha=0.7
        )
        fig.scatter(
            "x", "y", source=self.original, marker="diamond", size=14, color=ORIGINAL,
            line_color="#333333",
        )  # fmt: skip
        current = fig.scatter(
            "x", "y", source=self.current, size=11, color=DOT, line_color="white", line_width=1.5
        )
        current.tags = MOVES
        # The state on screen moves too often to be included in the range.
        fig.x_range.renderers = fig.y_range.renderers = [*edges, states]
        rows = ("network", "@state"), ("at", "@x{0.000}, @y{0.000}")
        fig.add_tools(hover([states], *rows))
        on_tap(fig, lambda row, data: show(row), states)
        for axis in (*fig.xaxis, *fig.yaxis):
            axis.js_on_change("axis_label_text_color", CustomJS(code=KEEP))

    def clear(self) -> None:
        """Remove everything of another plane."""
        self.path.data = {"x": [], "y": [], "state": []}
        for source in (self.original, self.beside, self.current, self.cone):
            source.data = {"x": [], "y": []}
        self.forget_outline()
        self.outer.data = NOWHERE

    def forget_outline(self) -> None:
        """Remove the outline until the next one arrives."""
        for source in (self.inner, self.outer, self.half):
            source.data = {"x": [], "y": []}

    def show(self, plane: Plane, path: Columns, frame: int) -> None:
        """Networks in a plane, with that of row `frame` on screen; no outline."""
        x, y = plane.path.T
        self.path.data = path
        self.original.data = {"x": x[:1], "y": y[:1]}
        self.current.data = {"x": x[frame : frame + 1].copy(), "y": y[frame : frame + 1].copy()}
        self.forget_outline()
        # Distances are meaningful in principal axes: both then have the same scale.
        self.figure.match_aspect = not plane.components

    def outline(self, outlined: Outlined) -> None:
        """The outline, and the half-way line to its centroid, which is omitted for stresses."""
        parts = [(self.inner, outlined.inner), (self.outer, outlined.outer)]
        if outlined.plane.kind != planes.STRESS:
            parts.append((self.half, planes.halfway(outlined.outer)))
        for source, corners in parts:
            closed = np.concatenate([corners, corners[:1]])
            source.data = {"x": closed[:, 0], "y": closed[:, 1]}

    def draw_cone(self, plane: Plane, mu: float, reach: float) -> None:
        """Coulomb's cone if both axes are forces of one contact, up to f_n = reach."""
        one = len({contact for contact, _ in plane.components}) == 1
        cone = {"x": [reach, 0, reach], "y": [mu * reach, 0, -mu * reach]}
        self.cone.data = cone if one else {"x": [], "y": []}

    def title(self, replay: Replay, plane: Plane, dark: bool) -> None:
        """Labels of the axes, in the colours of the contacts whose forces they are."""
        colours = lines(dark) if plane.pair else (text(dark),) * 2
        axes = self.figure.xaxis[0], self.figure.yaxis[0]
        for axis, words, colour in zip(axes, planes.labels(replay, plane), colours, strict=True):
            axis.update(axis_label=words, tags=[colour], axis_label_text_color=colour)
