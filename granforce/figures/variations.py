"""Beyond the paper's figures: other sizes, boundaries and frictions, and the centre of S."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import holoviews as hv
import pandas as pd

from granforce.figures import style
from granforce.measures import statistics
from granforce.measures.statistics import Table

_DISTANCES = (("original_ratio", "original"), ("walk_ratio", "nearest-network walk"))
_MEASURES = (("eta1", "η1", 1.0), ("eta2", "η2", 1.0), ("eta3", "0.15 η3", 0.15))


def samplers(groups: Mapping[str, Table], *, backend: str = "bokeh") -> hv.Layout:
    """η1, η2 and 0.15 η3 against μ, one frame each, for states from several samplers.

    groups: {name: rows}, dicts with mu and any of eta1, eta2, eta3.
    """
    sources = [(word, rows, "solid") for word, rows in groups.items()]
    return _frames(sources, backend, _MEASURES, "right", columns=3)


def sizes(rows: Table, *, exact: Table = (), backend: str = "bokeh") -> hv.Layout:
    """η1, η2 and 0.15 η3 against the number of disks, one frame for each μ.

    rows: dicts with n, mu, eta1, eta2, eta3; exact: with n, mu and the eta3 of exact intervals.
    """
    style.ready(backend)
    rows, exact = pd.DataFrame(rows), pd.DataFrame(exact, columns=["n", "mu", "eta3"])
    frames, frictions = [], sorted(rows["mu"].unique())
    for mu in frictions:
        chosen, of_exact = rows[rows["mu"] == mu], exact[exact["mu"] == mu]
        series = [
            (statistics.means(chosen, name, "n", factor), label, style.COLOURS[k], "solid", k)
            for k, (name, label, factor) in enumerate(_MEASURES)
        ]
        if len(of_exact):
            points = statistics.means(of_exact, "eta3", "n", 0.15)
            series.append((points, "0.15 η3, exact", style.COLOURS[2], "dashed", 2))
        words: dict[str, Any] = {"title": f"μ = {mu:g}", "x": "N", "y": "η"}
        legend = "right" if mu == frictions[-1] else None
        frames.append(style.graph(series, backend, **words, logx=True, legend=legend))
    return style.page(frames, backend, columns=2)


def resting(rows: Table, *, backend: str = "bokeh") -> hv.Layout:
    """h and exact η3 against the imbalance of forces below which drag acts, a line for each μ.

    rows: dicts with drag_below, mu, dimension and eta3.
    """
    style.ready(backend)
    table, frames = pd.DataFrame(rows), []
    for name, label, legend in (("dimension", "h", None), ("eta3", "exact η3", "right")):
        series = [
            (
                statistics.means(group, name, "drag_below"),
                f"μ = {mu:g}",
                style.COLOURS[k],
                "solid",
                k,
            )
            for k, (mu, group) in enumerate(table.groupby("mu"))
        ]
        words: dict[str, Any] = {"title": label, "x": "drag below, ⟨f_n⟩", "y": label}
        frames.append(style.graph(series, backend, **words, logx=True, legend=legend))
    return style.page(frames, backend, columns=2)


def opened(rows: Table, packed: Table, *, backend: str = "bokeh") -> hv.Layout:
    """η2 and 0.15 η3 of frictionless packings whose cones are opened to μ.

    rows: dicts with mu (of the cones), eta2, eta3; packed: the same for packings made at that μ.
    """
    sources = (("made at μ = 0", rows, "solid"), ("made at μ", packed, "dashed"))
    names = (("eta2", "η2", 1.0), ("eta3", "0.15 η3", 0.15))
    return _frames(sources, backend, names, "top_left", logy=("eta2", "eta3"))


def distances(rows: Table, *, backend: str = "bokeh") -> hv.Overlay:
    """Distance from the centre of S of original, walk and uniform states, against μ.

    rows: dicts with mu, original_ratio and walk_ratio: mean distances from the mean of uniform
    states, in units of the mean distance of uniform states.
    """
    style.ready(backend)
    series = [
        (statistics.means(rows, name), label, style.COLOURS[k], "solid", k)
        for k, (name, label) in enumerate(_DISTANCES)
    ]
    drawn = list(style.curves(series, backend, logx=True))
    if series[0][0]:
        ends = [(mu, 1.0) for mu, *_ in series[0][0] if mu > 0]
        drawn.append(style.line(ends, "uniform", style.GREY, backend, "dashed"))
    return style.frame(
        drawn,
        backend,
        title="Distance from the centre of S",
        x="μ",
        y="distance / that of uniform networks",
        logx=True,
        legend="top_right",
    )


def stresses(rows: Table, uniform: Table, *, backend: str = "bokeh") -> hv.Layout:
    """Shear stress over pressure against μ: the largest in S and that of the original network.

    A second frame shows those of the original network and of uniform states as fractions of the
    largest in their packing. rows: dicts with mu, seed, friction (the largest) and own_shear (of
    the original network); uniform: with mu, seed, mean_shear and largest_shear of uniform states.
    """
    original, states = (
        _fractions(some, rows, names)
        for some, names in ((rows, ["own_shear"]), (uniform, ["mean_shear", "largest_shear"]))
    )
    style.ready(backend)
    panels = (
        ("Shear stress", "shear stress / pressure", (("friction", rows), ("own_shear", rows))),
        (
            "Fraction of the largest",
            "shear stress / largest",
            (("own_shear", original), ("largest_shear", states), ("mean_shear", states)),
        ),
    )
    words = {
        "friction": "largest, exact",
        "own_shear": "original network",
        "largest_shear": "uniform networks, largest",
        "mean_shear": "uniform networks, mean",
    }
    frames = []
    for title, label, drawn in panels:
        series = [
            (statistics.means(some, name), words[name], style.COLOURS[k], "solid", k)
            for k, name in enumerate(words)
            for shown, some in drawn
            if shown == name and len(some)
        ]
        # In the left frame there is room above the curves at small μ.
        legend = (
            "top_left"
            if title == "Shear stress"
            else style.legend_position("bottom_right", backend)
        )
        axes: dict[str, Any] = {"x": "μ", "y": label, "logx": True, "ylim": (0, None)}
        frames.append(style.graph(series, backend, title=title, legend=legend, **axes))
    return style.page(frames, backend, columns=2)


def _fractions(rows: Table, largest: Table, names: list[str]) -> pd.DataFrame:
    """Numbers of rows over the friction of the largest in the same packing, if it has any."""
    columns = ["mu", "seed"]
    some = pd.DataFrame(rows, columns=[*columns, *names]).astype(float)
    pairs = statistics.paired(some, pd.DataFrame(largest, columns=[*columns, "friction"]))
    pairs = pairs[pairs["friction_other"] != 0]
    return pairs[names].div(pairs["friction_other"], axis="index").assign(mu=pairs["mu"])


def volumes(rows: Table, larger: Table = (), *, backend: str = "bokeh") -> hv.Layout:
    """Width of S per free dimension against μ, and ln V per grain against N.

    rows: dicts with mu, n, extent and log_volume_per_grain; larger: rows for other numbers n.
    """
    style.ready(backend)
    label = "width / ⟨f_n⟩"
    width = [(statistics.means(rows, "extent"), label, style.COLOURS[0], "solid", 0)]
    axes: dict[str, Any] = {"x": "μ", "y": label, "logx": True, "logy": True}
    frames = [style.graph(width, backend, title="Width of S", **axes)]
    larger = pd.DataFrame(larger, columns=["mu", "n", "log_volume_per_grain"])
    of_mu = pd.concat([pd.DataFrame(rows), larger]).groupby("mu")
    series = [
        (
            statistics.means(of_mu.get_group(mu), "log_volume_per_grain", "n"),
            *(f"μ = {mu:g}", style.COLOURS[k], "solid", k),
        )
        for k, mu in enumerate(sorted(larger["mu"].unique()))
    ]
    if series:
        axes = {"x": "N", "y": "ln V / grain", "logx": True, "legend": "right"}
        frames.append(style.graph(series, backend, title="Dependence on N", **axes))
    return style.page(frames, backend, columns=2)


def _frames(
    sources: Sequence[tuple[str, Table, str]],
    backend: str,
    names: Sequence[tuple[str, str, float]],
    legend: str,
    logy: Collection[str] = (),
    columns: int = 2,
) -> hv.Layout:
    """One frame for each name against μ > 0, with all sources: (word, rows, dash).

    logy: names with a logarithmic axis.
    """
    style.ready(backend)
    frames = []
    for last, (name, label, factor) in enumerate(names, 1 - len(names)):
        series = [
            (statistics.means(rows, name, factor=factor), word, style.COLOURS[k], dash, k)
            for k, (word, rows, dash) in enumerate(sources)
        ]
        shown = None if last and legend == "right" else legend  # no room between frames
        axes: dict[str, Any] = {"x": "μ", "y": label, "logx": True, "logy": name in logy}
        frames.append(style.graph(series, backend, title=label, legend=shown, **axes))
    return style.page(frames, backend, columns=columns)
