"""The packing: the player, what it shares with the state, and the legend."""

import numpy as np
import panel as pn

from ..state import COLOURS, WIDTHS
from .player import Player, frames
from .style import BLUE, GREY, ORANGE, palettes

SHARED = ("contact", "frame", "reference")  # both ways
FOLLOWED = ("source", "busy", "tab", "colour", "thickness", "overlay", "scale")  # from the state

SATURATION = 0.98  # quantile of ΔF_n at which its colour is full

LEGEND = """
<div style="display:flex;flex-wrap:wrap;gap:3px 20px;align-items:center;font-size:12px">
 <span>width: {width}
  <svg width="56" height="12" style="vertical-align:middle"><polygon points="0,5.5 56,0 56,12 0,6.5"
   fill="currentColor" fill-opacity="0.65"/></svg></span>
 <span>colour: {colour} {bar}</span>
 {marks}
 <span>pale disks: rattlers; dashed: the box{sides}, outside it images</span>
</div>
"""
BAR = """{low} <span style="display:inline-block;width:96px;height:10px;vertical-align:middle;
 border-radius:2px;background:linear-gradient(90deg,{stops})"></span> {high}"""
DOT = """<svg width="12" height="12" style="vertical-align:middle;margin-left:8px">
 <circle cx="6" cy="6" r="4" fill="{fill}" stroke="{line}" stroke-width="1.5"/></svg> {text}"""


class PackingView:
    """Disks, chains and the player's buttons: the views `player` and, below it, `legend`."""

    def __init__(self, state):
        self.state = state
        self.player = Player(
            sizing_mode="stretch_width",
            palettes=palettes(state.dark),
            **{name: getattr(state, name) for name in (*SHARED, *FOLLOWED)},
        )
        self.legend = pn.pane.HTML(sizing_mode="stretch_width", margin=(2, 10))
        for name in SHARED:
            self.player.param.watch(lambda event: state.param.update({event.name: event.new}), name)
        self.player.param.watch(self._swing, "between")
        state.param.watch(self._follow, [*SHARED, *FOLLOWED])
        state.param.watch(self._show, ["replay", "exact", "between"])
        state.param.watch(self._displace, "displacement")
        state.param.watch(self._dress, ["dark"])
        shown = ["colour", "thickness", "overlay", "exact", "dark", "replay"]
        state.param.watch(self._explain, shown)
        self._show()
        self._explain()

    def _swing(self, event):
        self.state.between = None if event.new is None else tuple(event.new)

    def _follow(self, *events):
        self.player.param.update({event.name: event.new for event in events})

    def _show(self, *events):
        """What belongs together comes in one message."""
        state = self.state
        if state.replay is None:
            return
        changes = {
            "exact": exact_intervals(state.exact, state.replay),
            "between": None if state.between is None else list(state.between),
        }
        if not events or any(event.name == "replay" for event in events):
            changes["walk"] = frames(state.replay)
        self.player.param.update(changes)

    def _displace(self, event):
        field = event.new
        flat = None if field is None else np.ascontiguousarray(field, dtype=np.float64).ravel()
        self.player.displacement = flat

    def _dress(self, event):
        self.player.palettes = palettes(event.new)

    def _explain(self, *events):
        self.legend.object = legend(self.state)


def exact_intervals(dataset, replay):
    """Exact intervals of f_n in ⟨f_n⟩, for the contacts on screen."""
    if dataset is None or not np.array_equal(dataset["backbone"].values, replay.backbone):
        return {}
    return {
        name: (dataset[name].values[:, 0] / replay.force_scale).astype(np.float32)
        for name in ("low", "high")
    }


def normal_extent(replay, exact):
    """ΔF_n (N_c,) in ⟨f_n⟩: exact where known, else of all states."""
    if exact:
        return exact["high"] - exact["low"]
    return replay.high[:, 0] - replay.low[:, 0]


def legend(state):
    """What width and colour mean just now, as HTML."""
    if state.replay is None:
        return ""
    diverging = f"{BLUE},{GREY},{ORANGE}"
    extent = normal_extent(state.replay, exact_intervals(state.exact, state.replay))
    most = float(np.quantile(extent, SATURATION)) if len(extent) else 0.0
    stops = ",".join(palettes(state.dark)["extent"][::8])
    bars = {
        "mobilised": ("−1", diverging, "1"),
        "extent": ("0", stops, f"{most:.2f} ⟨fₙ⟩"),
        "change": ("−⟨fₙ⟩", diverging, "+⟨fₙ⟩"),
        "sign": ("less", f"{BLUE} 50%,{ORANGE} 50%", "more"),
    }
    low, stops, high = bars[state.colour]
    bar = BAR.format(low=low, stops=stops, high=high)
    if state.colour == "mobilised" and state.replay.summary["mu"] == 0:
        bar = "(none at μ = 0)"
    sides = [f"{side:.2f}" for side in state.replay.box if np.isfinite(side)]
    return LEGEND.format(
        width=WIDTHS[state.thickness],
        colour=COLOURS[state.colour],
        bar=bar,
        marks=_marks(state.dark) if state.overlay else "",
        sides=f" of {' × '.join(sides)} largest radii" if sides else "",
    )


def _marks(dark):
    colours = palettes(dark)["scene"]
    strong = DOT.format(fill=colours["strong"], line="none", text="fₙ &gt; 2⟨fₙ⟩")
    loose = DOT.format(fill="none", line=colours["loose"], text="ΔFₙ &gt; ⟨ΔFₙ⟩")
    return f"<span>{strong}{loose}</span>"
