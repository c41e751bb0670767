"""Figure of the benchmark: run time against error, size and friction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import holoviews as hv

from granforce.figures import style
from granforce.types import Rows

FEWEST = 3  # points of a curve


def benchmark(results: Mapping[str, Rows], *, backend: str = "bokeh") -> hv.Layout | None:
    """One frame for each part of the results of `granforce.bench.run` that has a figure.

    relaxation: time against μ by solver; scaling: against N; compaction: mean overlap against time;
    intervals: fraction of the exact mean ΔF_n seen by walks against time, per μ; uniform: processor
    time per effective state against h; uniform_growth: against N. Frames whose curves have fewer
    than FEWEST points are left out; None if no frame remains.
    """
    style.ready(backend)
    frames: list[hv.Overlay] = []
    for part, draw in _DRAWN.items():
        if part in results:
            frames += draw(results[part], backend)
    return style.page(frames, backend) if frames else None


def _relaxation(rows: Rows, backend: str) -> Iterator[hv.Overlay]:
    series = _series_by(rows, "solver", "mu", "seconds")
    words = {"title": "One relaxation to 1e-9 ⟨f_n⟩", "x": "μ", "y": "time / s"}
    yield from _frame(series, backend, words, room=50.0, logx=True, logy=True)


def _scaling(rows: Rows, backend: str) -> Iterator[hv.Overlay]:
    series = _series_by([row for row in rows if row["n"] != "fit"], "solver", "n", "seconds")
    words = {"title": f"One relaxation, μ = {rows[0]['mu']:g}", "x": "N", "y": "time / s"}
    yield from _frame(series, backend, words, logx=True, logy=True)


def _compaction(rows: Rows, backend: str) -> Iterator[hv.Overlay]:
    named = [row | {"name": f"Δt = {row['dt']:g}"} for row in rows]
    series = _series_by(named, "name", "seconds", "overlap")
    words = {"title": "Compaction", "x": "time / s", "y": "mean overlap / r_max"}
    yield from _frame(series, backend, words, legend="top_right", logx=True, logy=True)


def _intervals(rows: Rows, backend: str) -> Iterator[hv.Overlay]:
    for mu in sorted({row["mu"] for row in rows}):
        chosen = [row for row in rows if row["mu"] == mu]
        series = _series_by(chosen, "method", "seconds", "extent_part")
        words = {"title": f"Intervals covered by walks, μ = {mu:g}", "x": "time / s"}
        words["y"] = "fraction of the exact ⟨ΔF_n⟩"
        yield from _frame(series, backend, words, legend="bottom_right", logx=True, ylim=(0, 1.1))


def _uniform(rows: Rows, backend: str) -> Iterator[hv.Overlay]:
    series = _series_by(rows, "method", "h", "seconds_per_state")
    words = {"title": "Uniform sampling", "x": "h", "y": "CPU time per effective network / s"}
    yield from _frame(series, backend, words, room=200.0, logx=True, logy=True)


def _uniform_growth(rows: Rows, backend: str) -> Iterator[hv.Overlay]:
    series = _series_by(
        [row for row in rows if row["n"] != "fit"], "rows", "n", "seconds_per_state"
    )
    words = {"title": "Uniform sampling, dependence on N", "x": "N"}
    words["y"] = "CPU time per effective network / s"
    yield from _frame(series, backend, words, room=50.0, logx=True, logy=True)


_DRAWN = {
    "relaxation": _relaxation,
    "scaling": _scaling,
    "compaction": _compaction,
    "intervals": _intervals,
    "uniform": _uniform,
    "uniform_growth": _uniform_growth,
}


def _series_by(rows: Rows, name: str, x: str, y: str) -> dict[Any, list[tuple[float, float]]]:
    """{value of the column `name`: points (x, y)} of the rows that have both."""
    series: dict[Any, list[tuple[float, float]]] = {}
    for row in rows:
        if row.get(x) is not None and row.get(y) is not None:
            series.setdefault(row[name], []).append((row[x], row[y]))
    return series


def _frame(
    series: Mapping[Any, list[tuple[float, float]]],
    backend: str,
    words: dict[str, str],
    *,
    legend: str = "top_left",
    room: float = 1.0,
    **axes: Any,
) -> Iterator[hv.Overlay]:
    """A frame of series, or none; room: factor by which a logarithmic axis exceeds the data."""
    if max(map(len, series.values()), default=0) < FEWEST:
        return
    drawn = []
    y = [point[1] for points in series.values() for point in points]
    if room > 1:
        axes["ylim"] = min(y) / 2, room * max(y)
    x = [point[0] for points in series.values() for point in points]
    # Less than 1.5 decades: ticks of a logarithmic axis would overprint each other.
    axes["logx"] = axes.get("logx", False) and max(x, default=1) >= 30 * min(x, default=1)
    for k, (name, points) in enumerate(series.items()):
        colour = style.COLOURS[k % len(style.COLOURS)]
        drawn.append(style.line(sorted(points), name, colour, backend))
        drawn.append(style.dots(sorted(points), name, colour, backend, style.MARKERS[k % 5]))
    yield style.frame(drawn, backend, legend=legend, **words, **axes)
