"""The first motion of a packing under a local force, drawn on its grains."""

from __future__ import annotations

import holoviews as hv
import numpy as np

from granforce.figures import style
from granforce.figures.networks import outline
from granforce.records import Packing
from granforce.types import Floats

# Length of the arrow of the fastest grain, in mean diameters.
LONGEST_ARROW = 2.0


def displacement(
    packing: Packing, field: Floats, contact: int | None = None, *, backend: str = "bokeh"
) -> hv.Overlay:
    """Displacements of the grains as arrows on the packing.

    field (N, 2): displacements in any unit, NaN for grains without an arrow; the longest arrow is
    LONGEST_ARROW mean diameters long. contact: position of the perturbed contact, which is marked.
    """
    style.ready(backend)
    field = np.asarray(field, float)
    known = np.isfinite(field).all(axis=1)
    size = np.linalg.norm(field[known], axis=1)
    longest = size.max(initial=0.0)
    arrow = LONGEST_ARROW * 2 * packing.r.mean() / (longest or 1.0)
    x = packing.cell.wrapped(packing.x)
    drawn = [
        _disks(x[~known], packing.r[~known], "#eeeeee", backend),
        _disks(x[known], packing.r[known], "#cccccc", backend),
        _arrows(x[known], arrow * field[known], backend),
        *outline(packing, backend),
    ]
    if contact is not None:
        at = packing.contact_points[[contact]]
        drawn.append(style.dots(at, "perturbed contact", style.COLOURS[1], backend, size=8))
    whole = np.isfinite(packing.box).all()
    low, high = packing.cell.extent if whole else (x.min(axis=0), x.max(axis=0))
    limits = {"xlim": (low[0], high[0]), "ylim": (low[1], high[1])}
    shape = {"data_aspect": 1} if backend == "bokeh" else {"aspect": "equal"}
    words = {f"{axis}label": style.typeset(axis, backend) for axis in "xy"}
    return hv.Overlay(drawn).opts(
        title="First motion",
        **words,
        legend_position=style.beside("top_right", backend),
        backend=backend,
        **limits,
        **shape,
    )


def _disks(x: Floats, r: Floats, colour: str, backend: str) -> hv.Path:
    angle = np.linspace(0, 2 * np.pi, 25)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    outlines = [centre + radius * circle for centre, radius in zip(x, r, strict=True)]
    name = "line_color" if backend == "bokeh" else "color"
    return hv.Path(outlines).opts(backend=backend, **{name: colour})


def _arrows(x: Floats, along: Floats, backend: str) -> hv.Overlay:
    colour = style.COLOURS[0]
    lines = [np.array([a, a + d]) for a, d in zip(x, along, strict=True)]
    tips = x + along
    name = "line_color" if backend == "bokeh" else "color"
    size = {"size": 3} if backend == "bokeh" else {"s": 4}
    return hv.Path(lines).opts(backend=backend, **{name: colour}) * hv.Points(tips).opts(
        color=colour, backend=backend, **size
    )
