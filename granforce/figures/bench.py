"""Figure of the benchmark."""

import holoviews as hv

from granforce.figures import style


def walk_against_exact(rows):
    """Part of the exact mean ΔF_n that walks saw, against their run time; exact bounds beside.

    rows: those of `granforce.bench.intervals`. One panel per μ.
    """
    style.ready("bokeh")
    panels = []
    for mu in sorted({row["mu"] for row in rows}):
        chosen = [row for row in rows if row["mu"] == mu]
        panels.append(hv.Overlay([*_curves(chosen)]).opts(title=f"μ = {mu:g}", **_FRAME))
    return hv.Layout(panels).cols(2).opts(toolbar=None)


_FRAME = {
    "logx": True,
    "padding": 0.1,
    "ylim": (0, 1.1),
    "xlabel": "run time / s",
    "ylabel": "seen part of exact ⟨ΔF_n⟩",
    "legend_position": "right",
    "frame_width": 300,
    "frame_height": 260,
}


def _curves(rows):
    for method in dict.fromkeys(row["method"] for row in rows):
        points = [(r["seconds"], r["extent_part"]) for r in rows if r["method"] == method]
        line = hv.Curve(points, label=method)
        yield line * hv.Scatter(points, label=method).opts(size=8)
