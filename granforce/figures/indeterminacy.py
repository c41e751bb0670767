"""Figures 1, 4 and 6: indeterminacy, its distribution and its correlation with the force."""

import numpy as np

from granforce import statistics
from granforce.figures import style

_MEASURES = (
    *(("eta1", "η1", 1.0), ("eta2", "η2", 1.0), ("eta3", "0.15 η3", 0.15)),
    ("extent", "width of S", 1.0),
)


def indeterminacy(rows, *, beside=None, backend="bokeh"):
    """Figure 1: η1, η2 and 0.15 η3 against μ, linear and log–log, and z against μ.

    rows: dicts with mu, eta1, eta2, eta3, extent (the width of S per free dimension, in ⟨f_n⟩), of
    which what is there is drawn, and coordination (z). beside: {name: rows} of other
    sources of the same measures, such as exact η3; what a row lacks is not drawn.
    """
    style.ready(backend)
    curves = []
    for k, (name, label, factor) in enumerate(_MEASURES):
        points = statistics.means(rows, name, factor=factor)
        if points:
            curves.append((points, label, style.COLOURS[k], "solid", k))
    for source, dash in zip(beside or {}, ("dashed", "dotted"), strict=False):
        for k, (name, label, factor) in enumerate(_MEASURES):
            points = statistics.means(beside[source], name, factor=factor)
            if points:
                curves.append((points, f"{label}, {source}", style.COLOURS[k], dash, k))
    # Above the curves is room for the inset.
    top = max((y + e for points, *_ in curves for _, y, e in points), default=1.0) or 1.0
    linear = style.frame(
        style.curves(curves, backend),
        backend,
        title="Indeterminacy",
        x="μ",
        y="η",
        ylim=(0, 2.2 * top) if backend == "matplotlib" else (0, 1.1 * top),
        legend=style.beside("top_right", backend),
    )
    log = style.frame(
        style.curves(curves, backend, logx=True, logy=True),
        backend,
        title="the same, log–log",
        x="μ",
        y="η",
        logx=True,
        logy=True,
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
    both = style.inset(linear, log, (0.25, 0.56, 0.72, 0.42), backend)
    # In pictures the legend stands beside the last frame.
    frames = [*both, contacts] if backend == "bokeh" else [contacts, *both]
    return style.page(frames, backend)


def extents(groups, *, backend="bokeh", largest=4.0, bins=24, unit=None):
    """Figure 4: P(ΔF_n) for several μ, linear and semi-logarithmic, with the tail exponents b.

    groups: {μ: list of arrays (N_c,) of ΔF_n, one for each packing}. ΔF_n is drawn in units of its
    mean, or in the unit that it has and that is named, such as "⟨f_n⟩"; tails P(ΔF_n > x) ~
    exp(−(λx)^b) are fitted beyond the median.
    """
    style.ready(backend)
    edges = np.linspace(0, largest, bins + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    linear, log = [], []
    for k, mu in enumerate(sorted(groups)):
        values = np.concatenate(groups[mu])
        if not values.any():
            continue
        if unit is None:
            values = values / values.mean()
        colour, marker = style.COLOURS[k % 8], style.MARKERS[k % 5]
        b = statistics.tail_exponent(values)
        label = f"μ = {mu:g}" + (f", b = {b:.2f}" if np.isfinite(b) else "")
        height = statistics.density(values, edges)
        points = list(zip(middle, height, strict=True))
        linear += [style.line(points, label, colour, backend)]
        linear += [style.dots(points, label, colour, backend, marker)]
        seen = [(x, y) for x, y in points if y > 0]
        log += [style.line(seen, label, colour, backend)]
        log += [style.dots(seen, label, colour, backend, marker)]
    axes = {"x": f"ΔF_n / {unit or '⟨ΔF_n⟩'}", "y": "P(ΔF_n)"}
    legend = style.beside("top_right", backend)
    outer = style.frame(linear, backend, title="Extent", legend=legend, **axes)
    inner = style.frame(log, backend, title="semi-logarithmic", logy=True, **axes)
    both = style.inset(outer, inner, (0.52, 0.5, 0.46, 0.48), backend)
    return style.page(both, backend, columns=2)


def correlations(rows, *, beside=None, chance=None, backend="bokeh"):
    """Figure 6: corr(f_n, ΔF_n) against μ with the paper's error bars.

    rows: dicts with mu, correlation, correlation_low and correlation_high (the least and largest
    with any other sampled network in place of the original); means over rows of one μ. beside:
    {name: rows} with mu and correlation. chance: what shuffled forces reach either way, dotted.
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
    if chance is not None and middle:
        ends = min(middle), max(middle)
        for side in (-chance, chance):
            level = [(mu, side) for mu in ends]
            drawn.append(style.line(level, "chance", style.GREY, backend, "dotted"))
    return style.frame(
        drawn,
        backend,
        title="Force and its indeterminacy",
        x="μ",
        y="corr(f_n, ΔF_n)",
        logx=True,
        legend=style.beside("top_right", backend),
    )
