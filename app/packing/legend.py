"""What the lines of the packing show: quantities in the form for the player, and the legend."""

from typing import Any

import numpy as np
import xarray as xr

from granforce.types import Floats

from ..results.geometry import CHAIN_WIDTH, FULL_CHANGE, FULL_DEVIATION
from ..results.planes import Plane
from ..results.replays import Replay, worded
from ..state.app_state import AppState
from ..state.known import Knowledge
from ..state.view_settings import COLOURS, EXPLAINED, WIDTHS
from ..widgets.plot_style import BLUE, GREY, ORANGE, palettes

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
<label title="auto: for ΔFₙ and changes by a push, their {saturation:g} quantile in this packing">
  colours full at
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


def pins(knowledge: Knowledge) -> dict[str, list[Any]]:
    """Known contacts, exact or not, and those to measure next, the best first."""
    return {
        "contacts": [one.contact for one in knowledge.known],
        "exact": [not one.error for one in knowledge.known],
        "values": [one.value for one in knowledge.known],
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


def full_change(state: AppState) -> float:
    """Change of f_n in ⟨f_n⟩ for full colour; by a push, of most contacts at F_crit."""
    pushed, full = state.pushed, state.looks.full
    if full is not None or state.looks.pulled != "push" or pushed is None:
        return float(full or FULL_CHANGE)
    normal = pushed.path["normal"].reshape(len(pushed.path["values"]), -1)
    return float(f"{np.quantile(abs(normal[-1] - normal[0]), SATURATION):.1g}") or FULL_CHANGE


def colour_bar(state: AppState) -> tuple[str, list[str], str]:
    """The ends of the colour scale in words, and its colours: (low, [stops], high)."""
    looks, scales = state.looks, palettes(state.looks.dark)
    full = full_change(state)
    change = f"≤ −{full:.3g}", DIVERGING, f"≥ +{full:.3g} ⟨fₙ⟩"
    return {
        "mobilised": MOBILISED,
        "extent": ("0", list(scales["extent"][::8]), _full(state, full_colour(state))),
        "load": ("0", list(scales["load"][::8]), _largest(state.loads, looks.full)),
        "change": change,
        "deviation": (f"≥ {FULL_DEVIATION:g} σ less", DIVERGING, f"≥ {FULL_DEVIATION:g} σ more"),
        "known": ("0", list(scales["known"][::8]), _most_shortened(state)),
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
    if was is not None and not state.growing and (was.exact is None) == (state.exact is None):
        new, old = state.cell.selection, was.cell.selection
        if new.mu != old.mu and new.is_comparable(old):
            return f"; {_saturation(was.replay, was.exact):.2f} at μ = {was.cell.mu:g}"
    return ", this packing"


def _largest(loads: Floats | None, full: float | None) -> str:
    if loads is None:
        return COMING
    return f"≥ {full:.2f} ⟨fₙ⟩" if full else f"{loads.max(initial=0):.2f} ⟨fₙ⟩ (the largest)"


def _most_shortened(state: AppState) -> str:
    narrowed = state.knowledge.narrowed
    most = 0.0 if narrowed is None else narrowed.shortened.max(initial=0)
    return f"{most:.2f} ⟨fₙ⟩ (the largest of the others)"


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
    """The quantities for colour or width: known and measured forces only if present."""
    conditions: dict[str, object] = {"known": state.knowledge.known}
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
