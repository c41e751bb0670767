"""How figures look, in either backend: colours, lines, points, frames; and how they are saved."""

from pathlib import Path

import holoviews as hv

from granforce.records import InputError

# Okabe and Ito's palette: told apart by colour-blind eyes.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000", "#999999")
GREY = "#999999"
MARKERS = ("o", "s", "^", "d", "v", "+", "x", "*")
DASHES = {"solid": ("solid", "-"), "dashed": ("dashed", "--"), "dotted": ("dotted", ":")}
FRAME_PIXELS = (300, 260)
FRAME_INCHES = (4.2, 3.5)


def ready(backend):
    """Load a plotting backend of HoloViews without changing which one is current.

    Raises InputError for another backend than "bokeh" and "matplotlib".
    """
    if backend not in ("bokeh", "matplotlib"):
        raise InputError(f"no figures for the backend {backend!r}: take bokeh or matplotlib")
    if backend not in hv.Store.registry:
        current = hv.Store.current_backend if hv.Store.registry else backend
        hv.extension(backend)
        hv.Store.set_current_backend(current)


def line(points, label, colour, backend, dash="solid"):
    """A line through points (x, y)."""
    bokeh, mpl = DASHES[dash]
    width = {"line_width": 1.5, "line_dash": bokeh}
    if backend == "matplotlib":
        width = {"linewidth": 1.2, "linestyle": mpl}
    return hv.Curve(points, label=label).opts(color=colour, backend=backend, **width)


def dots(points, label, colour, backend, marker="o", size=6):
    """Points (x, y)."""
    area = {"size": size} if backend == "bokeh" else {"s": size**2 / 2}
    if backend == "bokeh":
        area["tools"] = ["hover"]
    marks = hv.Scatter(points, label=label)
    return marks.opts(color=colour, marker=_marker(marker, backend), backend=backend, **area)


def bars(points, colour, backend, horizontal=False):
    """Error bars (x, y, below, above)."""
    if backend == "bokeh":
        look = {"line_color": colour, "upper_head": None, "lower_head": None}
    else:
        look = {"edgecolor": colour, "capsize": 0}
    return hv.ErrorBars(points, vdims=["y", "below", "above"], horizontal=horizontal).opts(
        backend=backend, **look
    )


def words(points, backend):
    """Words at points (x, y, text), beside what they name."""
    look = {"text_font_size": "8pt", "text_color": "#555555", "text_align": "left"}
    if backend == "matplotlib":
        look = {"size": 8, "color": "#555555", "horizontalalignment": "left"}
    labels = [(x, y, f" {text}") for x, y, text in points]
    return hv.Labels(labels, ["x", "y"], "text").opts(backend=backend, **look)


def curves(series, backend, logx=False, logy=False):
    """Lines with points and error bars: series of (points, label, colour, dash, marker's number).

    points: (x, y, standard error), as `statistics.means` gives them; those that a logarithmic axis
    cannot show are left out.
    """
    for points, label, colour, dash, k in series:
        shown = [p for p in points if (p[0] > 0 or not logx) and (p[1] > 0 or not logy)]
        yield line([p[:2] for p in shown], label, colour, backend, dash)
        yield dots([p[:2] for p in shown], label, colour, backend, MARKERS[k % len(MARKERS)])
        # On a logarithmic axis a bar may not reach 0.
        reach = [(x, y, min(e, 0.9 * y) if logy else e, e) for x, y, e in shown]
        yield bars([bar for bar in reach if bar[3] > 0], colour, backend)


def frame(elements, backend, *, title, x, y, legend=None, **options):
    """Elements in one frame. legend: its corner, such as "top_right"; options: logx, ylim, …"""
    if backend == "bokeh":
        width, height = FRAME_PIXELS
        options = {"frame_width": width, "frame_height": height, "toolbar": "above"} | options
    else:
        options = {"aspect": "auto", "fontscale": 0.9} | options
    if legend is not None:
        options["legend_position"] = legend
    options = {"title": title, "xlabel": x, "ylabel": y, "padding": 0.05} | options
    # Ranges are each frame's own: by their names HoloViews would share them along a layout.
    elements = [element.opts(axiswise=True, backend=backend) for element in elements]
    return hv.Overlay(elements).opts(
        backend=backend, show_legend=legend is not None, axiswise=True, **options
    )


def equal_scales(box, backend):
    """Options of a frame in which both axes have the same scale: box, its sides."""
    if backend == "matplotlib":
        return {"aspect": "equal"}
    width = FRAME_PIXELS[0]
    return {"frame_width": width, "frame_height": round(width * box[1] / box[0])}


def page(frames, backend, columns=3):
    """Frames beside each other."""
    layout = hv.Layout(list(frames)).cols(columns)
    if backend == "bokeh":
        return layout.opts(shared_axes=False, backend=backend)
    return layout.opts(sublabel_format="", hspace=0.3, vspace=0.35, backend=backend)


def save(figure, path):
    """Write a figure: a page that needs no network (.html), or a picture (.png, .svg).

    Pages are for figures made with the backend "bokeh", pictures with "matplotlib": no browser.
    """
    path = Path(path)
    if path.suffix == ".html":
        ready("bokeh")
        hv.save(figure, path, backend="bokeh", resources="inline")
    elif path.suffix in (".png", ".svg"):
        ready("matplotlib")
        from matplotlib import rc_context  # seconds to load, of use here only

        drawn = hv.render(figure, backend="matplotlib")
        rows, columns = figure.shape if isinstance(figure, hv.Layout) else (1, 1)
        width, height = FRAME_INCHES
        drawn.set_size_inches(columns * width, rows * height)
        # Names in SVG come from a fixed salt, not from chance: the same figure, the same file.
        with rc_context({"svg.hashsalt": "granforce"}):
            metadata = {"Date": None} if path.suffix == ".svg" else None
            drawn.savefig(path, dpi=150, bbox_inches="tight", metadata=metadata)
    else:
        raise InputError(f"figures are saved as .html, .png or .svg, not {path.suffix!r}")


def _marker(marker, backend):
    names = {
        "o": "circle",
        "s": "square",
        "^": "triangle",
        "d": "diamond",
        "v": "inverted_triangle",
    }
    return names.get(marker, marker) if backend == "bokeh" else marker
