"""The display of records in notebooks: a packing as a picture (SVG), others as small tables.

Plain arrays and numbers in, text out: every package may use this; it needs no plotting library.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np

from granforce.cell import Cell
from granforce.glossary import TERMS
from granforce.types import Floats

SIDE = 420  # of the picture, pixels
LINE = 16  # height of a line of text below it, pixels
# In larger packings disks are not outlined, and only this many of the strongest contacts are drawn.
MOST_DRAWN = 20_000
THICKEST = 5.0  # width of a contact that carries WIDE ⟨f_n⟩ or more, in 1/100 of the picture
WIDE = 4.0
WIDTHS = 12  # classes of width; contacts of one width and colour are one path
# Mobilisation f_t/(μ f_n) from −1 to 1 in classes of equal size: blue, grey, orange.
COLOURS = ("#0072b2", "#4d8fb5", "#8a8a8a", "#cf8a4d", "#d55e00")


def table(title: str, lines: Mapping[str, Any]) -> str:
    """A small HTML table: lines {name: value}, numbers rounded to four digits.

    Names that are in the glossary show their meaning on hover.
    """
    rows = "".join(
        f'<tr><td style="text-align:left"{_hint(name)}>{escape(name)}</td>'
        f'<td style="text-align:right">{escape(_text(value))}</td></tr>'
        for name, value in lines.items()
    )
    return f"<table><caption>{escape(title)}</caption>{rows}</table>"


def _hint(name: str) -> str:
    """The glossary's sentence for a name that ends with one of its symbols, as an attribute."""
    for term in TERMS.values():
        if name == term.word or (term.symbol and name.split()[-1] == term.symbol):
            return f' title="{escape(term.sentence)}"'
    return ""


def _text(value: Any) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (float, np.floating)):
        return f"{value:.4g}"
    return str(value)


class Picture(NamedTuple):
    """The contents of a picture of a packing, as arrays."""

    cell: Cell
    x: Floats  # (N, 2) centres, length
    r: Floats  # (N,) radii
    begin: Floats  # (N_c, 2) one end of each line of force
    branch: Floats  # (N_c, 2) from there to the other
    forces: Floats  # (N_c, 2) f_n, f_t
    friction: Floats  # (N_c,) friction coefficients
    mu: float  # the largest
    packing_fraction: float  # NaN in an open box
    grains: int  # whose balance is required: without walls
    polygons: Sequence[Floats]  # (k, 2) corners of each body, empty for a disk; none if all are


def packing_svg(packing: Picture) -> str:
    """A packing to scale: disks, force chains (width f_n, colour f_t/(μ f_n)), and its numbers."""
    low, sides = _window(packing)
    scale = SIDE / max(sides)
    width, height = sides * scale
    x = packing.cell.wrapped(packing.x)

    def place(points: Floats) -> Floats:
        """Centres in pixels from the upper left corner."""
        return (points - low) * [scale, -scale] + [0, height]

    words = _words(packing)
    drawn = [*_disks(packing, place, x, scale), *_chains(packing, place, scale)]
    drawn = _cut(packing, place, drawn)
    text = "".join(
        f'<text x="4" y="{height + LINE * (k + 1):.0f}">{escape(line)}</text>'
        for k, line in enumerate(words)
    )
    full = height + LINE * len(words) + 6
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{full:.0f}" '
        f'viewBox="0 0 {width:.1f} {full:.1f}" font-family="sans-serif" font-size="12">'
        f"<title>{escape(', '.join(words))}</title>"
        f'<rect width="100%" height="100%" fill="#ffffff"/>'
        f'<svg width="{width:.1f}" height="{height:.1f}">{"".join(drawn)}</svg>{text}</svg>'
    )


def _window(packing: Picture) -> tuple[Floats, Floats]:
    """Lower left corner (2,) and sides (2,) of the picture: the cell, or the disks if open."""
    if not len(packing.r):
        return np.zeros(2), np.ones(2)
    radius = _radii(packing)[:, None]
    low = np.min([*(packing.x - radius), *np.concatenate([packing.x, *packing.polygons])], axis=0)
    high = np.max([*(packing.x + radius), *np.concatenate([packing.x, *packing.polygons])], axis=0)
    closed = np.isfinite(packing.cell.box)
    corner, opposite = packing.cell.bounding_box
    low = np.where(closed, corner, low)
    return low, np.where(closed, opposite, high) - low


def _radii(packing: Picture) -> Floats:
    """Radii (N,) of disks, 0 for polygons."""
    radius = packing.r.copy()
    radius[[k for k, corners in enumerate(packing.polygons) if len(corners)]] = 0.0
    return radius


def _cut(packing: Picture, place: Callable[[Floats], Floats], drawn: list[str]) -> list[str]:
    """Draw inside a tilted cell only, and add its sides."""
    if not packing.cell.tilt:
        return drawn
    outline = " ".join(f"{a:.1f},{b:.1f}" for a, b in place(packing.cell.corners[:4]))
    # Named by its shape: pictures in one document that share a name share the shape.
    name = "cell-" + outline.replace(" ", "-").replace(",", "-")
    return [
        f'<clipPath id="{name}"><polygon points="{outline}"/></clipPath>',
        f'<g clip-path="url(#{name})">',
        *drawn,
        f'</g><polygon points="{outline}" fill="none" stroke="#aaaaaa" stroke-dasharray="4 4"/>',
    ]


def _disks(
    packing: Picture, place: Callable[[Floats], Floats], x: Floats, scale: float
) -> Iterator[str]:
    if not len(x) or len(x) > MOST_DRAWN:
        return
    yield '<g fill="#eeeeee" stroke="#aaaaaa" stroke-width="0.5">'
    for corners in packing.polygons:
        outline = " ".join(f"{a:.1f},{b:.1f}" for a, b in place(corners))
        yield f'<polygon points="{outline}"/>' if len(corners) else ""
    # Polygons lie in an open box, and have no circle.
    radius = _radii(packing)
    cell, at = packing.cell, packing.cell.across(x)
    for moved, grains in cell.images(at - radius[:, None], at + radius[:, None]):
        for (a, b), r in zip(place(x[grains] + moved), radius[grains], strict=True):
            if r == 0:
                continue
            yield f'<circle cx="{a:.1f}" cy="{b:.1f}" r="{r * scale:.1f}"/>'
    yield "</g>"


def _chains(packing: Picture, place: Callable[[Floats], Floats], scale: float) -> Iterator[str]:
    """Pressing contacts as lines: one path for each width and colour."""
    normal, tangential = packing.forces.T
    pressing = np.flatnonzero(normal > 0)
    if not len(pressing):
        return
    pressing = pressing[np.argsort(-normal[pressing], kind="stable")][:MOST_DRAWN]
    force = normal[pressing] / normal[pressing].mean()
    width = np.ceil(np.minimum(force / WIDE, 1) * WIDTHS).astype(int)
    friction = packing.friction[pressing] * normal[pressing]
    mobilised = np.divide(tangential[pressing], friction, np.zeros_like(force), where=friction > 0)
    colour = ((np.clip(mobilised, -1, 1) + 1) / 2 * len(COLOURS)).astype(int)
    colour = np.minimum(colour, len(COLOURS) - 1)
    begin = packing.begin[pressing]
    end = begin + packing.branch[pressing]
    paths: dict[tuple[int, int], list[str]] = {}
    cell = packing.cell
    ends = cell.across(begin), cell.across(end)
    for moved, rows in cell.images(np.minimum(*ends), np.maximum(*ends)):
        for k, (a, b), (c, d) in zip(
            rows, place(begin[rows] + moved), place(end[rows] + moved), strict=True
        ):
            path = paths.setdefault((width[k], colour[k]), [])
            path.append(f"M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}")
    thickest = min(THICKEST * SIDE / 100, packing.r.mean() * scale)
    yield '<g fill="none" stroke-linecap="round">'
    for (w, c), path in sorted(paths.items()):
        line = f'stroke="{COLOURS[c]}" stroke-width="{w / WIDTHS * thickest:.2f}"'
        yield f'<path {line} d="{"".join(path)}"/>'
    yield "</g>"


def _words(packing: Picture) -> list[str]:
    """The numbers of a packing in two lines."""
    normal = packing.forces[:, 0]
    pressing = np.count_nonzero(normal > 0)
    kind = "bodies" if packing.polygons else "disks"
    first = [f"{packing.grains} {kind}", f"μ = {packing.mu:g}"]
    if np.isfinite(packing.cell.box).all():
        first.append(f"φ = {packing.packing_fraction:.4f}")
    return [", ".join(first), f"{pressing} of {len(normal)} contacts press"]
