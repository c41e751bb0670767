"""Colours and small helpers that the plots share."""

from bokeh.models import HoverTool
from bokeh.plotting import figure

# Blue and orange are told apart with every common colour blindness; the middle is grey, not white,
# so that contacts without friction are seen on pale disks, by day and by night.
BLUE, GREY, ORANGE = (20, 100, 200), (116, 120, 128), (232, 113, 10)
NEUTRAL = "#4a5563"  # of force chains at μ = 0, where mobilisation means nothing
DISK, RATTLER, EDGE = "#b9c6d6", "#e9edf2", "#8fa1b5"
SERIES = ("#0072b2", "#d55e00", "#009e73")  # Okabe and Ito
PALE, DOT = "#9ec3e6", "#12355b"

COLOURS = 255


def diverging():
    """The palette of mobilisation −1 … 1: blue, grey, orange, straight lines in between."""
    half = COLOURS // 2
    down = [_mix(BLUE, GREY, k / half) for k in range(half)]
    up = [_mix(GREY, ORANGE, k / half) for k in range(half + 1)]
    return down + up


def _mix(a, b, part):
    return "#" + "".join(f"{round(p + (q - p) * part):02x}" for p, q in zip(a, b, strict=True))


def plot(title, x, y, **options):
    """A figure that fills its width, titled and labelled, with a quiet toolbar."""
    fig = figure(
        title=title,
        x_axis_label=x,
        y_axis_label=y,
        tools="pan,wheel_zoom,box_zoom,reset",
        sizing_mode="stretch_width",
        **{"toolbar_location": "above", "min_border_right": 12, **options},
    )
    fig.toolbar.logo = None
    fig.toolbar.autohide = True
    fig.title.text_font_size = "13px"
    fig.axis.axis_label_text_font_style = "normal"
    fig.grid.grid_line_alpha = 0.4
    return fig


def hover(renderers, *rows, **options):
    """Show these (label, field) rows over the renderers."""
    return HoverTool(renderers=renderers, tooltips=list(rows), **options)
