"""Colours and small helpers that the plots share."""

from bokeh.models import HoverTool
from bokeh.plotting import figure

# Blue and orange are told apart with every common colour blindness; the middle is grey, not white,
# so that contacts without friction are seen on pale disks, by day and by night.
BLUE, GREY, ORANGE = "#1464c8", "#747880", "#e8710a"
# By day and by night: chains at μ = 0, where mobilisation means nothing.
NEUTRAL = "#4a5563", "#aab4c2"
# Cividis, which reads the same with every common colour blindness, less the end that would be lost
# on the ground, by day and by night.
EXTENT = (
    ("#16407a", "#3c5a80", "#5f6f7d", "#7f8478", "#a39a6c", "#c6b159", "#e3c53f"),
    ("#2f62a6", "#4c6a94", "#66768a", "#858a7e", "#a9a070", "#cdb85e", "#fee838"),
)
EDGE = "#8fa1b5"
SERIES = ("#0072b2", "#d55e00", "#009e73")  # Okabe and Ito
PALE, DARK, DOT, ORIGINAL = "#a9cdee", "#2b74b8", "#b5236b", "#e69f00"

COLOURS = 33


def ramp(*stops, count=COLOURS):
    """Colours "#rrggbb" along the stops, straight lines in between."""
    pieces = len(stops) - 1
    return [_mix(stops, k * pieces / (count - 1)) for k in range(count)]


def _mix(stops, at):
    k = min(int(at), len(stops) - 2)
    pairs = zip(bytes.fromhex(stops[k][1:]), bytes.fromhex(stops[k + 1][1:]), strict=True)
    return "#" + "".join(f"{round(a + (b - a) * (at - k)):02x}" for a, b in pairs)


def palettes(dark):
    """Colours of the packing: of the chains by what they show, and of everything else in it."""
    diverging = ramp(BLUE, GREY, ORANGE)
    body, line = ((150, 172, 200), 0.5) if dark else ((139, 160, 187), 0.75)
    fills = (0.34, 0.12, 0.16, 0.06) if dark else (0.42, 0.14, 0.2, 0.07)
    disks = [
        {"fill": _faded(body, part), "line": _faded(body, line * part / 0.42)} for part in fills
    ]
    return {
        "mobilised": diverging,
        "extent": ramp(*EXTENT[dark]),
        "change": diverging,
        "sign": [BLUE, GREY, ORANGE],
        "neutral": NEUTRAL[dark],
        "scene": {
            "disks": disks,
            "edge": EDGE,
            "strong": "#ffffff" if dark else "#101720",
            "loose": "#ff5ca8" if dark else DOT,
            "selected": "#ff5ca8" if dark else DOT,
        },
    }


def _faded(colour, part):
    return f"rgba({', '.join(map(str, colour))}, {min(1.0, part):.3f})"


def plot(title, x, y, **options):
    """A figure that fills its width, titled and labelled, with a quiet toolbar."""
    settled = {
        "tools": "pan,wheel_zoom,box_zoom,reset",
        "toolbar_location": "above",
        "sizing_mode": "stretch_width",
        "min_border_left": 56,
        "min_border_right": 18,
    }
    fig = figure(title=title, x_axis_label=x, y_axis_label=y, **settled | options)
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
