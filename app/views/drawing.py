"""Figures of granforce.figures as Bokeh figures of the page, drawn in a thread."""

import threading

from bokeh.document import Document

from .parts import savable

# To be held while figures are made: HoloViews keeps its options in one place for all threads.
drawn_here = threading.Lock()


def rendered(frames, names, heights):
    """HoloViews frames as Bokeh figures that fill the width, each with its name and height."""
    import holoviews as hv
    import matplotlib.axes  # noqa: F401  HoloViews loads a part, Panel the rest: on the page's thread

    # In its mode "server" the renderer takes the document given and puts its theme on that one;
    # else it would be the current document, that of whoever is served right now.
    renderer, drawn = hv.renderer("bokeh").instance(mode="server"), []
    for frame, name, height in zip(frames, names, heights, strict=False):
        fig = renderer.get_plot(frame, doc=Document()).state
        fig.update(
            output_backend="canvas",
            frame_width=None, frame_height=None, width=None, height=height,
            sizing_mode="stretch_width", min_border_left=56, min_border_right=12,
        )  # fmt: skip
        fig.title.text = ""
        fig.toolbar.update(logo=None, autohide=True)
        if fig.legend:
            fig.legend.update(border_line_alpha=0, background_fill_alpha=0, spacing=0, padding=2)
        drawn.append(savable(fig, name))
    return drawn
