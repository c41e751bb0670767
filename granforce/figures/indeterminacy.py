"""Figures 1, 4 and 6: indeterminacy, its distribution, and its correlation with the force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import holoviews as hv
import numpy as np
import pandas as pd

from granforce.figures import style
from granforce.measures import statistics
from granforce.measures.statistics import Table
from granforce.records import InputError, brief, real
from granforce.study.cells import scan_rows
from granforce.study.store import Store
from granforce.types import Floats

_MEASURES = (
    *(("eta1", "η1", 1.0), ("eta2", "η2", 1.0), ("eta3", "0.15 η3", 0.15)),
    ("extent", "width of S", 1.0),
)


def indeterminacy(
    rows: Table | Store,
    *,
    compare: Mapping[str, Table] | None = None,
    outside: Table = (),
    backend: str = "bokeh",
) -> hv.Layout:
    """Figure 1: z, and η1, η2 and 0.15 η3, against μ on logarithmic axes.

    rows: dicts or a pandas table with mu, coordination (z), and any of eta1, eta2, eta3, extent
    (the width of S per free dimension, in ⟨f_n⟩); or the store of a scan. compare: {name: dicts}
    from other sources of the same measures, such as exact η3; missing values are not drawn.
    outside: dicts of walks whose states are outside S, so that their spread is not η: grey crosses.
    """
    style.ready(backend)
    rows = scan_rows(rows) if isinstance(rows, Store) else _checked(rows)
    curves = []
    for k, (name, label, factor) in enumerate(_MEASURES):
        points = statistics.means(rows, name, factor=factor)
        if points:
            curves.append((points, label, style.COLOURS[k], "solid", k))
    compare = {} if compare is None else compare
    if not isinstance(compare, Mapping):
        raise InputError(f"compare must be {{name: rows}}, got {brief(compare)}")
    compare = {source: _checked(others) for source, others in compare.items()}
    outside = _checked(outside)
    for source, dash in zip(compare, ("dashed", "dotted"), strict=False):
        for k, (name, label, factor) in enumerate(_MEASURES):
            points = statistics.means(compare[source], name, factor=factor)
            if points:
                curves.append((points, f"{label}, {source}", style.COLOURS[k], dash, k))
    etas = style.graph(
        *(curves, backend),
        title="Indeterminacy",
        x="μ",
        y="η",
        logx=True,
        logy=True,
        legend=style.legend_position("bottom_right", backend),
        marks=_crosses(outside, backend),
    )
    z = [(statistics.means(rows, "coordination"), "z", style.COLOURS[0], "solid", 0)]
    # A logarithmic axis has no place for μ = 0.
    zero = "".join(f"; z = {y:.3g} at μ = 0" for mu, y, _ in z[0][0] if mu == 0)
    contacts = style.graph(z, backend, title=f"Coordination{zero}", x="μ", y="z", logx=True)
    return style.page([contacts, etas], backend)


def _checked(rows: Any) -> pd.DataFrame:
    """The rows as a pandas table; InputError with what to give for paths and other values."""
    give = 'dicts, a pandas table, or the store of a scan: gf.open_store("scan.zarr")'
    if isinstance(rows, (str, Path)):
        raise InputError(f"rows must be {give}; got {brief(str(rows))}")
    try:
        table = pd.DataFrame(rows if isinstance(rows, pd.DataFrame) else list(rows))
    except (TypeError, ValueError):
        raise InputError(f"rows must be {give}; got {brief(rows)}") from None
    if not all(isinstance(name, str) for name in table):
        raise InputError(f"rows must be {give}")
    for mu in table.get("mu", ()):
        real(mu, "mu")
    return table


def _crosses(rows: Table, backend: str) -> list[Any]:
    """Means of the measures of states outside of S."""
    points = [
        (mu, mean)
        for name, _, factor in _MEASURES
        for mu, mean, _ in statistics.means(rows, name, factor=factor)
        if min(mu, mean) > 0
    ]
    return [style.dots(points, "outside S", style.GREY, backend, "x")] if points else []


# Largest μ of the distributions drawn as small and as intermediate friction.
_SMALL, _MIDDLE = 0.02, 0.3


def extents(
    groups: Mapping[float, Sequence[Floats]],
    *,
    backend: str = "bokeh",
    largest: float = 4.0,
    bins: int = 24,
    unit: Mapping[float, float] | None = None,
) -> hv.Layout:
    """Figure 4: P(ΔF_n) for several μ, linear, and semi-logarithmic by ranges of μ.

    groups: {μ: list of arrays (N_c,) of ΔF_n, one for each packing}. ΔF_n is drawn in units of its
    mean, or of the named unit, such as "⟨f_n⟩", up to `largest` in `bins` bins. Bars are standard
    errors over packings, empty bins interrupt the lines, and tails P(ΔF_n > x) ~ exp(−(λx)^b) are
    fitted beyond the upper quartile.
    """
    style.ready(backend)
    edges = np.linspace(0, largest, bins + 1)
    drawn = {mu: group for mu, group in sorted(groups.items()) if any(v.any() for v in group)}
    series = {}
    for k, (mu, group) in enumerate(drawn.items()):
        scale = np.concatenate(group).mean() if unit is None else 1.0
        group = [values / scale for values in group if len(values)]
        b = statistics.tail_exponent(np.concatenate(group), 0.75)
        label = f"μ = {mu:g}" + (f", b = {b:.2f}" if np.isfinite(b) else "")
        series[mu] = _density(group, edges), label, style.COLOURS[k % 7], style.MARKERS[k % 5]
    axes = {"x": f"ΔF_n / {unit or '⟨ΔF_n⟩'}", "y": "P(ΔF_n)"}
    # As in the paper's insets.
    ranges = [[mu for mu in series if (mu > _SMALL) + (mu > _MIDDLE) == k] for k in range(3)]
    words: dict[str, Any] = {"title": "Distribution of ΔF_n", "legend": "top_right"}
    frames = [_densities(series, series, False, backend, **words, **axes)]
    for some in ranges:
        if some:
            word = f"μ = {min(some):g} to {max(some):g}" if len(some) > 1 else f"μ = {some[0]:g}"
            top = max(p for mu in some for _, p, _ in series[mu][0])
            room: dict[str, Any] = {
                "legend": "top_right",
                "ylim": (None, 20 * top),
            }  # above falling curves
            room["title"] = f"{word}, b beyond upper quartile"
            frames.append(_densities(series, some, True, backend, **room, **axes))
    return style.page(frames, backend, columns=2)


def _density(group: Sequence[Floats], edges: Floats) -> list[tuple[float, float, float]]:
    """Points (x, P, standard error over packings) of the bins up to the last nonempty one."""
    heights = np.array([statistics.density(values, edges) for values in group])
    sizes = np.array([len(values) for values in group])
    mean = sizes @ heights / sizes.sum()
    error = heights.std(axis=0, ddof=1) / np.sqrt(len(group)) if len(group) > 1 else 0 * mean
    last = np.flatnonzero(mean > 0).max(initial=0) + 1
    return list(zip(((edges[1:] + edges[:-1]) / 2)[:last], mean[:last], error[:last], strict=True))


def _densities(
    series: Any, some: Any, logy: bool, backend: str, *, x: str, y: str, **options: Any
) -> hv.Overlay:
    """A frame of the densities at some μ."""
    drawn = []
    for mu in some:
        points, label, colour, marker = series[mu]
        joined = [(at, p if p > 0 or not logy else np.nan) for at, p, _ in points]
        shown = [point for point in points if point[1] > 0]
        drawn.append(style.line(joined, label, colour, backend))
        drawn.append(style.dots([point[:2] for point in shown], label, colour, backend, marker))
        reach = [(at, p, min(e, 0.9 * p) if logy else e, e) for at, p, e in shown if e > 0]
        drawn.append(style.bars(reach, colour, backend))
    return style.frame(drawn, backend, x=x, y=y, logy=logy, **options)


def correlations(
    rows: Table,
    *,
    compare: Mapping[str, Table] | None = None,
    chance: Mapping[float, float] | None = None,
    walk: str = "walk",
    backend: str = "bokeh",
) -> hv.Overlay:
    """Figure 6: corr(f_n, ΔF_n) against μ with the paper's error bars.

    rows: dicts with mu, correlation, correlation_low and correlation_high (the least and largest
    with any other sampled network in place of the original); means over rows of one μ. compare:
    {name: rows} with mu and correlation. chance: {μ: the largest |mean| that shuffled forces in as
    many packings give by chance}, dotted. walk: name of the rows in the legend.
    """
    style.ready(backend)
    middle, low, high = (
        {mu: values.mean() for mu, values in statistics.grouped(rows, name).items() if mu > 0}
        for name in ("correlation", "correlation_low", "correlation_high")
    )
    reach = [(mu, middle[mu], middle[mu] - low[mu], high[mu] - middle[mu]) for mu in middle]
    drawn = [style.bars(reach, style.COLOURS[0], backend)]
    sources = {walk: rows, **(compare or {})}
    for k, (label, dash) in enumerate(zip(sources, style.DASHES, strict=False)):
        points = [p[:2] for p in statistics.means(sources[label], "correlation") if p[0] > 0]
        drawn.append(style.line(points, label, style.COLOURS[k], backend, dash))
        drawn.append(style.dots(points, label, style.COLOURS[k], backend, style.MARKERS[k]))
    if chance:
        for side in (-1, 1):
            level = [(mu, side * chance[mu]) for mu in sorted(chance) if mu > 0]
            drawn.append(style.line(level, "chance", style.GREY, backend, "dotted"))
    return style.frame(
        drawn,
        backend,
        title="Force and its indeterminacy",
        x="μ",
        y="corr(f_n, ΔF_n)",
        logx=True,
        legend=style.legend_position("top_right", backend),
    )
