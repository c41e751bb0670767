"""Beyond the paper's figures: other sizes, boundaries and frictions, and the centre of S."""

from granforce import statistics
from granforce.figures import style

_MEASURES = (("eta1", "η1", 1.0), ("eta2", "η2", 1.0), ("eta3", "0.15 η3", 0.15))


def sizes(rows, *, backend="bokeh"):
    """η1, η2 and 0.15 η3 against the number of disks, one frame for each μ.

    rows: dicts with n, mu, eta1, eta2, eta3.
    """
    style.ready(backend)
    frames = []
    for mu in sorted({row["mu"] for row in rows}):
        chosen = [row for row in rows if row["mu"] == mu]
        series = [
            (statistics.means(chosen, name, "n", factor), label, style.COLOURS[k], "solid", k)
            for k, (name, label, factor) in enumerate(_MEASURES)
        ]
        frames.append(
            style.frame(
                style.curves(series, backend, logx=True),
                backend,
                title=f"μ = {mu:g}",
                x="N",
                y="η",
                logx=True,
                legend="top_right",
            )
        )
    return style.page(frames, backend, columns=2)


def opened(rows, own, *, backend="bokeh"):
    """η2 and 0.15 η3 of packings made without friction whose cones are opened to μ.

    rows: dicts with mu (of the cones), eta2, eta3; own: the same of packings made with that μ.
    """
    sources = (("made at μ = 0", rows, "solid"), ("made at μ", own, "dashed"))
    names = (("eta2", "η2", 1.0), ("eta3", "0.15 η3", 0.15))
    return _frames(sources, backend, names, "top_left", logy=True)


def frozen(periodic, inner, *, backend="bokeh"):
    """Part of contacts without a unique force, and their clusters, against μ.

    periodic: rows (dicts with mu, undetermined_part, clusters) where only the pressure is
    prescribed; inner: where the forces on all contacts outside an inner part are held.
    """
    sources = (("periodic", periodic, "solid"), ("frozen surroundings", inner, "dashed"))
    names = (("undetermined_part", "undetermined part", 1.0), ("clusters", "clusters", 1.0))
    return _frames(sources, backend, names, "right")


def distances(rows, *, backend="bokeh"):
    """Distance from the centre of S of original, walk and uniform states, against μ.

    rows: dicts with mu, original_ratio and walk_ratio: mean distances from the mean of uniform
    states, in units of the mean distance of uniform states.
    """
    style.ready(backend)
    series = [
        (statistics.means(rows, name), label, style.COLOURS[k], "solid", k)
        for k, (name, label) in enumerate((("original_ratio", "original"), ("walk_ratio", "walk")))
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
        y="distance / that of uniform states",
        logx=True,
        legend="bottom_left",
    )


def _frames(sources, backend, names, legend, logy=False):
    """One frame for each name against μ > 0, with all sources: (word, rows, dash)."""
    style.ready(backend)
    frames = []
    for last, (name, label, factor) in enumerate(names, 1 - len(names)):
        series = [
            (statistics.means(rows, name, factor=factor), word, style.COLOURS[k], dash, k)
            for k, (word, rows, dash) in enumerate(sources)
        ]
        drawn = style.curves(series, backend, logx=True, logy=logy)
        shown = None if last and legend == "right" else legend  # between frames is no room for one
        axes = {"x": "μ", "y": label, "logx": True, "logy": logy}
        frames.append(style.frame(drawn, backend, title=label, legend=shown, **axes))
    return style.page(frames, backend, columns=2)
