"""Figure 2: how a packing answers to a local force, against its indeterminacy."""

import numpy as np

from granforce import statistics
from granforce.figures import style


def perturbation(rows, *, backend="bokeh"):
    """Figure 2: ⟨F_crit⟩/⟨f_n⟩ and the decay exponent α against η2, joined in order of μ.

    rows: dicts with mu, eta2, critical_force (mean over contacts, in ⟨f_n⟩) and decay_exponent, one
    for each packing; points are means over packings. Rows may also have limit_load, in ⟨f_n⟩.
    """
    style.ready(backend)
    forces = [("critical_force", "F_crit"), ("limit_load", "limit load")]
    panels = [
        (forces, "Critical force", "⟨F_crit⟩ / ⟨f_n⟩"),
        ([("decay_exponent", "α")], "Decay of displacements", "α of |u| ~ r^−α"),
    ]
    frames = []
    for names, title, label in panels:
        drawn = []
        for k, (name, word) in enumerate(names):
            drawn += _joined(rows, name, word, style.COLOURS[k], k, backend)
        legend = "bottom_right" if len(names) > 1 else None
        frames.append(style.frame(drawn, backend, title=title, x="η2", y=label, legend=legend))
    return style.page(frames, backend, columns=2)


def _joined(rows, name, label, colour, k, backend):
    rows = [row for row in rows if np.isfinite(row.get(name, np.nan))]
    across, up = statistics.means(rows, "eta2"), statistics.means(rows, name)
    if not up:
        return
    points = [(x, y) for (_, x, _), (_, y, _) in zip(across, up, strict=True)]
    yield style.line(points, label, colour, backend)
    yield style.dots(points, label, colour, backend, style.MARKERS[k])
    bars = [(*p, e, e) for p, (_, _, e) in zip(points, up, strict=True)]
    yield style.bars(bars, colour, backend)
    bars = [(*p, e, e) for p, (_, _, e) in zip(points, across, strict=True)]
    yield style.bars(bars, colour, backend, horizontal=True)
    yield style.words([(*p, f"{mu:g}") for p, (mu, _, _) in zip(points, up, strict=True)], backend)
