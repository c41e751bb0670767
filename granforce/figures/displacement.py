"""The first motion of a packing under a local force, drawn on its grains."""

from __future__ import annotations

import holoviews as hv
import numpy as np

from granforce.figures import style
from granforce.figures.networks import bodies, outline
from granforce.forces.balance import left_open_in
from granforce.records import InputError, Packing, real_array, whole
from granforce.types import Floats

# Length of the arrow of the fastest grain, in mean diameters.
LONGEST_ARROW = 2.0


def displacement(
    packing: Packing, field: Floats, contact: int | None = None, *, backend: str = "bokeh"
) -> hv.Overlay:
    """Displacements of grains, or of bodies of any shape, as arrows on the packing.

    field (N, 2): displacements in any unit, NaN for grains without an arrow; the longest arrow is
    two mean diameters of free grains long. contact: position of the perturbed contact,
    which is marked.
    """
    style.ready(backend)
    field = real_array(field, "displacements")
    if field.shape != packing.x.shape:
        raise InputError(f"displacements must have shape {packing.x.shape}, got {field.shape}")
    known = np.isfinite(field).all(axis=1)
    size = np.linalg.norm(field[known], axis=1)
    longest = size.max(initial=0.0)
    free = ~left_open_in(packing)
    arrow = LONGEST_ARROW * 2 * packing.r[free].mean() / (longest or 1.0)
    x, outlines = packing.cell.wrapped(packing.x), bodies(packing)
    drawn = [
        _closed([outlines[k] for k in np.flatnonzero(~known)], "#eeeeee", backend),
        _closed([outlines[k] for k in np.flatnonzero(known)], "#cccccc", backend),
        _arrows(x[known], arrow * field[known], backend),
        *outline(packing, backend),
    ]
    if contact is not None:
        last = len(packing.contacts.i) - 1
        at = packing.contact_points[[whole(contact, "the number of a contact", 0, last)]]
        drawn.append(style.dots(at, "perturbed contact", style.COLOURS[1], backend, size=8))
    periodic = np.isfinite(packing.box).all()
    if periodic:
        low, high = packing.cell.bounding_box
    else:
        corners = [*(outlines[k] for k in np.flatnonzero(free)), x[known] + arrow * field[known]]
        low, high = (end(np.concatenate(corners), axis=0) for end in (np.min, np.max))
    limits = {"xlim": (low[0], high[0]), "ylim": (low[1], high[1])}
    shape = {"data_aspect": 1} if backend == "bokeh" else {"aspect": "equal"}
    words = {f"{axis}label": style.typeset(axis, backend) for axis in "xy"}
    return hv.Overlay(drawn).opts(
        title="First motion",
        **words,
        legend_position=style.legend_position("top_right", backend),
        backend=backend,
        **limits,
        **shape,
    )


def _closed(outlines: list[Floats], colour: str, backend: str) -> hv.Path:
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
