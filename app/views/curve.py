"""η(μ) over the stored walks of one series; a tap on a point selects its μ."""

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, FixedTicker, Range1d, TapTool

from .style import SERIES, hover, plot, quiet_legend

MEASURES = (("eta1", "η1", "circle"), ("eta2", "η2", "square"), ("eta3", "0.15 η3", "triangle"))


class CurveView:
    """The three measures against μ, on a logarithmic axis with a place for μ = 0."""

    def __init__(self, state):
        self.state = state
        self.source = ColumnDataSource(name="curve")
        self.here = ColumnDataSource({"at": []}, name="here")
        self.figure = self._figure()
        self.source.selected.on_change("indices", self._tapped)
        state.param.watch(self._update, ["catalogue", "series"])
        state.param.watch(self._mark, ["mu"])
        self._update()

    def panel(self):
        """The plot."""
        return pn.pane.Bokeh(self.figure, sizing_mode="stretch_width", margin=0)

    def _update(self, *events):
        rows = self.state.library.table(self.state.cells())
        mu = np.array([row["mu"] for row in rows], dtype=float)
        self.source.data = {
            "mu": mu,
            "at": _places(mu),
            "eta1": [row["eta1"] for row in rows],
            "eta2": [row["eta2"] for row in rows],
            "eta3": [0.15 * row["eta3"] for row in rows],
            "z": [row["coordination"] for row in rows],
            "h": [row["dimension"] for row in rows],
        }
        places = self.source.data["at"]
        if len(places):
            largest = max(max(self.source.data[name]) for name, _, _ in MEASURES)
            self.figure.y_range.update(start=0, end=1.3 * max(largest, 1e-6))
            self.figure.x_range.update(start=places.min() - 0.4, end=places.max() + 0.4)
            self.figure.xaxis.ticker = FixedTicker(ticks=_ticks(places, mu))
            self.figure.xaxis.major_label_overrides = _labels(places, mu)
        self._mark()

    def _mark(self, *events):
        data = self.source.data
        at = [a for a, mu in zip(data["at"], data["mu"], strict=True) if mu == self.state.mu]
        self.here.data = {"at": at}

    def _tapped(self, name, old, new):
        if new:
            self.state.choose(mu=float(self.source.data["mu"][new[0]]))
            self.source.selected.indices = []

    def _figure(self):
        fig = plot(
            "Indeterminacy against friction (tap a point to show it)",
            "friction coefficient μ",
            "η",
            x_range=Range1d(-4, 1),
            y_range=Range1d(0, 1),
            height=200,
        )
        fig.vspan(x="at", source=self.here, line_width=10, line_alpha=0.2, line_color="#888888")
        points = []
        for (name, label, marker), colour in zip(MEASURES, SERIES, strict=True):
            fig.line("at", name, source=self.source, color=colour, line_alpha=0.6)
            points.append(
                fig.scatter(
                    "at",
                    name,
                    source=self.source,
                    marker=marker,
                    size=8,
                    color=colour,
                    nonselection_alpha=1,
                    legend_label=label,
                )
            )
        quiet_legend(fig, "top_left")
        rows = ("μ", "@mu"), ("η1", "@eta1{0.000}"), ("η2", "@eta2{0.000}")
        more = ("0.15 η3", "@eta3{0.000}"), ("z", "@z{0.00}"), ("h", "@h")
        fig.add_tools(hover(points[:1], *rows, *more, mode="vline"), TapTool(renderers=points))
        return fig


def _places(mu):
    """log10 μ, and for μ = 0 a place one decade below the smallest other."""
    positive = mu[mu > 0]
    lowest = np.log10(positive.min()) if len(positive) else 0.0
    return np.log10(mu, out=np.full(len(mu), np.floor(lowest) - 1.0), where=mu > 0)


def _ticks(places, mu):
    decades = np.arange(np.ceil(places.min()), np.floor(places.max()) + 1)
    return [float(place) for place in decades]


def _labels(places, mu):
    labels = {tick: f"{10.0**tick:g}" for tick in _ticks(places, mu)}
    if np.any(mu == 0):
        labels[float(places[mu == 0][0])] = "0"
    return {int(tick): text for tick, text in labels.items()}
