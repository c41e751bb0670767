"""Colours and small helpers shared by the plots."""

from typing import Any

from bokeh.models import CustomJS, HoverTool, Title, WheelZoomTool
from bokeh.palettes import interp_palette
from bokeh.plotting import figure as Figure

# Blue and orange are distinguishable with every common colour-vision deficiency; the middle is
# grey, not white, so that contacts without friction are visible on pale disks, by day and by night.
BLUE, GREY, ORANGE = "#1464c8", "#747880", "#e8710a"
# By day and by night: chains at μ = 0, where mobilisation is undefined.
NEUTRAL = "#4a5563", "#aab4c2"
# Cividis, which looks the same with every common colour-vision deficiency, without the end that
# would not contrast with the background, by day and by night.
EXTENT = (
    ("#16407a", "#3c5a80", "#5f6f7d", "#7f8478", "#a39a6c", "#c6b159", "#e3c53f"),
    ("#2f62a6", "#4c6a94", "#66768a", "#858a7e", "#a9a070", "#cdb85e", "#fee838"),
)
STATES = "#3d8bd4"  # small dots, visible by day and by night
EDGE = "#8fa1b5"
SERIES = ("#0072b2", "#d55e00", "#009e73")  # Okabe and Ito
PALE, DARK, DOT, ORIGINAL = "#a9cdee", "#2b74b8", "#b5236b", "#e69f00"
LOST = "#dd6fa5"  # of an interval, by held forces

# The page's font, which canvases do not inherit.
FONT = 'Inter, Roboto, "Helvetica Neue", sans-serif'

# A notice about Ctrl that Bokeh shows whenever the wheel scrolls the page past a plot.
NOTICE = ".bk-Panel { display: none; }"

# As many columns of a legend as fit: about 6.6 px a letter, and the mark.
FITTING = """
const letters = legend.items.map(({ label }) => label.value.length)
const columns = Math.floor(cb_obj.inner_width / (30 + 6.6 * Math.max(...letters)))
legend.ncols = Math.max(1, Math.min(most, columns))
"""
COLOURS = 33


def ramp(*stops: str) -> list[str]:
    """Colours "#rrggbb" interpolated linearly between the stops."""
    return list(interp_palette(stops, COLOURS))


def palettes(dark: bool) -> dict[str, Any]:
    """Colours of the packing: of the chains by the quantity shown, and of everything else."""
    diverging = ramp(BLUE, GREY, ORANGE)
    body, line = ((150, 172, 200), 0.5) if dark else ((139, 160, 187), 0.75)
    # Of carrying disks, loose ones, and the periodic images of both.
    fills = (0.34, 0.12, 0.16, 0.06) if dark else (0.42, 0.14, 0.2, 0.07)
    disks = [
        {"fill": _faded(body, part), "line": _faded(body, line * part / 0.42)} for part in fills
    ]
    return {
        "mobilised": diverging,
        "extent": ramp(*EXTENT[dark]),
        "load": ramp(*EXTENT[dark]),
        "known": ramp(*EXTENT[dark]),
        "change": diverging,
        "deviation": diverging,
        "neutral": NEUTRAL[dark],
        "plots": {
            **{"seen": DARK, "original": ORIGINAL, "now": DOT, "states": STATES, "dots": now(dark)},
            **dict(zip(("eta1", "eta2", "eta3"), SERIES, strict=True)),
        },
        "scene": {
            "disks": disks,
            "edge": EDGE,
            "strong": "#ffffff" if dark else "#101720",
            "selected": "#ff5ca8" if dark else DOT,
            "slides": "#5ba3ff" if dark else BLUE,
            "known": "#4dd0b5" if dark else "#00695c",
            **dict(zip(("across", "up"), lines(dark), strict=True)),
            "halo": "rgba(20, 24, 30, 0.8)" if dark else "rgba(255, 255, 255, 0.85)",
        },
    }


def lines(dark: bool) -> tuple[str, str]:
    """Colours of the two contacts whose forces are the axes of force space: across, and up."""
    return ("#4ecb8d", "#c39bff") if dark else ("#12793f", "#7a3fc4")


def text(dark: bool) -> str:
    """Colour of text in plots, for the page's theme."""
    return "#ffffff" if dark else "rgba(0, 0, 0, 0.87)"


def now(dark: bool) -> str:
    """Colour of the small dots of the network on screen, drawn over bars."""
    return "#ffffff" if dark else "#12324f"


def _faded(colour: tuple[int, ...], part: float) -> str:
    return f"rgba({', '.join(map(str, colour))}, {min(1.0, part):.3f})"


def plot(title: str | None, x: str, y: str, **options: Any) -> Figure:
    """A figure that fills its width, with a toolbar beside its frame that appears on hover.

    The wheel zooms with Ctrl pressed, and otherwise scrolls the page.
    """
    settled = {
        "tools": "pan,box_zoom,reset",
        "toolbar_location": "right",
        "sizing_mode": "stretch_width",
        "min_border_left": 56,
        "min_border_right": 0,
        "styles": {"flex-shrink": "0"},  # in a low window texts would cover it
        "stylesheets": [NOTICE],
    }
    fig = Figure(title=title, x_axis_label=x, y_axis_label=y, **settled | options)
    if fig.toolbar.tools:
        fig.add_tools(WheelZoomTool(modifiers={"ctrl": True}))
    fig.toolbar.logo = None
    fig.toolbar.autohide = True
    if title:
        fig.title.update(text_font=FONT, text_font_size="13px")
    for axis in fig.axis:
        axis.update(
            axis_label_text_font=FONT, axis_label_text_font_style="normal",
            axis_label_text_font_size="13px", major_label_text_font=FONT,
            major_label_text_font_size="12px", axis_line_color=EDGE, major_tick_line_color=EDGE,
            minor_tick_line_color=None, axis_label_standoff=4,
        )  # fmt: skip
    fig.grid.grid_line_alpha = 0.4
    fig.outline_line_color = None
    return fig


def hover(renderers: list[Any], *rows: tuple[str, str], **options: Any) -> HoverTool:
    """Show these (label, field) rows when hovering over the renderers."""
    # At the mouse: if it snapped to a bar, Bokeh 3.9 would fail because bars have no sides.
    policy = {"point_policy": "follow_mouse"}
    return HoverTool(renderers=renderers, tooltips=list(rows), **policy, **options)


def corner(fig: Figure, word: str) -> Title:
    """Label a plot's upper right corner as exact, seen or measured values."""
    look = {"text_font_size": "11px", "text_font_style": "italic", "text_color": "#808080"}
    title = Title(text=word, align="right", **look)
    fig.add_layout(title, "above")
    return title


def legend_above(fig: Figure, columns: int = 4) -> None:
    """A small legend above the plot, where no curve crosses it; columns: at most."""
    legend = fig.legend[0]
    fig.center.remove(legend)
    legend.update(
        orientation="horizontal", ncols=columns, location="left", label_text_font=FONT,
        label_text_font_size="12px",
        border_line_alpha=0, background_fill_alpha=0, padding=0, margin=2, spacing=8,
        glyph_width=16, glyph_height=14, label_height=14, label_standoff=3,
    )  # fmt: skip
    fig.add_layout(legend, "above")
    # Outside the plot Bokeh draws a legend's marks only once, possibly before there are data.
    fig.js_on_change(
        "inner_width", CustomJS(args={"legend": legend, "most": columns}, code=FITTING)
    )
    refresh = CustomJS(args={"legend": legend}, code="setTimeout(() => legend.change.emit(), 50)")
    for source in {renderer.data_source for item in legend.items for renderer in item.renderers}:
        source.js_on_change("data", refresh)
