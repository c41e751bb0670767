"""A photoelastic frame: measured against inferred forces, the network, and an honest account."""

import html

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource

from ..photoelastic import account
from .parts import figure, note
from .style import BLUE, EDGE, ORANGE, SERIES, corner, hover, legend_above

COMPONENTS = (("fₙ", BLUE), ("fₜ", ORANGE))
WIDEST = 9.0  # px, of the strongest contacts
STRONG = 0.995  # quantile of f_n from which on they are that wide


def panel(frame):
    """What there is to see of a Frame, from above."""
    wide = {"sizing_mode": "stretch_width", "margin": 0}
    told = "".join(
        f"<p style='margin:5px 0'>{html.escape(line)}</p>" for line in account(frame.report)
    )
    return [
        note(f"<p><b>{html.escape(frame.source)}</b>, frame {frame.report['frame']}</p>{told}"),
        pn.pane.Bokeh(compared(frame), **wide),
        pn.pane.Bokeh(network(frame), **wide),
    ]


def compared(frame):
    """Figure of inferred against measured forces, of the contacts that were measured."""
    fig = figure("photoelastic_forces", None, "measured / ⟨fₙ⟩", "inferred / ⟨fₙ⟩", height=340)
    seen = np.isfinite(frame.measured).all(axis=1)
    drawn, ends = [], [0.0]
    for part, (label, colour) in enumerate(COMPONENTS):
        x, y = frame.measured[seen, part], frame.inferred[seen, part]
        ends += [x.min(), x.max(), y.min(), y.max()]
        source = ColumnDataSource(
            {"x": x, "y": y, "contact": np.flatnonzero(seen)}, name=f"photoelastic_{'nt'[part]}"
        )
        drawn.append(
            fig.scatter(
                "x", "y", source=source, size=4, alpha=0.5, color=colour, legend_label=label
            )
        )
    ends = [min(ends), max(ends)]
    fig.line(ends, ends, color="#888888", line_dash="dashed", legend_label="as measured")
    fig.add_tools(hover(drawn, ("measured", "@x{0.00}"), ("inferred", "@y{0.00}")))
    legend_above(fig)
    corner(fig, "inferred: in balance, within friction")
    return fig


def network(frame):
    """Figure of the inferred network on the grains."""
    fig = figure(
        "photoelastic_network", None, "x as listed", "y as listed", match_aspect=True,
        aspect_ratio=1.0, sizing_mode="scale_width",
    )  # fmt: skip
    x, y = frame.x.T
    kinds = (
        ("grains", ~(frame.at_wall | frame.left_open), EDGE, 0.18),
        ("at a wall", frame.at_wall, EDGE, 0.5),
        ("left open", frame.left_open, SERIES[1], 0.9),
    )
    for label, chosen, colour, alpha in kinds:
        if chosen.any():
            fig.circle(
                x[chosen], y[chosen], radius=frame.r[chosen], fill_color=colour,
                fill_alpha=alpha, line_color=colour, line_alpha=0.5, legend_label=label,
            )  # fmt: skip
    normal = frame.inferred[:, 0]
    width = WIDEST * np.minimum(normal / max(np.quantile(normal, STRONG), 1e-9), 1.0)
    for label, chosen, colour in (
        ("listed contacts", ~frame.added, BLUE),
        ("added contacts", frame.added, ORANGE),
    ):
        here = np.flatnonzero(chosen & (width > 0.1))
        i, j = frame.ends[here].T
        fig.segment(
            x[i], y[i], x[j], y[j], line_width=width[here], color=colour, line_cap="round",
            legend_label=label,
        )  # fmt: skip
    legend_above(fig, 3)
    corner(fig, "inferred; width: fₙ")
    return fig
