"""A figure against friction: lines of the study with error bars, and the packing on screen."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from bokeh.models import ColumnDataSource, FixedTicker, GlyphRenderer
from bokeh.plotting import figure as Figure

from granforce.types import Floats

from ....widgets.parts import figure, on_tap
from ....widgets.plot_style import DOT, SERIES, hover

Points = Sequence[tuple[float, float, float]]  # x, y and standard error

COLOURS = (*SERIES, "#cc79a7", "#56b4e9", "#e69f00")
MARKERS = ("circle", "square", "triangle", "diamond", "inverted_triangle")
DECADES = [1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1, 10]
HERE = "on screen"
HERE_COLUMNS = ("x", "y", "label", "colour", "marker")


class Line(NamedTuple):
    """One quantity of a figure: its label, and its points in the study."""

    label: str
    points: Points
    dash: str = "solid"


class AgainstFriction:
    """Lines of the study against μ; `mark` adds open symbols for the packing on screen."""

    def __init__(self, name: str, label: str, lines: Sequence[Line], **options: Any) -> None:
        """name: of the file to save the figure in; label: of the value axis."""
        fig = figure(name, None, "friction μ", label, x_axis_type="log", **options)
        fig.xaxis.ticker = FixedTicker(ticks=DECADES)
        fig.xaxis.major_label_overrides = {mu: f"{mu:g}" for mu in DECADES}
        fig.xaxis.major_label_overrides |= {1e-5: "10⁻⁵", 1e-4: "10⁻⁴"}
        self.figure = fig
        self.points: list[GlyphRenderer] = []
        self.lines = lines
        self.marks = ColumnDataSource(dict.fromkeys(HERE_COLUMNS, ()), name=f"{name}_marks")
        for k, line in enumerate(lines):
            self._draw(k, line)
        rings = fig.scatter(
            "x", "y", marker="marker", line_color="colour", source=self.marks, size=13,
            fill_alpha=0, line_width=2, legend_label=HERE,
        )  # fmt: skip
        fig.add_tools(hover([rings], (HERE, "μ = @x{0.[00000]}"), ("@label", "@y{0.0000}")))
        self._entry = fig.legend[0].items[-1]
        self._entry.visible = False

    def _draw(self, k: int, line: Line) -> None:
        x, y, error = shown(line.points)
        if not len(x):
            return
        columns = {"x": x, "y": y, "error": error}
        rows = ("μ", "@x{0.[00000]}")
        self.points.append(
            draw_means(self.figure, line.label, columns, k, rows, line_dash=line.dash)
        )

    def mark(self, mu: float = 0.0, *values: float) -> None:
        """Mark a packing: a value for each line, in its look, or a single one; none: no packing."""
        looks = [*zip((line.label for line in self.lines), COLOURS, MARKERS, strict=False)]
        if len(values) < len(self.lines):
            looks = [("value", DOT, "circle")]
        each = [(value, look) for value, look in zip(values, looks, strict=False) if mu > 0]
        rows = [(mu, value, *look) for value, look in each if np.isfinite(value)]
        columns = zip(*rows, strict=True) if rows else ((),) * len(HERE_COLUMNS)
        self.marks.data = dict(zip(HERE_COLUMNS, map(list, columns), strict=True))
        self._entry.visible = len(rows) > 0  # no entry without a mark

    def choosable(self, choose: Callable[[float], object]) -> None:
        """choose(μ): called when a point is clicked."""
        on_tap(self.figure, lambda row, data: choose(float(data["x"][row])), *self.points)


def draw_means(
    fig: Figure, label: str, columns: dict[str, Any], k: int, *rows: tuple[str, str], **options: Any
) -> GlyphRenderer:
    """Points with error bars, joined by a line, in the look of line k; returns the points.

    columns: x, y, error and what the rows of the hint name; options: of the line.
    """
    x, y, error = columns["x"], columns["y"], columns["error"]
    look = {"color": COLOURS[k], "legend_label": label}
    fig.line(x, y, line_width=1.6, **look, **options)
    fig.segment(x, y - error, x, y + error, color=COLOURS[k], line_width=1.4)
    source = ColumnDataSource(columns)
    dots = fig.scatter("x", "y", source=source, size=6, marker=MARKERS[k % len(MARKERS)], **look)
    fig.add_tools(hover([dots], *rows, (label, "@y{0.0000} ± @error{0.0000}")))
    return dots


def shown(points: Points) -> Floats:
    """Columns x, y, error of the points that a logarithmic axis of μ can show."""
    finite = [p for p in points if p[0] > 0 and np.isfinite(p[1])]
    return np.array(finite, dtype=float).reshape(-1, 3).T
