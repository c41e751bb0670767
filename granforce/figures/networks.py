"""Figures 3 and 5: the possible forces of single contacts, and the positions of those contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import holoviews as hv
import numpy as np

from granforce.figures import style
from granforce.records import Packing
from granforce.types import Floats, Integers

SHOWN_CONTACTS = 40
LARGEST = 3.0  # f_n / f_n,orig at which frames are cut off
CIRCLE = np.stack([f(np.linspace(0, 2 * np.pi, 65)) for f in (np.cos, np.sin)], axis=1)
RATIOS = np.linspace(0, LARGEST, 121)  # edges of the bins in which states are counted


def possible_forces(
    groups: Mapping[float, Sequence[Floats]],
    *,
    backend: str = "bokeh",
    largest: float = LARGEST,
    contacts: int = SHOWN_CONTACTS,
) -> hv.Layout:
    """Figure 3: values of f_n / f_n,orig of contacts, weak to strong, for several μ.

    groups: {μ: (original (N_c,), states (S, N_c), least (N_c,), extent (N_c,))}: normal forces of
    the original network and of some states, and the interval seen in all of them, in one unit. The
    given number of contacts (or all, if there are fewer), evenly spaced in order of force, are
    drawn: the interval as a bar, states as points. Frames are cut off at the largest ratio.
    """
    style.ready(backend)
    frames = []
    for k, mu in enumerate(sorted(groups)):
        original, states, least, extent = (np.asarray(values) for values in groups[mu])
        chosen = _weak_to_strong(original)
        chosen = chosen[np.linspace(0, len(chosen) - 1, min(contacts, len(chosen))).astype(int)]
        ratio = states[:, chosen] / original[chosen]
        points = [(a, b) for a, column in enumerate(ratio.T, 1) for b in column if b <= largest]
        colour = style.COLOURS[k % len(style.COLOURS)]
        drawn = [style.dots(points, "networks", colour, backend, size=2)]
        frames.append(_ratios(mu, drawn, original, least, extent, chosen, largest, backend))
    return style.page(frames, backend, columns=2)


def force_densities(
    groups: Mapping[float, Sequence[Floats]], *, backend: str = "bokeh"
) -> hv.Layout:
    """Figure 3 for every contact and any number of states, counted by `ratio_counts`.

    groups: {μ: (original (N_c,), counts (N_c, bins), least (N_c,), extent (N_c,))}. Colours show
    the fraction of states at a ratio, bars the interval seen in all of them.
    """
    style.ready(backend)
    frames = []
    for k, mu in enumerate(sorted(groups)):
        original, counts, least, extent = (np.asarray(values) for values in groups[mu])
        chosen = _weak_to_strong(original)
        part = counts[chosen].T / max(1, counts.sum(axis=1).max(initial=0))
        middles = (RATIOS[1:] + RATIOS[:-1]) / 2
        x = np.arange(1, len(chosen) + 1)
        image = hv.Image((x, middles, np.where(part > 0, part, np.nan)), ["x", "y"], "part")
        look = {"cmap": "viridis_r", "clim": (1e-3, 1), "logz": True}
        look["colorbar"] = k % 2 == 1 or len(groups) == 1  # there is room at the right edge
        drawn = [image.opts(backend=backend, clabel="fraction of the networks", **look)]
        frames.append(_ratios(mu, drawn, original, least, extent, chosen, LARGEST, backend))
    return style.page(frames, backend, columns=2)


def ratio_counts(original: Floats, states: Floats) -> Integers:
    """Number of states with f_n / f_n,orig in each bin of RATIOS: (N_c, bins).

    original (N_c,) and states (S, N_c): f_n. States beyond the last edge and contacts without force
    are not counted.
    """
    counts = np.zeros((len(original), len(RATIOS) - 1), dtype=np.int64)
    for c in np.flatnonzero(original > 0):
        counts[c] = np.histogram(states[:, c] / original[c], RATIOS)[0]
    return counts


def _weak_to_strong(original: Floats) -> Integers:
    """Contacts that carry force, in order of their force."""
    order = np.argsort(original, kind="stable")
    return order[original[order] > 0]


def _ratios(
    mu: float,
    drawn: list[Any],
    original: Floats,
    least: Floats,
    extent: Floats,
    chosen: Integers,
    largest: float,
    backend: str,
) -> hv.Overlay:
    """A frame of elements over the intervals of chosen contacts, with a note on cut-off values."""
    x, scale = np.arange(1, len(chosen) + 1), original[chosen]
    low, high = least[chosen] / scale, (least + extent)[chosen] / scale
    cut = int((high > largest).sum())
    inside = low <= largest
    low, high = low[inside], np.minimum(high[inside], largest)
    bars = list(zip(x[inside], low, np.zeros_like(low), high - low, strict=True))
    drawn = [
        style.bars(bars, style.GREY, backend),
        *drawn,
        style.line([(0, 1), (len(x) + 1, 1)], "original", "#000000", backend, "dashed"),
    ]
    beyond = f"{cut} of {len(chosen)} reach beyond {largest:g}"
    axes = {"x": "contacts, weak to strong", "y": f"f_n / f_n,orig, cut at {largest:g}"}
    title = f"μ = {mu:g}: {beyond}"
    return style.frame(drawn, backend, title=title, ylim=(0, largest), **axes)


def overlaid(
    groups: Mapping[float, tuple[Packing, Integers, Floats, Floats]], *, backend: str = "bokeh"
) -> hv.Layout:
    """Figure 5: the positions of contacts with f_n > 2⟨f_n⟩ (strong), and with ΔF_n > ⟨ΔF_n⟩.

    groups: {μ: (packing, contacts, normal, extent)}: a Packing, positions in its contact list, and
    their f_n and ΔF_n, in any unit; the title counts the contacts.
    """
    style.ready(backend)
    frames = []
    for mu in sorted(groups):
        packing, contacts, normal, extent = groups[mu]
        at, normal, extent = packing.contact_points[contacts], *map(np.asarray, (normal, extent))
        unit = np.average(normal, weights=packing.contacts.length[contacts])
        strong, loose = normal > 2 * unit, extent > extent.mean()
        drawn = [
            style.dots(at, "contacts", style.GREY, backend, size=4),
            style.dots(at[loose], "ΔF_n > ⟨ΔF_n⟩", style.COLOURS[4], backend, "s", size=7),
            style.dots(at[strong], "f_n > 2⟨f_n⟩", style.COLOURS[1], backend, size=5),
        ]
        last = mu == max(groups)
        frames.append(
            style.frame(
                drawn + outline(packing, backend),
                backend,
                title=f"μ = {mu:g}: {strong.sum()} strong, {loose.sum()} with ΔF_n above the mean",
                legend=style.legend_position("top_right", backend) if last else None,
                **_axes(packing, backend),
            )
        )
    return style.page(frames, backend, columns=2)


def bodies(packing: Packing) -> list[Floats]:
    """The outline (k, 2) of each body, closed: its corners, or a circle inside the cell."""
    circles = packing.cell.wrapped(packing.x)[:, None] + packing.r[:, None, None] * CIRCLE
    if packing.shapes is None:
        return list(circles)
    return [
        np.concatenate([corners, corners[:1]]) if len(corners) else circle
        for corners, circle in zip(packing.shapes.polygons(), circles, strict=True)
    ]


def outline(packing: Packing, backend: str) -> list[hv.Curve]:
    """The cell as a list of one curve, or an empty list if the frame's edges show it."""
    if not packing.tilt:
        return []
    return [style.line(packing.cell.corners, "cell", style.GREY, backend, "dashed")]


def _axes(packing: Packing, backend: str) -> dict[str, Any]:
    """Options of a frame that shows the cell with equal scales on both axes."""
    low, high = packing.cell.bounding_box
    limits = {"xlim": (low[0], high[0]), "ylim": (low[1], high[1])}
    words = {"x": "x / r_max", "y": "y / r_max"}
    return words | limits | style.equal_scales(high - low, backend)
