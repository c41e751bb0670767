"""Colours and small helpers that the plots share."""

from bokeh.models import HoverTool
from bokeh.plotting import figure

# Blue and orange are told apart with every common colour blindness; the middle is grey, not white,
# so that contacts without friction are seen on pale disks, by day and by night.
BLUE, GREY, ORANGE = (20, 100, 200), (116, 120, 128), (232, 113, 10)
NEUTRAL = "#4a5563"  # of force chains at μ = 0, where mobilisation means nothing
# One half-transparent colour is pale by day and dark by night; rattlers have the same, thinner.
DISK, EDGE = "#8ba0bb", "#8fa1b5"
OPAQUE, FADED, IMAGE = 0.45, 0.14, 0.4  # backbone, rattlers; factor for images
SERIES = ("#0072b2", "#d55e00", "#009e73")  # Okabe and Ito
PALE, DOT, ORIGINAL = "#7fb2e5", "#b5236b", "#e69f00"

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
    settled = {
        "toolbar_location": "above",
        "sizing_mode": "stretch_width",
        "min_border_left": 56,
        "min_border_right": 12,
    }
    fig = figure(
        title=title,
        x_axis_label=x,
        y_axis_label=y,
        tools="pan,wheel_zoom,box_zoom,reset",
        **settled | options,
    )
    fig.toolbar.logo = None
    fig.toolbar.autohide = True
    if title:
        fig.title.text_font_size = "13px"
    fig.axis.axis_label_text_font_style = "normal"
    fig.grid.grid_line_alpha = 0.4
    return fig


def hover(renderers, *rows, **options):
    """Show these (label, field) rows over the renderers."""
    return HoverTool(renderers=renderers, tooltips=list(rows), **options)


def quiet_legend(fig, location):
    """A small horizontal legend without a frame."""
    fig.legend.update(
        location=location,
        orientation="horizontal",
        label_text_font_size="11px",
        border_line_alpha=0,
        background_fill_alpha=0,
        padding=2,
        margin=4,
    )
