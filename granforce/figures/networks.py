"""Figures 3 and 5: the forces that single contacts can have, and where those contacts are."""

import numpy as np

from granforce.figures import style

SHOWN_CONTACTS = 40


def possible_forces(groups, *, backend="bokeh", largest=3.0, contacts=SHOWN_CONTACTS):
    """Figure 3: values of f_n / f_n,orig of contacts, weak to strong, for several μ.

    groups: {μ: (original (N_c,), states (S, N_c), least (N_c,), extent (N_c,))}: normal forces of
    the original network and of some states, and the interval seen in all of them, in one unit.
    So many contacts, evenly spaced in the order of their force, are drawn (all where there are no
    more): the interval as a bar, states as points.
    """
    style.ready(backend)
    frames = []
    for k, mu in enumerate(sorted(groups)):
        original, states, least, extent = (np.asarray(values) for values in groups[mu])
        order = np.argsort(original, kind="stable")
        order = order[original[order] > 0]
        chosen = order[np.linspace(0, len(order) - 1, min(contacts, len(order))).astype(int)]
        scale = original[chosen]
        x = np.arange(1, len(chosen) + 1)
        colour = style.COLOURS[k % len(style.COLOURS)]
        low, high = least[chosen] / scale, (least + extent)[chosen] / scale
        inside = low <= largest
        low, high = low[inside], np.minimum(high[inside], largest)
        bars = list(zip(x[inside], low, np.zeros_like(low), high - low, strict=True))
        ratio = states[:, chosen] / scale
        points = [(a, b) for column, a in zip(ratio.T, x, strict=True) for b in column]
        points = [(a, b) for a, b in points if b <= largest]
        drawn = [
            style.bars(bars, style.GREY, backend),
            style.dots(points, "states", colour, backend, size=2),
            style.line([(0, 1), (len(x) + 1, 1)], "original", style.GREY, backend, "dashed"),
        ]
        axes = {"x": "contacts, weak to strong", "y": "f_n / f_n,orig", "ylim": (0, largest)}
        frames.append(style.frame(drawn, backend, title=f"μ = {mu:g}", **axes))
    return style.page(frames, backend, columns=2)


def places(groups, *, backend="bokeh", part=0.1):
    """Figure 5: where the strongest and the least determined contacts are.

    groups: {μ: (packing, contacts, normal, extent)}: a Packing, positions in its contact list, and
    their f_n and ΔF_n, in any unit. The given part of the contacts is marked, those with largest
    f_n on the left, with largest ΔF_n on the right.
    """
    style.ready(backend)
    frames = []
    for mu in sorted(groups):
        packing, contacts, normal, extent = groups[mu]
        at = contact_points(packing, contacts)
        marks = (("strongest", normal, style.COLOURS[1]), ("least determined", extent, "#0072B2"))
        for word, values, colour in marks:
            count = max(1, round(part * len(at)))
            chosen = np.argsort(-np.asarray(values), kind="stable")[:count]
            drawn = [
                style.dots(at, "contacts", style.GREY, backend, size=2),
                style.dots(at[chosen], word, colour, backend, size=5),
            ]
            frames.append(
                style.frame(
                    drawn + outline(packing, backend),
                    backend,
                    title=f"μ = {mu:g}: {word} {100 * part:g} %",
                    **_axes(packing, backend),
                )
            )
    return style.page(frames, backend, columns=2)


def overlaid(groups, *, backend="bokeh"):
    """Figure 5: where forces are strong, f_n > 2⟨f_n⟩, and where undetermined, ΔF_n > ⟨ΔF_n⟩.

    groups: as for `places`; both are drawn over each other, and the title counts them.
    """
    style.ready(backend)
    frames = []
    for mu in sorted(groups):
        packing, contacts, normal, extent = groups[mu]
        at, normal, extent = contact_points(packing, contacts), *map(np.asarray, (normal, extent))
        strong, loose = normal > 2 * normal.mean(), extent > extent.mean()
        drawn = [
            style.dots(at, "contacts", style.GREY, backend, size=1),
            style.dots(at[loose], "ΔF_n > ⟨ΔF_n⟩", style.COLOURS[4], backend, "s", size=6),
            style.dots(at[strong], "f_n > 2⟨f_n⟩", style.COLOURS[1], backend, size=4),
        ]
        last = mu == max(groups)
        frames.append(
            style.frame(
                drawn + outline(packing, backend),
                backend,
                title=f"μ = {mu:g}: {strong.sum()} strong, {loose.sum()} undetermined",
                legend=style.beside("top_right", backend) if last else None,
                **_axes(packing, backend),
            )
        )
    return style.page(frames, backend, columns=2)


def contact_points(packing, contacts):
    """Points of contact (n, 2), folded into the cell."""
    c = packing.contacts
    at = packing.x[c.i[contacts]] + c.arm_i[contacts, None] * c.normal[contacts]
    return packing.cell.wrapped(at)


def outline(packing, backend):
    """The cell as a list of one line, where the frame's own edges are not it."""
    if not packing.tilt:
        return []
    return [style.line(packing.cell.corners, "cell", style.GREY, backend, "dashed")]


def _axes(packing, backend):
    """Options of a frame that shows the cell, both axes in one scale."""
    low, high = packing.cell.extent
    limits = {"xlim": (low[0], high[0]), "ylim": (low[1], high[1])}
    words = {"x": "x / r_max", "y": "y / r_max"}
    return words | limits | style.equal_scales(high - low, backend)
