"""The paper's Figures 1, 4 and 6 from the finished study, and sentences from its numbers."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from bokeh.models import DataRange1d
from bokeh.plotting import figure as Figure

from granforce.measures import statistics
from granforce.paper.claims.table import PAPERS_PEAK
from granforce.paper.tables import packings_at_each

from ....results import distributions, study_data
from ....results.distributions import Row
from ....state.view_settings import SAMPLERS
from ....widgets.hints import term
from ....widgets.parts import figure
from ....widgets.plot_style import DOT, legend_above
from ...result_values import with_error
from .against_friction import COLOURS, MARKERS, AgainstFriction, Line, shown

MEASURES = (("eta1", "η₁", 1.0), ("eta2", "η₂", 1.0), ("eta3", "0.15 η₃ seen", 0.15))
# Parts of the study, and their labels.
COMPARED = {part: f"seen: {words}" for part, words in SAMPLERS.items()}
COMPARED |= {"exact": "exact", "sweeps_1e-4": "seen: the paper’s walk, to 10⁻⁴"}
CORRELATED = ("walk", "uniform", "exact")
SHOWN = (0.01, 0.1, 1.0, 10.0)  # frictions of the study whose P(ΔF_n) is drawn
BINS = 30
ROOM = 1.3  # of the largest η
# The room that the inset leaves: part of the axis of μ above it, and part of that of η below it.
ABOVE, BELOW = 0.47, 0.4


class Indeterminacy:
    """Figure 1: η1, η2 and 0.15 η3 against μ, from a part of SAMPLERS, with z in the inset."""

    def __init__(self, sampler: str) -> None:
        self.sampler = sampler
        self.rows = walks = study_data.in_force_space(sampler)
        self.lines = [
            Line(label, statistics.means(walks, name, factor=factor))
            for name, label, factor in MEASURES
        ]
        self.etas = AgainstFriction(
            "indeterminacy", "indeterminacy η", self.lines, height=372, min_border_left=62
        )
        self.etas.figure.y_range = DataRange1d(start=0, end=_top(self.lines))
        self.z = AgainstFriction(
            "coordination", "z", [Line("z", statistics.means(walks, "coordination"))], height=130,
            min_border_left=28, min_border_right=6, tools="", toolbar_location=None,
        )  # fmt: skip
        legend_above(self.etas.figure)
        _small(self.z.figure)

    def mark(self, current: Row) -> None:
        """Mark the packing and the networks on screen."""
        self.etas.mark(current["mu"], *(factor * current[name] for name, _, factor in MEASURES))
        self.z.mark(current["mu"], current["coordination"])

    def sentence(self) -> str:
        """The μ at which each η is largest, and why it falls again, as HTML."""
        walks = self.rows
        if not len(walks):
            return "The finished study is not part of this installation."
        z = statistics.means(walks, "coordination")
        return (
            f"<b>Maxima, {SAMPLERS[self.sampler]}: {_maxima(self.lines)}.</b> Click a point to "
            "open such a packing.<details><summary>Why a maximum?</summary>"
            "Friction widens the range of forces at each contact, but packings made with more "
            f"friction have fewer contacts: z falls from {z[0][1]:.2f} to {z[-1][1]:.2f} (inset). "
            f"{self._in_the_paper()}Points: means over {packings_at_each(walks)} packings of 400 "
            "disks, with standard errors.</details>"
        )

    def _in_the_paper(self) -> str:
        """The μ of the maxima in the paper's Figure 1 and in these walks, or nothing."""
        peaks = study_data.maxima() if self.sampler == "walk" else []
        if not peaks:
            return ""
        ours = [peak["value"] for peak in peaks]
        least, most = min(peak["low"] for peak in peaks), max(peak["high"] for peak in peaks)
        return (
            "In the paper's Figure 1 η also rises and falls, with its maxima near "
            f"μ = {PAPERS_PEAK:g}; parabolas fitted to these points have them at {min(ours):.2f} "
            f"to {max(ours):.2f} (95 %: {least:.2f} to {most:.2f}). "
        )


def _top(lines: Sequence[Line]) -> float:
    """The end of the axis of η: above all points, and those under the inset are below it."""
    points = np.concatenate([shown(line.points).T for line in lines]) if lines else np.empty((0, 3))
    if not len(points):
        return 1.0
    high, place = points[:, 1] + points[:, 2], np.log(points[:, 0])
    left = place <= place.min() + ABOVE * np.ptp(place)
    return float(max(ROOM * high.max(), high[left].max() / BELOW))


def _maxima(lines: Iterable[Line]) -> str:
    """The largest value of each line, with its error and μ; a μ that they share only once."""
    largest = [(line.label, *max(line.points, key=lambda point: point[1])) for line in lines]
    values = [f"{label} {with_error(value, error)}" for label, _, value, error in largest]
    where = [f"at μ = {mu:g}" for _, mu, _, _ in largest]
    if len(set(where)) == 1:
        return f"{', '.join(values)}, {'all ' * (len(where) > 1)}{where[0]}"
    return ", ".join(map(" ".join, zip(values, where, strict=True)))


def samplers(current: Row) -> Figure:
    """0.15 η3 by every sampler and exact, with the packing on screen."""
    lines = [
        Line(
            label,
            statistics.means(study_data.in_force_space(part), "eta3", factor=0.15),
            "dashed" if part == "exact" else "solid",
        )
        for part, label in COMPARED.items()
    ]
    drawn = AgainstFriction("samplers", "0.15 η₃", lines, height=280)
    drawn.mark(current["mu"], 0.15 * current["eta3"])
    legend_above(drawn.figure, 3)
    return drawn.figure


def extents(page_rows: list[Row], mu: float) -> tuple[Figure, str]:
    """Figure 4: P(ΔF_n) for some μ of the study, and of the page's packings at this μ."""
    fig = figure(
        "extents", None, "interval ΔFₙ, seen, in mean forces", "P(ΔFₙ)",
        height=300, y_axis_type="log",
    )  # fmt: skip
    table = study_data.study()
    known = {} if table is None else table.extents("walk")
    curves = [(f"μ = {value:g}", known[value]) for value in SHOWN if value in known]
    current = distributions.groups(page_rows, mu).get(mu)
    every = [group for _, group in curves] + ([current] if current else [])
    largest = max((np.quantile(np.concatenate(group), 0.999) for group in every), default=1.0)
    edges = np.linspace(0, largest, BINS + 1)
    tails = []
    for k, (label, group) in enumerate(curves):
        _density(fig, group, edges, label, COLOURS[k], MARKERS[k], 1.6)
        tails.append(f"{label}: b = {statistics.tail_exponent(np.concatenate(group)):.2f}")
    if current:
        _density(fig, current, edges, f"on this page, μ = {mu:g}", DOT, "circle_x", 2.5)
    if every:
        legend_above(fig)
    means = {label: float(np.mean(np.concatenate(group))) for label, group in curves}
    if not means:
        return fig, ""
    widest = max(means, key=lambda label: means[label])
    text = (
        "<b>How long are the intervals seen?</b> (Figure 4) Longest on average at "
        f"{widest}: {means[widest]:.2f} mean forces; exact intervals are longer. "
        "Beyond the median P falls like exp(−(λx)<sup>b</sup>); "
        f"b = 1 is exponential. {'; '.join(tails)}. Bars: standard errors over packings."
    )
    return fig, text


def _density(
    fig: Figure, group: Sequence[Any], edges: Any, label: str, colour: str, marker: str, wide: float
) -> None:
    """P(ΔF_n), mean and standard error over the packings of a group."""
    heights = np.array([statistics.density(values, edges) for values in group])
    mean = heights.mean(axis=0)
    error = heights.std(axis=0, ddof=1) / np.sqrt(len(group)) if len(group) > 1 else 0 * mean
    x, positive = (edges[1:] + edges[:-1]) / 2, mean > 0
    low = np.maximum(mean - error, 0.3 * mean)
    look = {"color": colour, "legend_label": label}
    fig.line(x, np.where(positive, mean, np.nan), line_width=wide, **look)
    fig.segment(x[positive], low[positive], x[positive], (mean + error)[positive], color=colour)
    fig.scatter(x[positive], mean[positive], size=5, marker=marker, **look)


class Correlations:
    """Figure 6: corr(f_n, ΔF_n) against μ."""

    def __init__(self) -> None:
        self.points = {
            part: statistics.means(study_data.rows(part), "correlation") for part in CORRELATED
        }
        lines = [
            Line(COMPARED[part], points, "dashed" if part == "exact" else "solid")
            for part, points in self.points.items()
        ]
        self.drawn = AgainstFriction("correlation", "corr(fₙ, ΔFₙ)", lines, height=280)
        legend_above(self.drawn.figure, 2)

    def mark(self, current: Row) -> None:
        """Mark the packing on screen."""
        self.drawn.mark(current["mu"], current.get("correlation", np.nan))

    def sentence(self) -> str:
        """The range of the walk's correlation, as HTML; empty without a study."""
        points = self.points["walk"]
        if not points:
            return ""
        values = [value for _, value, _ in points]
        mu, most, error = max(points, key=lambda point: point[1])
        return (
            "<b>Are the strong contacts the undetermined ones?</b> (Figure 6) The "
            f"{term('correlation')} of fₙ as packed with ΔFₙ seen lies between "
            f"{min(values):.3f} and {max(values):.3f} for nearest-network walks; it is largest, "
            f"{with_error(most, error)}, at μ = {mu:g}. 1: the strongest contacts are the least "
            "determined; 0: unrelated."
        )


def _small(fig: Figure) -> None:
    """Give a figure the style of an inset."""
    fig.legend.visible = False
    for axis in fig.axis:
        axis.update(
            major_label_text_font_size="10px", axis_label_text_font_size="11px",
            axis_label_standoff=0,
        )  # fmt: skip
    fig.xaxis.axis_label = None
    fig.background_fill_alpha = fig.border_fill_alpha = 0.8
    fig.xaxis.ticker.ticks = [1e-4, 1e-2, 1]
