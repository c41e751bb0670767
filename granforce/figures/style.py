"""The style of figures in either backend: colours, lines, points, frames; and how to save them."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from html import escape
from pathlib import Path
from typing import Any, TypeVar

import holoviews as hv
from holoviews.plotting.util import process_cmap

from granforce.records import InputError, with_article
from granforce.system.files import path_text, written
from granforce.types import Floats

# Okabe and Ito's palette, distinguishable with colour-vision deficiency.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000", "#999999")
GREY = "#999999"
MARKERS = ("o", "s", "^", "d", "v", "+", "x", "*")
# Points of a line: x, y and, with bars, the size of the error.
Points = Sequence[Any] | Floats
T = TypeVar("T")

DASHES = {"solid": ("solid", "-"), "dashed": ("dashed", "--"), "dotted": ("dotted", ":")}
FRAME_PIXELS = (300, 260)
FRAME_INCHES = (4.2, 3.5)
BAR = 0.03  # width of a colour bar, and its distance from the frame, in widths of the figure

# Symbols as written here: as mathtext for pictures, in Unicode for web pages.
SYMBOLS = {
    "ΔF_n": (r"\Delta F_n", "ΔFₙ"),
    "F_crit": (r"F_\mathrm{crit}", "Fᶜʳⁱᵗ"),
    "f_n,orig": (r"f_{n,\mathrm{orig}}", "fₙ,orig"),
    "f_n": ("f_n", "fₙ"),
    "f_t": ("f_t", "fₜ"),
    "r_max": (r"r_\mathrm{max}", "rₘₐₓ"),
    "r^−α": (r"r^{-\alpha}", "r⁻ᵅ"),
    "|u|": ("|u|", "|u|"),
    "Δt": (r"\Delta t", "Δt"),
    "η1": (r"\eta_1", "η₁"),
    "η2": (r"\eta_2", "η₂"),
    "η3": (r"\eta_3", "η₃"),
    "η": (r"\eta", "η"),
    "μ": (r"\mu", "μ"),
    "α": (r"\alpha", "α"),
    "P(": ("P(", "P("),
}
# Single letters are symbols too if followed by a value, a unit or nothing; units are not.
_SYMBOL = re.compile("|".join(map(re.escape, SYMBOLS)) + r"|(?<!/ )\b[a-zA-Z]\b(?= =|$| /)")


def typeset(text: str, backend: str) -> str:
    """A text with its symbols in mathematical type; symbols already in it stay unchanged."""
    if "$" in text:
        return text

    def symbol(match: re.Match[str]) -> str:
        written = match.group()
        maths, plain = SYMBOLS.get(written, (written, written))
        return f"${maths}$" if backend == "matplotlib" else plain

    return _SYMBOL.sub(symbol, text)


def ready(backend: str) -> None:
    """Load a plotting backend of HoloViews without changing the current one.

    Raises InputError for a backend other than "bokeh" and "matplotlib".
    """
    if backend not in ("bokeh", "matplotlib"):
        raise InputError(f"unknown backend {backend!r}; choose bokeh or matplotlib")
    if backend not in hv.Store.registry:
        current = hv.Store.current_backend if hv.Store.registry else backend
        hv.extension(backend)
        hv.Store.set_current_backend(current)


def line(points: Points, label: str, colour: str, backend: str, dash: str = "solid") -> hv.Curve:
    """A line through points (x, y)."""
    bokeh, mpl = DASHES[dash]
    width = {"line_width": 1.5, "line_dash": bokeh}
    if backend == "matplotlib":
        width = {"linewidth": 1.2, "linestyle": mpl}
    return hv.Curve(points, label=label).opts(color=colour, backend=backend, **width)


def dots(
    points: Points, label: str, colour: str, backend: str, marker: str = "o", size: float = 6
) -> hv.Points:
    """Points (x, y)."""
    area: dict[str, Any] = {"size": size} if backend == "bokeh" else {"s": size**2 / 2}
    if backend == "bokeh":
        area["tools"] = ["hover"]
    marks = hv.Scatter(points, label=label)
    return marks.opts(color=colour, marker=_marker(marker, backend), backend=backend, **area)


def bars(points: Points, colour: str, backend: str, horizontal: bool = False) -> hv.ErrorBars:
    """Error bars (x, y, below, above)."""
    if backend == "bokeh":
        look = {"line_color": colour, "upper_head": None, "lower_head": None}
    else:
        look = {"edgecolor": colour, "capsize": 0}
    return hv.ErrorBars(points, vdims=["y", "below", "above"], horizontal=horizontal).opts(
        backend=backend, **look
    )


def looks(keys: Sequence[Any]) -> dict[Any, tuple[str, str]]:
    """{key: (colour, marker)} for points in order, from dark blue to yellow, all different."""
    names = process_cmap("viridis", len(keys) + 1)
    return {key: (names[k], MARKERS[k % 5]) for k, key in enumerate(keys)}


def curves(
    series: Iterable[Any], backend: str, logx: bool = False, logy: bool = False
) -> Iterator[Any]:
    """Lines with points and error bars: series of (points, label, colour, dash, marker's number).

    points: (x, y, standard error), as returned by `statistics.means`; those that a logarithmic axis
    cannot show are left out.
    """
    for points, label, colour, dash, k in series:
        shown = [p for p in points if (p[0] > 0 or not logx) and (p[1] > 0 or not logy)]
        yield line([p[:2] for p in shown], label, colour, backend, dash)
        yield dots([p[:2] for p in shown], label, colour, backend, MARKERS[k % len(MARKERS)])
        # On a logarithmic axis a bar must not reach 0.
        reach = [(x, y, min(e, 0.9 * y) if logy else e, e) for x, y, e in shown]
        yield bars([bar for bar in reach if bar[3] > 0], colour, backend)


def legend_position(corner: str, backend: str) -> str:
    """Place of a legend that would cover data: next to the frame, or in web pages in this corner.

    A web page has no room next to its frames, but data can be moved out from under the legend.
    """
    return corner if backend == "bokeh" else "right"


def frame(
    elements: Iterable[Any],
    backend: str,
    *,
    title: str,
    x: str,
    y: str,
    legend: str | None = None,
    **options: Any,
) -> hv.Overlay:
    """Elements in one frame. legend: its corner, such as "top_right"; options: logx, ylim, …"""
    elements = list(elements)
    if backend == "bokeh":
        width, height = FRAME_PIXELS
        options = {"frame_width": width, "frame_height": height, "toolbar": "above"} | options
    else:
        options = {"aspect": "auto", "fontscale": 0.9} | options
        options["hooks"] = [_legend_of(elements), _place_colour_bar]
    if legend is not None:
        options["legend_position"] = legend
    options = _ranges_of_one_value(elements, options) | options
    words = {"title": title, "xlabel": x, "ylabel": y}
    words = {name: typeset(text, backend) for name, text in words.items()}
    options = words | {"padding": 0.05} | options
    # Ranges for each frame; by default HoloViews shares them across a layout by axis name.
    elements = [element.opts(axiswise=True, backend=backend) for element in elements]
    drawn = hv.Overlay(elements).opts(
        backend=backend,
        show_legend=legend is not None,
        legend_limit=len(elements) + 1,
        axiswise=True,
        **options,
    )
    return _displayed(drawn, backend)


def _displayed(figure: T, backend: str) -> T:
    """The figure, which notebooks display in this backend, whichever is the current one."""
    figure._repr_mimebundle_ = partial(_display, figure, backend)  # type: ignore[attr-defined]
    return figure


def _display(figure: Any, backend: str, include: Any = None, exclude: Any = None) -> Any:
    current = hv.Store.current_backend
    hv.Store.set_current_backend(backend)
    try:
        return hv.Store.render(figure)
    finally:
        hv.Store.set_current_backend(current)


def _ranges_of_one_value(
    elements: Sequence[Any], options: Mapping[str, Any]
) -> dict[str, tuple[float, float]]:
    """Limits of logarithmic axes with a single value, which HoloViews would pad down to 0."""
    limits = {}
    for k, axis in enumerate("xy"):
        if options.get(f"log{axis}"):
            ends = {end for element in elements if len(element) for end in element.range(k)}
            if len(ends) == 1 and (value := ends.pop()) > 0:
                limits[f"{axis}lim"] = (value / 2, 2 * value)
    return limits


def graph(
    series: Iterable[Any],
    backend: str,
    *,
    logx: bool = False,
    logy: bool = False,
    marks: Iterable[Any] = (),
    **options: Any,
) -> hv.Overlay:
    """The frame of some `curves`, and of marks; options as for `frame`."""
    drawn = [*curves(series, backend, logx, logy), *marks]
    return frame(drawn, backend, logx=logx, logy=logy, **options)


def _legend_of(elements: Sequence[Any]) -> Callable[[Any, Any], None]:
    """A hook that typesets a picture's legend, with the symbols of points on its lines."""
    looks = {
        element.label: element.opts.get("style", backend="matplotlib").kwargs
        for element in elements
        if isinstance(element, hv.Scatter)
    }

    def finish(plot: Any, _: Any) -> None:
        legend = plot.handles["axis"].get_legend()
        if legend is None:
            return
        for text, handle in zip(legend.get_texts(), legend.legend_handles, strict=True):
            look = looks.get(text.get_text())
            if look is not None and hasattr(handle, "set_marker"):
                handle.set_marker(look["marker"])
                handle.set_markersize(max(3, look["s"] ** 0.5))
            text.set_text(typeset(text.get_text(), "matplotlib"))

    return finish


def _place_colour_bar(plot: Any, _: Any) -> None:
    """A hook that keeps a colour bar next to its frame, as high as that is drawn.

    HoloViews places it before the scales of the frame are made equal.
    """
    axis = plot.handles["axis"]

    def place(*_: Any) -> Any:
        axis.apply_aspect()
        drawn = axis.get_position()
        return drawn.from_bounds(drawn.x1 + BAR, drawn.y0, BAR, drawn.height)

    for part in plot.subplots.values():
        if "cax" in part.handles:
            part.handles["cax"].set_axes_locator(place)


def equal_scales(box: Sequence[float] | Floats, backend: str) -> dict[str, Any]:
    """Options of a frame with equal scales on both axes; box: its sides."""
    if backend == "matplotlib":
        return {"aspect": "equal"}
    width = FRAME_PIXELS[0]
    return {"frame_width": width, "frame_height": round(width * box[1] / box[0])}


def page(frames: Sequence[Any], backend: str, columns: int = 3) -> hv.Layout:
    """Frames next to each other."""
    layout = hv.Layout(list(frames)).cols(columns)
    if backend == "bokeh":
        return _displayed(layout.opts(shared_axes=False, backend=backend), backend)
    (width, height), (rows, across) = FRAME_INCHES, layout.shape
    size = {"fig_inches": (across * width, rows * height)}
    layout = layout.opts(sublabel_format="", hspace=0.3, vspace=0.35, backend=backend, **size)
    return _displayed(layout, backend)


def save(figure: Any, path: str | Path, caption: str = "") -> None:
    """Write a figure to a path.

    The suffix selects the format: a self-contained web page (.html), or a picture (.png, .svg,
    .pdf). A figure must have been drawn for the backend that writes the file, "bokeh" for pages and
    "matplotlib" for pictures, or for none; no browser is needed. caption: a description stored in
    the file: the title of a page, the Description of a PNG, <desc> in an SVG, the Subject of a PDF.
    """
    path = Path(path_text(path))
    if not isinstance(figure, hv.core.Dimensioned):
        raise InputError(
            f"save takes a HoloViews figure, not {with_article(type(figure).__name__)}"
        )
    if path.suffix == ".html":
        _check_backend(figure, "bokeh")
        ready("bokeh")
        text = io.StringIO()
        title = caption or path.stem
        hv.save(figure, text, fmt="html", backend="bokeh", resources="inline", title=title)
        content = text.getvalue().encode()
    elif path.suffix in (".png", ".svg", ".pdf"):
        _check_backend(figure, "matplotlib")
        content = _picture(figure, path.suffix.removeprefix("."), caption)
    else:
        raise InputError(f"figures are saved as .html, .png, .svg or .pdf, not {path.suffix!r}")
    with written(path) as file:
        file.write(content)


def _check_backend(figure: hv.core.Dimensioned, needed: str) -> None:
    """InputError if all options of the figure are for the other backend."""
    styled = set(figure.traverse(lambda element: element.id))
    drawn = [
        name for name in hv.Store.registry if styled & set(hv.Store.custom_options(backend=name))
    ]
    if drawn and needed not in drawn:
        raise InputError(
            f"this figure was drawn for {drawn[0]}, but {needed} writes this kind of file; draw it "
            f'with backend="{needed}"'
        )


def rendered(figure: Any) -> Any:
    """A figure for pictures as a Matplotlib figure, large enough for all its frames."""
    ready("matplotlib")
    drawn = hv.render(figure, backend="matplotlib")
    rows, columns = figure.shape if isinstance(figure, hv.Layout) else (1, 1)
    width, height = FRAME_INCHES
    drawn.set_size_inches(columns * width, rows * height)
    return drawn


def _picture(figure: Any, form: str, caption: str) -> bytes:
    """A figure as the bytes of a PNG or an SVG, with its caption."""
    drawn = rendered(figure)
    from matplotlib import rc_context  # takes seconds to load

    described = "Subject" if form == "pdf" else "Description"
    metadata: dict[str, str | None] = {"Title": "granforce", described: caption}
    if form != "png":  # the same figure gives the same file
        metadata["Date" if form == "svg" else "CreationDate"] = None
    file = io.BytesIO()
    # Names in SVG come from a fixed salt instead of random numbers.
    with rc_context({"svg.hashsalt": "granforce"}):
        drawn.savefig(file, format=form, dpi=150, bbox_inches="tight", metadata=metadata)
    content = file.getvalue()
    if form == "svg" and caption:
        description = f"</title>\n <desc>{escape(caption)}</desc>".encode()
        content = content.replace(b"</title>", description, 1)
    return content


def _marker(marker: str, backend: str) -> str:
    names = {
        "o": "circle",
        "s": "square",
        "^": "triangle",
        "d": "diamond",
        "v": "inverted_triangle",
    }
    return names.get(marker, marker) if backend == "bokeh" else marker
