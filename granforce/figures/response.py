"""Figure 2: how a packing answers to a local force, against its indeterminacy."""

from itertools import pairwise

import numpy as np

from granforce import statistics
from granforce.figures import style


def perturbation(rows, *, backend="bokeh"):
    """Figure 2: ⟨F_crit⟩/⟨f_n⟩ and the decay exponent α against η2, joined in order of μ.

    rows: dicts with mu, eta2, critical_force (mean over contacts, in ⟨f_n⟩) and decay_exponent, one
    for each packing; points are means over packings. Rows may also have limit_load, in ⟨f_n⟩.
    """
    style.ready(backend)
    forces = [("critical_force", "critical force"), ("limit_load", "limit load")]
    panels = [
        (forces, "Critical force", "⟨F_crit⟩ / ⟨f_n⟩"),
        ([("decay_exponent", "α")], "Decay of displacements", "α of |u| ~ r^−α"),
    ]
    frames = []
    for names, title, label in panels:
        drawn, strokes = [], []
        lines = [_points(rows, name) for name, _ in names]
        for k, ((_, word), points) in enumerate(zip(names, lines, strict=True)):
            drawn += _joined(points, word, style.COLOURS[k], k, backend)
            strokes += _strokes(points)
        # μ is told once.
        drawn += style.words([(x, y, f"{mu:g}") for mu, x, y, *_ in lines[0]], strokes, backend)
        legend = "top_left" if len(names) > 1 else None
        frames.append(style.frame(drawn, backend, title=title, x="η2", y=label, legend=legend))
    return style.page(frames, backend, columns=2)


def _points(rows, name):
    """[(μ, η2, value, standard error of η2, of the value)], means over packings."""
    rows = [row for row in rows if np.isfinite(row.get(name, np.nan))]
    across, up = statistics.means(rows, "eta2"), statistics.means(rows, name)
    return [(mu, x, y, dx, dy) for (mu, x, dx), (_, y, dy) in zip(across, up, strict=True)]


def _strokes(points):
    """Ends (x, y, x, y) of what is drawn: lines from point to point, and error bars."""
    for (_, x, y, *_), (_, x_next, y_next, *_) in pairwise(points):
        yield x, y, x_next, y_next
    for _, x, y, dx, dy in points:
        yield x - dx, y, x + dx, y
        yield x, y - dy, x, y + dy


def _joined(points, label, colour, k, backend):
    if not points:
        return
    places = [point[1:3] for point in points]
    yield style.line(places, label, colour, backend)
    yield style.dots(places, label, colour, backend, style.MARKERS[k])
    yield style.bars([(x, y, dy, dy) for _, x, y, _, dy in points], colour, backend)
    across = [(x, y, dx, dx) for _, x, y, dx, _ in points]
    yield style.bars(across, colour, backend, horizontal=True)
