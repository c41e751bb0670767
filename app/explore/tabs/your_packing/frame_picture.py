"""The picture of a photoelastic frame: grains, force chains with errors, marks and scales."""

from typing import Any

import numpy as np
from bokeh.models import ColorBar, ColumnDataSource, LinearColorMapper, Title
from bokeh.plotting import figure as Figure

from ....results.geometry import FULL_DEVIATION
from ....results.photoelastic_frames import Frame
from ....widgets.parts import figure
from ....widgets.plot_style import (
    BLUE,
    EDGE,
    GREY,
    ORANGE,
    SERIES,
    corner,
    hover,
    legend_above,
    ramp,
)

WORDS = {
    "inferred": "inferred; width: fₙ, pale: plus one standard error",
    "measured": "measured; width: fₙ",
    "deviation": "width: inferred fₙ; colour: its difference",
}
STRONG = 0.995  # quantile of f_n at which chains have their largest width
WIDEST = 0.5  # that width, in mean radii
FAINT = 0.01  # fraction of that width below which nothing is drawn
AMBER = "#e69f00"  # suspects: a warning
SCALE = "scale"  # tag of scales
QUIET = "#808080"  # scales, legible by day and by night
SAMPLES = (0.5, 1.0, 2.0)  # ⟨f_n⟩, in the scale of widths
Layers = dict[str, list[Any]]  # {one of WORDS: renderers}
STRIP = 0.08  # height of a line of scales below the grains, in widths of the frame


def network(frame: Frame, **options: Any) -> tuple[Figure, Layers]:
    """Figure of the frame, and {one of WORDS: renderers} of its layers; options: of the figure."""
    name, title = f"frame{frame.report['frame']}", frame.source.split(": ")[-1]
    fig = figure(
        name, f"{title}, frame {frame.report['frame']}",
        "x (unit of the file)", "y (unit of the file)", match_aspect=True, aspect_ratio=0.85,
        sizing_mode="scale_width", **options,
    )  # fmt: skip
    fig.name = "photoelastic_network"
    fig.title.text_font_size = "11px"
    _draw_grains(fig, frame)
    layers: Layers = {name: [] for name in WORDS}
    normal, measured = frame.inferred[:, 0], frame.measured[:, 0]
    strong = max(np.quantile(normal, STRONG), 1e-9)
    wide = WIDEST * frame.r.mean() / strong

    def chains(layer: str, force: Any, chosen: Any, more: Any = 0.0, **options: Any) -> Any:
        width = wide * (np.clip(np.nan_to_num(force), 0.0, strong) + more)
        drawn = fig.rect(
            "x", "y", "length", "width", "angle", line_color=None,
            source=ColumnDataSource(_along(frame, force, width, chosen)), **options,
        )  # fmt: skip
        layers[layer].append(drawn)
        return drawn

    listed, error = ~frame.added, frame.error[:, 0]
    for chosen, colour in ((listed, BLUE), (frame.added, ORANGE)):
        chains("inferred", normal, chosen, error, color=colour, fill_alpha=0.35)
    tips = [
        chains("inferred", normal, listed, color=BLUE, legend_label="listed"),
        chains("inferred", normal, frame.added, color=ORANGE, legend_label="added"),
        chains("measured", measured, listed, color=BLUE),
    ]
    colours = LinearColorMapper(
        palette=ramp(BLUE, GREY, ORANGE), low=-FULL_DEVIATION, high=FULL_DEVIATION
    )
    off = {"field": "off", "transform": colours}
    tips.append(chains("deviation", normal, np.isfinite(measured), color=off))
    rows = ("contact", "@contact"), ("fₙ", "@f{0.00} ± @error{0.00}"), ("off by", "@off{0.0} σ")
    fig.add_tools(hover(tips, *rows))
    _mark(fig, frame)
    _draw_scales(fig, frame, wide)
    legend_above(fig, 3)
    corner(fig, WORDS["inferred"])
    next(one for one in fig.above if isinstance(one, Title)).name = "shown"
    bar = ColorBar(
        color_mapper=colours, height=10, title="inferred minus measured fₙ, in σ",
        title_text_font_style="normal",
    )  # fmt: skip
    fig.add_layout(bar, "below")
    layers["deviation"].append(bar)
    return fig, layers


def dress(fig: Figure, layers: Layers, shown: str, small: bool = False) -> None:
    """Show one of WORDS in a figure of `network`; small: without what the other figure shows."""
    for name, drawn in layers.items():
        for one in drawn:
            one.visible = name == shown
    fig.select_one({"name": "shown"}).text = shown if small else WORDS[shown]
    scales = fig.select({"tags": [SCALE]})
    for one in (fig.title, fig.yaxis[0], fig.legend[0], *scales):
        one.visible = not small
    fig.min_border_left = 5 if small else 56


def _along(frame: Frame, force: Any, width: Any, chosen: Any) -> dict[str, Any]:
    """Columns of the chosen contacts, as rectangles of these widths (N_c,)."""
    visible = chosen & (width > FAINT * WIDEST * frame.r.mean())
    contacts = np.flatnonzero(visible & np.isfinite(frame.lines).all(axis=(1, 2)))
    x, y = frame.lines[contacts].mean(axis=1).T
    along = frame.lines[contacts, 1] - frame.lines[contacts, 0]
    return {
        "x": x, "y": y, "length": np.hypot(*along.T), "angle": np.arctan2(*along.T[::-1]),
        "width": width[contacts], "contact": contacts, "f": np.nan_to_num(force[contacts]),
        "off": np.nan_to_num(frame.deviation[contacts, 0]), "error": frame.error[contacts, 0],
    }  # fmt: skip


def _draw_grains(fig: Figure, frame: Frame) -> None:
    x, y = frame.x.T
    kinds = (
        ("disks", ~(frame.at_wall | frame.left_open), EDGE, 0.18),
        ("at a wall", frame.at_wall, EDGE, 0.5),
        ("left open", frame.left_open, SERIES[1], 0.9),
    )
    for label, chosen, colour, alpha in kinds:
        if chosen.any():
            fig.circle(
                x[chosen], y[chosen], radius=frame.r[chosen], fill_color=colour,
                fill_alpha=alpha, line_color=colour, line_alpha=0.5, legend_label=label,
            )  # fmt: skip


def _mark(fig: Figure, frame: Frame) -> None:
    """Mark suspects, contacts that certainly carry force, and repairs."""
    middle = frame.lines.mean(axis=1)
    for label, places, marker, colour in (
        ("suspect", middle[frame.suspects], "triangle", AMBER),
        ("certain", middle[frame.certain], "circle", SERIES[2]),
        ("mended", frame.repaired, "x", AMBER),
    ):
        if len(places):
            fig.scatter(
                *places.T, marker=marker, size=6, line_color=colour, fill_color=None,
                line_width=1.5, legend_label=label,
            )  # fmt: skip


def _draw_scales(fig: Figure, frame: Frame, wide: float) -> None:
    """The scale of force below the grains, which zooms with the picture."""
    r = frame.r[:, None]
    (left, bottom), (right, _) = (frame.x - r).min(axis=0), (frame.x + r).max(axis=0)
    across = right - left
    before = len(fig.renderers)
    words = {"text_baseline": "middle", "text_font_size": "11px", "text_color": QUIET}
    unit = frame.report["mean_measured_normal_force"]
    at, y = left + across * np.array([0.0, 0.23, 0.46]), bottom - STRIP * across
    fig.rect(
        at + 0.04 * across, np.full(3, y), np.full(3, 0.08 * across), wide * np.array(SAMPLES),
        color=QUIET, name="width_scale",
    )  # fmt: skip
    labels = [f"{force:g}" for force in SAMPLES[:-1]] + [f"{SAMPLES[-1]:g} ⟨mₙ⟩"]
    fig.text(at + 0.1 * across, np.full(3, y), labels, **words)
    y -= STRIP * across
    fig.text([left], [y], [f"⟨mₙ⟩ = {unit:.3g} (unit of the file)"], **words)
    for one in fig.renderers[before:]:
        one.tags = [SCALE]
