"""Figure 2: the response of a packing to a local force, against its indeterminacy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import holoviews as hv
import pandas as pd

from granforce.figures import style
from granforce.measures import statistics
from granforce.measures.statistics import Table


def perturbation(rows: Table, *, limit: bool = False, backend: str = "bokeh") -> hv.Layout:
    """Figure 2: ⟨F_crit⟩/⟨f_n⟩ and the decay exponent α against η2, joined in order of μ.

    rows: dicts with mu, eta2, critical_force (mean over contacts, in ⟨f_n⟩) and decay_exponent, one
    for each packing; points are means over packings, with one symbol per μ. limit: also draw the
    mean limit load (limit_load, in ⟨f_n⟩).
    """
    style.ready(backend)
    forces = [("critical_force", "critical force", "solid")]
    title, label = "Critical force", "⟨F_crit⟩ / ⟨f_n⟩"
    if limit:
        title, label = "Critical force (solid), limit load (dashed)", "mean force / ⟨f_n⟩"
        forces.append(("limit_load", "limit load", "dashed"))
    exponents = [("decay_exponent", "in order of μ", "solid")]
    panels = [(forces, title, label), (exponents, "Decay of displacements", "α of |u| ~ r^−α")]
    looks = style.looks(sorted(pd.DataFrame(rows)["mu"].unique()))
    frames = []
    for names, title, label in panels:
        drawn: list[Any] = []
        for name, word, dash in names:
            drawn += _joined(_points(rows, name), word, dash, looks, backend)
        legend = style.legend_position("top_left", backend) if label.startswith("α") else None
        frames.append(style.frame(drawn, backend, title=title, x="η2", y=label, legend=legend))
    return style.page(frames, backend, columns=2)


def _points(rows: Table, name: str) -> list[tuple[float, ...]]:
    """[(μ, η2, value, standard error of η2, standard error of value)], means over packings."""
    rows = pd.DataFrame(rows).dropna(subset=[name])
    across, up = statistics.means(rows, "eta2"), statistics.means(rows, name)
    return [(mu, x, y, dx, dy) for (mu, x, dx), (_, y, dy) in zip(across, up, strict=True)]


def _joined(
    points: Sequence[tuple[float, ...]],
    word: str,
    dash: str,
    looks: Mapping[float, tuple[str, str]],
    backend: str,
) -> Iterator[Any]:
    if not points:
        return
    yield style.line([point[1:3] for point in points], word, style.GREY, backend, dash)
    for mu, x, y, dx, dy in points:
        colour, marker = looks[mu]
        yield style.bars([(x, y, dy, dy)], colour, backend)
        yield style.bars([(x, y, dx, dx)], colour, backend, horizontal=True)
        yield style.dots([(x, y)], f"μ = {mu:g}", colour, backend, marker, size=10)
