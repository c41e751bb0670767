"""The packing: the player, its parameters shared with the server, and the legend."""

from typing import Any

import numpy as np
import xarray as xr
from bokeh.document import Document

from granforce.types import Floats

from ..background.notifications import observe
from ..results import compute, progress_feed
from ..results.geometry import CHAIN_WIDTH, FULL_CHANGE, FULL_DEVIATION
from ..results.planes import Plane
from ..results.replays import Replay, worded
from ..state.app_state import AppState
from ..state.known import Knowledge
from ..state.view_settings import COLOURS, EXPLAINED, WIDTHS, Appearance
from ..widgets.plot_style import BLUE, GREY, ORANGE, palettes
from .player import Player, frames

# In both directions.
SHARED = ("contact", "frame", "reference", "split", "beside", "colour", "thickness", "full")
SHARED += ("stretch", "paused", "opened", "pulled")
APPEARANCE = sorted(set(Appearance.param) - {"name"})

Bounds = dict[str, Any]  # {"low", "high": (N_c,) float32 f_n in ⟨f_n⟩}; empty if unknown

SATURATION = 0.98  # quantile of ΔF_n at which its colour is full

HELD = "scale of the free forces"  # while lines obey held ones
LARGE = 4.0  # ⟨f_n⟩, limit of the widths shown: few forces are larger
COMING = "(being computed)"  # then lines have no colour of the scale
LEGEND = """
<label data-term="{colour_term}">Colour {colour}</label><span>{bar}</span>
<label data-term="{width_term}">Width {width}</label>
<span title="no line is wider than half its smaller disk">up to
  <svg width="40" height="12" aria-hidden="true">
  <polygon points="0,5.5 40,{low:.1f} 40,{high:.1f} 0,6.5" fill="currentColor" fill-opacity="0.65"/>
  </svg> {shown:.3g} ⟨fₙ⟩{wide_bounds}</span>
<span tabindex="0" data-term="rattler">faint disks: no force</span>
<details><summary>Scales</summary>
<label title="auto: for ΔFₙ, its {saturation:g} quantile in this packing">colours full at
  <input name="full" type="number" step="any" placeholder="auto"
  min="{full_least:g}" max="{full_most:g}" value="{full}"> ⟨fₙ⟩</label>
<label>widths times <input name="stretch" type="number" step="any"
  min="{stretch_least:g}" max="{stretch_most:g}" value="{stretch:g}"></label>
</details>
"""
THRUST = """
<span>green: where the resultant of a joint can pass (exact)</span>
<span>dots: where it passes now</span>
"""
JAMMING = """
<span tabindex="0" data-term="fn">width: normal force fₙ of current contacts</span>
{colour}
<span>faint disks: no contacts; dashed: the shrinking box; disks outside: periodic copies</span>
"""
DIVERGING = [BLUE, GREY, ORANGE]
MOBILISED = "−1", DIVERGING, "+1 (slides)"
MOBILISATION = """
<span tabindex="0" data-term="mobilisation">colour: mobilisation fₜ/(μ fₙ)</span><span>{bar}</span>
"""
BAR = (
    """{low} <span class="scale" style="background:linear-gradient(90deg,{stops})"></span> {high}"""
)


class PackingView:
    """Disks, chains, their legend, and the player's buttons: the view `player`."""

    def __init__(self, state: AppState, document: Document | None = None) -> None:
        """document: as for Player."""
        self.state = state
        self.looks = looks = state.looks
        self.player = Player(
            state,
            document,
            name="player",  # its name for other components of the page
            sizing_mode="stretch_width",
            palettes=palettes(looks.dark),
            zoom=None if looks.zoom is None else list(looks.zoom),
            **{name: getattr(looks, name) for name in APPEARANCE},
            source=state.source,
            busy=state.work.busy,
        )
        for name in SHARED:
            self.player.param.watch(lambda event: looks.param.update({event.name: event.new}), name)
        self._shown = None
        for name in ("between", "zoom"):
            self.player.param.watch(self._go, name)
        looks.param.watch(self._follow, APPEARANCE)
        observe(self._follow, state, "source", "loads", "work.busy")
        observe(
            self._show, state, "shown", "exact", "measured", "knowledge.narrowed", "looks.between",
            "looks.full",
        )  # fmt: skip
        observe(self._pin, state, "replay", "knowledge.known", "knowledge.ranked")
        observe(self._displace, state, "displacement")
        observe(self._accompany, state, "comparison.twin")
        dress = self.player.param.update
        observe(lambda event: dress(plane=projection(event.new)), state, "plane")
        observe(lambda event: dress(palettes=palettes(event.new)), looks, "dark")
        observe(
            self._explain, state, "looks.colour", "looks.thickness", "looks.full", "looks.stretch",
            "looks.dark", "looks.tab", "looks.reference", "looks.pulled", "shown", "exact", "loads",
            "measured", "knowledge.known", "knowledge.narrowed", "hand.pulls", "work.moving",
        )  # fmt: skip
        observe(self._turn, looks, "tab")
        self.thrust = state.work.task(reported=False)
        observe(self._bound_thrust, state, "replay")
        self._show()
        self._accompany()
        self._bound_thrust()
        self._pin()
        self._explain()

    def _go(self, event: Any) -> None:
        """To and fro, or to another part of the picture; browsers send tuples as lists."""
        self.looks.param.update({event.name: None if event.new is None else tuple(event.new)})

    def _follow(self, *events: Any) -> None:
        self.player.param.update({event.name: event.new for event in events})

    def _show(self, *events: Any) -> None:
        """Send related changes in one message."""
        state, looks, replay = self.state, self.looks, self.state.shown
        if replay is None:
            return
        exact = exact_intervals(state.drawn, replay)
        changes = {
            "exact": exact,
            "reduction": reduction(state.knowledge, replay) if state.obeys_held else None,
            "measured": measured(state, replay),
            "most": full_colour(state),
            "between": None if looks.between is None else list(looks.between),
        }
        if self._shown is not replay:
            self._shown = replay
            room = len(progress_feed.numbers(replay.summary)) if state.growing else 0
            changes["walk"] = frames(replay, room)
        changes["keepable"] = state.keepable
        self.player.param.update(changes)

    def _turn(self, event: Any) -> None:
        """Hide the held forces in the tab of pushes, which ignore them, and show them in others."""
        if self.state.knowledge.known and "perturb" in (event.old, event.new):
            self._show()

    def _accompany(self, *events: Any) -> None:
        """Show another packing next to the one on screen."""
        twin = self.state.comparison.twin
        if twin is None:
            self.player.twin = {}
        else:
            exact = exact_intervals(twin.exact, twin.replay)
            self.player.twin = frames(twin.replay) | {"exact": exact}

    def _bound_thrust(self, *events: Any) -> None:
        """Of bodies: compute where the resultants at their joints can pass."""
        state, replay = self.state, self.state.replay
        self.player.thrust = {}
        if replay is not None and replay.outlines and replay.summary["dimension"]:
            work = compute.thrust(state.library, state.cell)
            self.thrust.start(work, lambda bands: self._show_thrust(bands, replay))

    def _show_thrust(self, bands: dict[str, Any], replay: Replay) -> None:
        if replay is self.state.replay:
            self.player.thrust = bands
            self._explain()

    def _pin(self, *events: Any) -> None:
        self.player.pins = pins(self.state.knowledge)

    def _displace(self, event: Any) -> None:
        field = event.new
        flat = None if field is None else np.ascontiguousarray(field, dtype=np.float64).ravel()
        self.player.displacement = flat

    def _explain(self, *events: Any) -> None:
        if self.state.work.moving:
            self.player.legend = jamming(self.state)
            return
        self.player.legend = legend(self.state) + (THRUST if self.player.thrust else "")


def pins(knowledge: Knowledge) -> dict[str, list[Any]]:
    """Known contacts, exact or not, and those to measure next, the best first."""
    return {
        "contacts": [one.contact for one in knowledge.known],
        "exact": [not one.error for one in knowledge.known],
        "words": [one.force for one in knowledge.known],
        "ranked": [] if knowledge.ranked is None else knowledge.ranked.contacts.tolist(),
    }


def projection(plane: Plane | None) -> dict[str, Any]:
    """A planes.Plane for the player: axes of f_n and f_t, and the origin to subtract."""
    if plane is None:
        return {}
    axes = plane.axes.astype(np.float32)
    names = {"xn": (0, 0), "xt": (0, 1), "yn": (1, 0), "yt": (1, 1)}
    columns = {name: np.ascontiguousarray(axes[k, :, part]) for name, (k, part) in names.items()}
    origin = [float(value) for value in plane.origin]
    return columns | {"origin": origin, "pair": plane.pair}


def exact_intervals(dataset: xr.Dataset | None, replay: Replay) -> Bounds:
    """Exact intervals of f_n in ⟨f_n⟩, for the contacts on screen."""
    if dataset is None or not np.array_equal(dataset["backbone"].values, replay.backbone):
        return {}
    return {
        name: (dataset[name].values[:, 0] / replay.force_scale).astype(np.float32)
        for name in ("low", "high")
    }


def reduction(knowledge: Knowledge, replay: Replay) -> Any:
    """Reduction of ΔF_n (N_c,) by known forces, in ⟨f_n⟩; None without known forces."""
    narrowed = knowledge.narrowed
    if narrowed is None or len(narrowed.reduction) != len(replay.backbone):
        return None
    return narrowed.reduction.astype(np.float32)


def measured(state: AppState, replay: Replay) -> dict[str, Any]:
    """Measured f_n in ⟨f_n⟩ of an opened frame, and its deviation in σ; otherwise {}."""
    measurement = state.measured
    if measurement is None or state.packing != measurement.packing:
        return {}
    normal, off = (
        measurement.force[replay.backbone] / replay.force_scale,
        measurement.off[replay.backbone],
    )
    return {"normal": normal.astype(np.float32), "off": off.astype(np.float32)}


def normal_extent(replay: Replay, exact: Bounds) -> Any:
    """ΔF_n (N_c,) in ⟨f_n⟩: exact if known, otherwise from all states.

    Infinite ones are drawn as long as the longest finite one.
    """
    if exact:
        extent = exact["high"] - exact["low"]
        return np.minimum(extent, extent.max(where=np.isfinite(extent), initial=0.0))
    return replay.high[:, 0] - replay.low[:, 0]


def full_colour(state: AppState) -> float:
    """ΔF_n in ⟨f_n⟩ for full colour, unless another value was requested.

    It is that of the free forces also while some are held, so that colours show what holding does.
    """
    full = state.looks.full
    return _saturation(state.shown, state.free) if full is None else float(full)


def _saturation(replay: Replay, exact: xr.Dataset | None) -> float:
    extent = normal_extent(replay, exact_intervals(exact, replay))
    return float(np.quantile(extent, SATURATION)) if len(extent) else 0.0


def colour_bar(state: AppState) -> tuple[str, list[str], str]:
    """The ends of the colour scale in words, and its colours: (low, [stops], high)."""
    looks, scales = state.looks, palettes(state.looks.dark)
    full = looks.full or FULL_CHANGE
    change = f"≤ −{full:.3g}", DIVERGING, f"≥ +{full:.3g} ⟨fₙ⟩"
    return {
        "mobilised": MOBILISED,
        "extent": ("0", list(scales["extent"][::8]), _full(state, full_colour(state))),
        "load": ("0", list(scales["load"][::8]), _largest(state.loads, looks.full)),
        "change": change,
        "deviation": (f"≥ {FULL_DEVIATION:g} σ less", DIVERGING, f"≥ {FULL_DEVIATION:g} σ more"),
        "known": ("0", list(scales["known"][::8]), "all of the interval"),
        "sign": ("less", [f"{BLUE} 50%", f"{ORANGE} 50%"], "more"),
    }[looks.colour]


def quantities(state: AppState, labels: dict[str, str]) -> dict[str, str]:
    """Labels {name: words} for captions; those of intervals say whether they are exact."""
    kind = _kind(state)
    bounds = state.bounds if kind == "exact" and state.obeys_held else kind
    return labels | {"extent": f"{labels['extent']}, {bounds}"}


def _kind(state: AppState) -> str:
    """The kind of the intervals that lines show; held forces are omitted to keep legends short."""
    return "exact" if exact_intervals(state.drawn, state.shown) else "seen"


def colours(state: AppState) -> dict[str, str]:
    """The labels of COLOURS, which name a pull or push that led to the network on screen."""
    pulled = state.looks.pulled or ("pull" if state.hand.pulls else "")
    return COLOURS | ({"change": f"change by the {pulled}"} if pulled else {})


def _full(state: AppState, most: float) -> str:
    """The ΔF_n of full colour, of which bounds, and whether it differs between packings."""
    if most:
        held = state.drawn is not state.free
        kind = _kind(state)
        origin = HELD if held else f"{kind}{_of_packing(state)}"
        return f"≥ {most:.2f} ⟨fₙ⟩ ({kind if state.looks.full else origin})"
    if state.shown.summary["dimension"]:
        return COMING
    return "0: every force is determined"


def _of_packing(state: AppState) -> str:
    """That the scale is of this packing; after a change of μ, the scale before it."""
    was = state.before
    if was is None or state.growing or (was.exact is None) != (state.exact is None):
        return ", this packing"
    return f"; {_saturation(was.replay, was.exact):.2f} at μ = {was.cell.mu:g}"


def _largest(loads: Floats | None, full: float | None) -> str:
    if loads is None:
        return COMING
    return f"≥ {full:.2f} ⟨fₙ⟩" if full else f"{loads.max(initial=0):.2f} ⟨fₙ⟩ (the largest)"


def jamming(state: AppState) -> str:
    """The meaning of width and, with friction, of colour while a packing is compressed, as HTML."""
    low, stops, high = MOBILISED
    bar = BAR.format(low=low, stops=",".join(stops), high=high)
    live = state.work.live
    coloured = live is not None and live.selection.packing["mu"] > 0
    return JAMMING.format(colour=MOBILISATION.format(bar=bar) if coloured else "")


def legend(state: AppState) -> str:
    """The present meaning of width and colour, as HTML."""
    looks, replay = state.looks, state.shown
    if replay is None:
        return ""
    low, stops, high = colour_bar(state)
    bar = BAR.format(low=low, stops=",".join(stops), high=high)
    if COMING in high:
        bar = COMING
    if looks.colour in ("mobilised", "load") and replay.summary["mu"] == 0:
        bar = "(none at μ = 0)"
    if looks.colour == "known" and not state.obeys_held:
        bar = "(a push ignores held forces)"
    elif looks.colour == "known" and state.knowledge.narrowed is None:
        known = state.knowledge.known
        bar = COMING if known else "(no forces are held: select a contact and press H)"
    widest = 2 / (CHAIN_WIDTH * looks.stretch)  # as wide as the legend is high
    shown = min(widest, LARGE)
    (full_least, full_most), (least, most) = looks.param.full.bounds, looks.param.stretch.bounds
    return worded(replay, LEGEND).format(
        width=_chosen(state, "thickness", WIDTHS), shown=shown, high=6 + 6 * shown / widest,
        low=6 - 6 * shown / widest, width_term=EXPLAINED[looks.thickness],
        colour_term=EXPLAINED[looks.colour], colour=_chosen(state, "colour", colours(state)),
        wide_bounds=f" ({_kind(state)})" if looks.thickness == "extent" else "", bar=bar,
        saturation=SATURATION, full="" if looks.full is None else f"{looks.full:g}",
        full_least=full_least, full_most=full_most, stretch=looks.stretch, stretch_least=least,
        stretch_most=most,
    )  # fmt: skip


def meaningful(state: AppState, labels: dict[str, str], name: str) -> dict[str, str]:
    """The quantities for colour or width: pinned state and known forces only if present."""
    pinned = state.looks.reference
    conditions = {"sign": pinned, "difference": pinned, "known": state.knowledge.known}
    conditions |= dict.fromkeys(("deviation", "measured"), state.measured is not None)
    chosen = getattr(state.looks, name)
    return {
        key: words for key, words in labels.items() if conditions.get(key, True) or key == chosen
    }


def _chosen(state: AppState, name: str, labels: dict[str, str]) -> str:
    """A list of the quantities that lines can show, as HTML; the player handles the choice."""
    value = getattr(state.looks, name)
    available = meaningful(state, labels, name)
    options = "".join(
        f'<option value="{key}"{" selected" if key == value else ""}>'
        f"{worded(state.shown, words)}</option>"
        for key, words in available.items()
    )
    title = {"colour": "Colour", "thickness": "Width"}[name]
    return f'<select name="{name}" aria-label="{title}">{options}</select>'
