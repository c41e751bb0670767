"""The packing: disks to scale, periodic images, and force chains."""

import numpy as np
import panel as pn
from bokeh.models import ColumnDataSource, CustomJS, Range1d
from bokeh.transform import linear_cmap

from .style import DISK, EDGE, FADED, IMAGE, NEUTRAL, OPAQUE, diverging, hover, plot

# The names under which the player finds these in the page.
FIGURE, LINKS = "packing", "links"

# Columns of the links that the player rewrites with every frame.
LIVE = ("width", "colour", "f_n", "f_t", "mobilised", "low", "high")

LEGEND = """
<div style="display:flex;flex-wrap:wrap;gap:4px 22px;align-items:center;font-size:12px">
 <span>width: normal force fₙ
  <svg width="64" height="12" style="vertical-align:middle"><polygon points="0,5.5 64,0 64,12 0,6.5"
   fill="{neutral}"/></svg></span>
 <span>colour: mobilisation fₜ/(μ fₙ) {bar}</span>
 <span><svg width="12" height="12" style="vertical-align:middle"><circle cx="6" cy="6" r="5"
  fill="{disk}" fill-opacity="{faded}" stroke="{edge}"/></svg> rattler</span>
 <span>box {sides} largest radii, dashed; outside it images</span>
</div>
"""
BAR = """−1 <span style="display:inline-block;width:110px;height:10px;vertical-align:middle;
 border-radius:2px;background:linear-gradient(90deg,{stops})"></span> 1"""


class PackingView:
    """Disks and chains of the replay on screen; the player animates the chains."""

    def __init__(self, state):
        self.state = state
        self.disks = ColumnDataSource(name="disks")
        self.links = ColumnDataSource(name=LINKS)
        self.box = ColumnDataSource(name="box")
        self.figure = self._figure()
        self.legend = pn.pane.HTML(sizing_mode="stretch_width", margin=(4, 10))
        self.show(state.replay)

    def panel(self):
        """The plot and its legend."""
        return pn.Column(
            pn.pane.Bokeh(self.figure, sizing_mode="scale_width", aspect_ratio=1, margin=0),
            self.legend,
            sizing_mode="stretch_width",
        )

    def show(self, replay):
        """Take over geometry; the forces come with the frames."""
        if replay is None:
            return
        self.disks.data = _disk_columns(replay.disks)
        self.links.data = _link_columns(replay.links)
        self.box.data = _box_columns(replay.box)
        x_low, x_high, y_low, y_high = replay.window
        for axis, low, high in (("x_range", x_low, x_high), ("y_range", y_low, y_high)):
            getattr(self.figure, axis).update(start=low, end=high, reset_start=low, reset_end=high)
        sides = " × ".join(f"{side:.2f}" for side in replay.box)
        self.legend.object = _legend(replay.summary["mu"], sides)

    def _figure(self):
        fig = plot(
            None,
            None,
            None,
            name=FIGURE,
            # Equal ranges on a frame kept square: every other way lets the scale drift.
            x_range=Range1d(0, 1),
            y_range=Range1d(0, 1),
            aspect_ratio=1,
            sizing_mode="scale_width",
            # Nothing may stand beside the frame, or it is no longer square.
            toolbar_location=None,
            min_border_left=0,
            min_border_right=0,
            min_border_top=0,
            min_border_bottom=0,
        )
        fig.js_on_event("doubletap", CustomJS(args={"fig": fig}, code="fig.reset.emit()"))
        fig.axis.visible = False
        fig.grid.visible = False
        fig.outline_line_alpha = 0
        fig.toolbar.active_scroll = fig.toolbar.tools[1]
        disks = fig.circle(
            "x",
            "y",
            radius="r",
            source=self.disks,
            fill_color=DISK,
            fill_alpha="alpha",
            line_color=EDGE,
            line_alpha="alpha",
            line_width=0.8,
        )
        fig.rect(
            "x",
            "y",
            "w",
            "h",
            source=self.box,
            fill_alpha=0,
            line_color=EDGE,
            line_dash="dashed",
        )
        links = fig.segment(
            "x0",
            "y0",
            "x1",
            "y1",
            source=self.links,
            line_width="width",
            line_cap="round",
            line_color=linear_cmap("colour", diverging(), -1, 1, high_color=NEUTRAL),
        )
        about_grain = (
            ("grain", "@grain (@kind)"),
            ("radius", "@r{0.000}"),
            ("contacts", "@contacts"),
        )
        about_contact = (
            ("contact", "@i – @j"),
            ("fₙ", "@f_n{0.000} ⟨fₙ⟩"),
            ("fₜ", "@f_t{0.000} ⟨fₙ⟩"),
            ("fₜ/(μ fₙ)", "@mobilised{0.00}"),
            ("fₙ seen", "@low{0.000} … @high{0.000}"),
        )
        fig.add_tools(hover([disks], *about_grain), hover([links], *about_contact))
        return fig


def _disk_columns(disks):
    idle = disks.contacts == 0
    return {
        **{name: values for name, values in disks._asdict().items() if name != "image"},
        "alpha": np.where(idle, FADED, OPAQUE) * np.where(disks.image, IMAGE, 1.0),
        "kind": np.where(idle, "rattler", "backbone"),
    }


def _link_columns(links):
    count = len(links.contact)
    live = {name: np.zeros(count, dtype=np.float32) for name in LIVE}
    whole = {"contact", "i", "j"}
    geometry = {
        name: values.astype(np.int32) if name in whole else values
        for name, values in links._asdict().items()
    }
    return geometry | live


def _box_columns(box):
    """One rectangle; none where the box is open."""
    sides = box[None] if np.all(np.isfinite(box)) else np.zeros((0, 2))
    return {"x": sides[:, 0] / 2, "y": sides[:, 1] / 2, "w": sides[:, 0], "h": sides[:, 1]}


def _legend(mu, sides):
    if mu > 0:
        bar = BAR.format(stops=",".join(diverging()[::32]))
    else:
        bar = "has no meaning at μ = 0"
    return LEGEND.format(neutral=NEUTRAL, disk=DISK, faded=FADED, edge=EDGE, bar=bar, sides=sides)
