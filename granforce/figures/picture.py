"""A packing with one of its force networks, or the mean or spread of many."""

from __future__ import annotations

from typing import Any

import holoviews as hv
import numpy as np
import numpy.typing as npt

from granforce.explore.intervals import Intervals, intervals
from granforce.figures import style
from granforce.figures.networks import CIRCLE, bodies, outline
from granforce.forces.build import ensemble
from granforce.records import (
    InputError,
    Packing,
    are_whole,
    brief,
    float_array,
    real_array,
    takes,
    with_article,
)
from granforce.system.wording import counted
from granforce.tolerances import ADMISSIBLE
from granforce.types import Floats, Integers

COLOURS = ("mobilisation", "force", "spread", "interval")
WIDEST = 4.0  # f_n / ⟨f_n⟩ beyond which lines have constant width
FILL, EDGE = "#eeeeee", "#aaaaaa"  # of disks
MOST_DISKS = 4000  # disks are not drawn in larger packings
_MAPS = {
    "mobilisation": "coolwarm",
    "force": "viridis_r",
    "spread": "magma_r",
    "interval": "magma_r",
}
_WORDS = {
    "mobilisation": "f_t / (μ f_n)",
    "force": "f_n / ⟨f_n⟩",
    "spread": "spread of f_n / ⟨f_n⟩",
    "interval": "interval of f_n / ⟨f_n⟩",
}


@takes(Packing)
def plot(
    packing: Packing,
    states: npt.ArrayLike | Intervals | None = None,
    colour: str | npt.ArrayLike = "mobilisation",
    *,
    contacts: npt.ArrayLike | None = None,
    label: str | None = None,
    numbers: bool = False,
    backend: str = "bokeh",
) -> hv.Overlay:
    """A packing to scale, with contacts as lines of width f_n, coloured with a colour bar.

    Bodies of other shapes are drawn with lines through the contact points, along the forces. Walls
    are drawn as given, or where they are touched.

    Parameters
    ----------
    packing : Packing
        The packing.
    states : (…, k, 2) array or record, optional
        A network, or networks, also of several chains, in the packing's unit of force, or a record
        that has them, such as a Walk; their mean is drawn. By default the packing's own network,
        which Intervals colour by their lengths. Records draw themselves: ``walk.plot(S)``.
    colour : str or (k,) array, default "mobilisation"
        "mobilisation" f_t/(μ f_n), "force", "spread" (standard deviation of f_n over states),
        "interval" (length of the exact interval of f_n, computed here), or numbers.
    contacts : (k,) array of int, optional
        Their numbers in the packing, to leave others out, and needed if there are fewer states
        (`Ensemble.index`).
    label : str, optional
        Quantity and unit of the numbers, for the colour bar; by default the name of a pandas or
        xarray object.
    numbers : bool, default False
        Write its number at each contact.
    backend : {"bokeh", "matplotlib"}
        `figures.save` writes .html with the first, and .pdf, .png, .svg with the second.

    Returns
    -------
    hv.Overlay
        A HoloViews object.

    Raises
    ------
    InputError
        For states that do not match these contacts, and for an unknown colour.
    """
    style.ready(backend)
    count = len(packing.contacts.i)
    shown = np.arange(count) if contacts is None else _numbered(contacts, count)
    bounds = None
    if isinstance(states, Intervals):
        if not isinstance(colour, str) or colour not in ("mobilisation", "interval"):
            raise InputError("Intervals give the colours: leave colour out")
        bounds, states, colour = states, None, "interval"
    drawn = real_array(packing.forces if states is None else _states(states), "states")
    if drawn.shape[-2:] == (count, 2) and len(shown) < count:
        drawn = drawn[..., shown, :]
    if drawn.shape[-2:] != (len(shown), 2):
        raise InputError(
            f"states have shape {drawn.shape}, for {len(shown)} contacts of the packing; give "
            "contacts=S.index with the networks of an ensemble S"
        )
    several = drawn.reshape(-1, len(shown), 2)
    if isinstance(colour, str) and colour == "spread" and len(several) < 2:
        raise InputError('colour="spread" needs several networks: give them as states')
    mean = several.mean(axis=0)
    if isinstance(colour, str) and colour in COLOURS[1:]:
        unit, scale = _unit(packing, mean)
    else:  # only widths need a unit, and none as exact as that of an ensemble, which costs seconds
        unit, scale = mean[:, 0].mean() or 1.0, ""
    values, name, look = _coloured(packing, shown, several, mean, colour, unit, bounds)
    if name and label is not None:
        raise InputError(f"label is for numbers as colour; with {brief(colour)} leave it out")
    label = name or label or str(getattr(colour, "name", None) or "value")
    elements = [*_bodies(packing, backend), *outline(packing, backend)]
    elements += _walls(packing, shown, backend)
    elements.append(_lines(packing, shown, mean / unit, values, label, look, backend))
    if numbers:
        elements.append(_numbers(packing, shown, backend))
    low, high = _window(packing)
    limits: dict[str, Any] = {"xlim": (low[0], high[0]), "ylim": (low[1], high[1])}
    sides = style.equal_scales(high - low, backend)
    count = int((~packing.are_walls).sum())
    kind = ("disk", "disks") if packing.shapes is None else ("body", "bodies")
    title = f"{counted(count, *kind)}, μ = {packing.mu:g}{scale}"
    return style.frame(elements, backend, title=title, x="x", y="y", **limits, **sides)


def _numbered(contacts: npt.ArrayLike, count: int) -> Integers:
    """Numbers (k,) of contacts; InputError for others than 0 … count − 1."""
    numbers = real_array(contacts, "contacts")
    if numbers.ndim != 1 or not are_whole(numbers, count - 1).all():
        raise InputError(
            f"contacts must be a list of numbers from 0 to {count - 1}, such as S.index of an "
            f"ensemble S, got {brief(contacts)}"
        )
    return numbers.astype(np.int64)


def _states(given: Any) -> Any:
    """Networks, also those of a record; InputError for a record without any."""
    fields = getattr(given, "_fields", None)  # of a named tuple
    if fields is None:
        return given
    for name in ("states", "forces"):
        if name in fields:
            return getattr(given, name)
    raise InputError(f"{with_article(type(given).__name__)} has no networks to draw")


def _unit(packing: Packing, mean: Floats) -> tuple[float, str]:
    """⟨f_n⟩ of the packing's ensemble, and its value for the title, if it has one."""
    try:
        unit = ensemble(packing).force_scale
    except InputError:  # forces that do not balance are drawn all the same
        return mean[:, 0].mean() or 1.0, ""
    return unit, f", ⟨f_n⟩ = {unit:.4g}"


def _coloured(
    packing: Packing,
    numbers: npt.NDArray[Any],
    several: Floats,
    mean: Floats,
    colour: str | npt.ArrayLike,
    unit: float,
    bounds: Intervals | None,
) -> tuple[Floats, str, dict[str, Any]]:
    """Numbers (k,) for the colour, their name (empty for given numbers), and the colour scale."""
    if not isinstance(colour, str):
        values = float_array(colour, (len(mean),), "colour")
        return values, "", {"cmap": "viridis_r"}
    if colour not in COLOURS:
        raise InputError(f"colour must be {', '.join(COLOURS)} or numbers, got {brief(colour)}")
    look: dict[str, Any] = {"cmap": _MAPS[colour]}
    if colour == "mobilisation":
        limit = packing.contacts.friction(packing.mu)[numbers] * mean[:, 0]
        values = np.divide(mean[:, 1], limit, np.zeros(len(mean)), where=limit > 0)
        # The colour bar gets an arrow at an end beyond which there are values; rounding is none.
        admitted = np.abs(mean[:, 1]) - limit <= ADMISSIBLE * unit
        values[admitted] = np.clip(values[admitted], -1, 1)
        return values, _WORDS[colour], look | {"clim": (-1, 1)}
    if colour == "interval":
        values = _extents(bounds or intervals(ensemble(packing)), len(packing.contacts.i))[numbers]
    else:
        values = mean[:, 0] if colour == "force" else several[..., 0].std(axis=0)
    return values / unit, _WORDS[colour], look


def _extents(bounds: Intervals, count: int) -> Floats:
    """Lengths (count,) of the exact intervals of f_n, force; 0 where no network presses.

    Infinite ones get the colour of the longest finite one.
    """
    extents = np.zeros(count)
    extents[bounds.contacts] = bounds.high[:, 0] - bounds.low[:, 0]
    return np.minimum(extents, extents.max(where=np.isfinite(extents), initial=0.0))


def _lines(
    packing: Packing,
    numbers: npt.NDArray[Any],
    forces: Floats,
    values: Floats,
    label: str,
    look: dict[str, Any],
    backend: str,
) -> hv.Segments:
    """Pressing contacts (forces > 0) as lines, with every image in the cell."""
    cell, force = packing.cell, forces[:, 0]
    pressing = np.flatnonzero(force > 0)
    begin, end = _ends(packing, numbers[pressing], forces[pressing])
    across = cell.across(begin), cell.across(end)
    rows = []
    width = np.minimum(force[pressing], WIDEST) * (2.5 if backend == "bokeh" else 1.5)
    for moved, visible in cell.images(np.minimum(*across), np.maximum(*across)):
        given = (
            begin[visible] + moved,
            end[visible] + moved,
            values[pressing][visible],
            width[visible],
        )
        rows.append(np.column_stack(given))
    table = np.concatenate(rows) if rows else np.empty((0, 6))
    segments = hv.Segments(
        table, ["x0", "y0", "x1", "y1"], [hv.Dimension("value", label=label), "w"]
    )
    wide = {"line_width" if backend == "bokeh" else "linewidth": "w"}
    return segments.opts(
        backend=backend,
        color="value",
        colorbar=True,
        clabel=style.typeset(label, backend),
        **wide,
        **look,
    )


def _numbers(packing: Packing, numbers: npt.NDArray[Any], backend: str) -> hv.Labels:
    """The numbers of contacts at their points of contact."""
    x, y = packing.contact_points[numbers].T
    size = {"text_font_size": "8pt"} if backend == "bokeh" else {"size": 7}
    return hv.Labels((x, y, numbers.astype(str))).opts(backend=backend, **size)


def _ends(packing: Packing, numbers: npt.NDArray[Any], forces: Floats) -> tuple[Floats, Floats]:
    """Both ends (k, 2) of contact lines: centres or walls, or along the forces of bodies."""
    if packing.shapes is not None:
        begin, branch = packing.through_contacts(numbers, forces)
        return begin, begin + branch
    c = packing.contacts.picked(numbers)
    begin = packing.cell.wrapped(packing.x[c.i])
    reach = np.where(packing.are_walls[c.j], c.arm_i, c.length)
    return begin, begin + reach[:, None] * c.normal


def _bodies(packing: Packing, backend: str) -> list[Any]:
    """Disks, or bodies of other shapes; of those the fixed ones too, darker."""
    disks = np.flatnonzero(~packing.are_walls)
    if len(disks) > MOST_DISKS:
        return []
    if packing.shapes is not None:
        drawn = bodies(packing)
        fixed = np.flatnonzero(packing.are_walls)
        return [
            _polygons([drawn[k] for k in which], backend, colour)
            for which, colour in ((fixed, EDGE), (disks, FILL))
        ]
    x, r, cell = packing.cell.wrapped(packing.x[disks]), packing.r[disks], packing.cell
    at, shapes = cell.across(x), []
    for moved, visible in cell.images(at - r[:, None], at + r[:, None]):
        shapes += [x[k] + moved + r[k] * CIRCLE for k in visible]
    return [_polygons(shapes, backend, FILL)]


def _polygons(shapes: list[Floats], backend: str, fill: str) -> Any:
    # In Matplotlib by `color` too: HoloViews takes Bokeh's default for it where Bokeh came first.
    if backend == "bokeh":
        look = {"fill_color": fill, "line_color": EDGE}
    else:
        look = {"color": fill, "facecolor": fill, "edgecolor": EDGE}
    return hv.Polygons(shapes).opts(backend=backend, **look)


def _walls(packing: Packing, numbers: npt.NDArray[Any], backend: str) -> list[Any]:
    """Walls as given, else short lines along external supports at the points of contact."""
    if len(packing.walls):
        return [hv.Segments(packing.walls, label="wall").opts(backend=backend, color="#000000")]
    c, held = packing.contacts.picked(numbers), packing.are_walls
    touched = np.flatnonzero(held[c.j])
    if packing.shapes is not None or not len(touched):
        return []
    at = packing.contact_points[numbers[touched]]
    along = c.tangent[touched] * packing.r[c.i[touched], None] * 0.7
    walls = hv.Segments(np.column_stack([at - along, at + along]), label="wall")
    return [walls.opts(backend=backend, color="#000000")]


def _window(packing: Packing) -> tuple[Floats, Floats]:
    """Lower left and upper right corners of the picture: the cell, or the disks if it is open."""
    disks = ~packing.are_walls
    x, r = packing.x[disks], packing.r[disks, None]
    margin = 0.1 * packing.r[disks].mean()
    corner, opposite = packing.cell.bounding_box
    closed = np.isfinite(packing.box)
    low = np.where(closed, corner, (x - r).min(axis=0) - margin)
    return low, np.where(closed, opposite, (x + r).max(axis=0) + margin)
