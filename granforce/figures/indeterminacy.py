"""Figures 1, 4 and 6: indeterminacy, its distribution and its correlation with the force."""

import numpy as np

from granforce import statistics
from granforce.figures import style

_MEASURES = (("eta1", "η1", 1.0), ("eta2", "η2", 1.0), ("eta3", "0.15 η3", 0.15))


def indeterminacy(rows, *, beside=None, backend="bokeh"):
    """Figure 1: η1, η2 and 0.15 η3 against μ, linear and log–log, and z against μ.

    rows: dicts with mu, eta1, eta2, eta3 and coordination (z). beside: {name: rows} of other
    sources of the same measures, such as exact η3; what a row lacks is not drawn.
    """
    style.ready(backend)
    curves = []
    for k, (name, label, factor) in enumerate(_MEASURES):
        curves.append(
            (statistics.means(rows, name, factor=factor), label, style.COLOURS[k], "solid", k)
        )
    for source, dash in zip(beside or {}, ("dashed", "dotted"), strict=False):
        for k, (name, label, factor) in enumerate(_MEASURES):
            points = statistics.means(beside[source], name, factor=factor)
            if points:
                curves.append((points, f"{label}, {source}", style.COLOURS[k], dash, k))
    linear = style.frame(
        style.curves(curves, backend), backend, title="Indeterminacy", x="μ", y="η"
    )
    log = style.frame(
        style.curves(curves, backend, logx=True, logy=True),
        backend,
        title="the same, log–log",
        x="μ",
        y="η",
        logx=True,
        logy=True,
        legend="bottom_right",
    )
    z = [(statistics.means(rows, "coordination"), "z", style.COLOURS[0], "solid", 0)]
    contacts = style.frame(
        style.curves(z, backend, logx=True),
        backend,
        title="Coordination",
        x="μ",
        y="z",
        logx=True,
    )
    return style.page([linear, log, contacts], backend)


def extents(groups, *, backend="bokeh", largest=4.0, bins=24):
    """Figure 4: P(ΔF_n) for several μ, linear and semi-logarithmic, with the tail exponents b.

    groups: {μ: list of arrays (N_c,) of ΔF_n, one for each packing, in any unit}. ΔF_n is drawn in
    units of its mean; tails P(ΔF_n > x) ~ exp(−(λx)^b) are fitted beyond the median.
    """
    style.ready(backend)
    edges = np.linspace(0, largest, bins + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    linear, log = [], []
    for k, mu in enumerate(sorted(groups)):
        values = np.concatenate(groups[mu])
        if not values.any():
            continue
        values = values / values.mean()
        colour, marker = style.COLOURS[k % 8], style.MARKERS[k % 5]
        label = f"μ = {mu:g}, b = {statistics.tail_exponent(values):.2f}"
        height = statistics.density(values, edges)
        points = list(zip(middle, height, strict=True))
        linear += [style.line(points, label, colour, backend)]
        linear += [style.dots(points, label, colour, backend, marker)]
        seen = [(x, y) for x, y in points if y > 0]
        log += [style.line(seen, label, colour, backend)]
        log += [style.dots(seen, label, colour, backend, marker)]
    axes = {"x": "ΔF_n / ⟨ΔF_n⟩", "y": "P(ΔF_n)"}
    return style.page(
        [
            style.frame(linear, backend, title="Extent", **axes),
            style.frame(
                log, backend, title="semi-logarithmic", logy=True, legend="top_right", **axes
            ),
        ],
        backend,
        columns=2,
    )


def correlations(rows, *, beside=None, backend="bokeh"):
    """Figure 6: corr(f_n, ΔF_n) against μ with the paper's error bars.

    rows: dicts with mu, correlation, correlation_low and correlation_high (the least and largest
    with any other sampled network in place of the original); means over rows of one μ. beside:
    {name: rows} with mu and correlation.
    """
    style.ready(backend)
    middle, low, high = (
        {mu: values.mean() for mu, values in statistics.grouped(rows, name).items() if mu > 0}
        for name in ("correlation", "correlation_low", "correlation_high")
    )
    reach = [(mu, middle[mu], middle[mu] - low[mu], high[mu] - middle[mu]) for mu in middle]
    drawn = [style.bars(reach, style.COLOURS[0], backend)]
    sources = {"walk": rows, **(beside or {})}
    for k, (label, dash) in enumerate(zip(sources, style.DASHES, strict=False)):
        points = [p[:2] for p in statistics.means(sources[label], "correlation") if p[0] > 0]
        drawn.append(style.line(points, label, style.COLOURS[k], backend, dash))
        drawn.append(style.dots(points, label, style.COLOURS[k], backend, style.MARKERS[k]))
    return style.frame(
        drawn,
        backend,
        title="Force and its indeterminacy",
        x="μ",
        y="corr(f_n, ΔF_n)",
        logx=True,
        legend="top_right",
    )
