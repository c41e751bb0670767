"""The effect of a push on one contact, in words, as a table, and against distance."""

import numpy as np
from bokeh.models import BoxAnnotation
from bokeh.plotting import figure as Figure

from granforce.measures import statistics

from ....results.replays import Replay
from ....state.perturbations import Pushed
from ....widgets.hints import term
from ....widgets.parts import figure
from ....widgets.plot_style import BLUE, DARK, DOT, ORIGINAL, legend_above
from ...result_values import between

F_CRIT = term("critical_force", "critical force F_crit").replace("F_crit", "F<sub>crit</sub>")
LIMIT = term("limit_load", "limit load")
HEADING = "<b>How hard can the two disks of contact {} be pushed apart?</b> "
ASKED = (
    "The push begins with the network as packed, in which they press on each other with {now:.2f} "
    f"mean forces. It grows until disks move, at the {F_CRIT}; beyond the {LIMIT} no network "
    "balances it. Click another line to push that contact."
)
FOUND = (
    "<b>At F<sub>crit</sub> {opened} contacts open {ring}, {slid} slide {spot} and {kept} "
    "hold.</b> Arrows {arrow}: the first motion, {most:.3g} times its rms for the fastest disk; "
    "rotations are not drawn."
)
MARKS = {
    "ring": '<span style="display:inline-block;width:8px;height:8px;border:2px solid;'
    'border-radius:50%" aria-hidden="true"></span>',
    "spot": f'<span style="color:{BLUE}">●</span>',
    "arrow": "→",
}
HELD = " Held forces are ignored here: {} may change like all others."
COMPUTED = (
    "Of all sets of forces that balance the push, those nearest to the forces as packed are "
    "shown. F<sub>crit</sub> lies between the largest "
    "load at which contact dynamics finds rest and the smallest at which it finds none. |u| is "
    "the first motion of a disk, relative to the root mean square over all disks."
)
EARLIER = (
    "Balanced networks exist up to the limit load. The disks move {part:.0f} % earlier, at "
    "F<sub>crit</sub>, because friction does not build these networks up on the way."
)
TOGETHER = "The disks move only at the limit load, where no balanced network is left."
TABLE = '<table class="claims"><tr>{}</tr><tr>{}</tr></table>'


def sentence(replay: Replay, contact: int, pushed: Pushed | None, held: int) -> str:
    """The push, its result, and whether `held` forces are respected, as HTML."""
    text = HEADING.format(replay.backbone[contact])
    if pushed is None:
        text += ASKED.format(now=replay.normal[0, contact])
    else:
        text += FOUND.format(
            opened=pushed.opened, slid=pushed.slid, kept=pushed.kept, most=_farthest(pushed),
            **MARKS,
        )  # fmt: skip
    count = "the held one" if held == 1 else f"the {held} held ones"
    return text + (HELD.format(count) if held else "")


def _farthest(pushed: Pushed) -> float:
    """The largest displacement of the first motion, relative to its root mean square."""
    return float(np.hypot(*pushed.displacement.T).max())


def table(replay: Replay, contact: int, pushed: Pushed) -> str:
    """Critical force, limit load, force as packed and decay exponent, as HTML."""
    cells = {
        F_CRIT: between(pushed.low, pushed.high) + " ⟨fₙ⟩",
        LIMIT + " (pressure prescribed)" * replay.pressed: f"{pushed.limit:.4g} ⟨fₙ⟩",
        term("fn", "fₙ as packed"): f"{replay.normal[0, contact]:.4g} ⟨fₙ⟩",
        term("alpha", "decay exponent α"): _alpha(pushed),
    }
    heads = "".join(f"<th>{head}</th>" for head in cells)
    return TABLE.format(heads, "".join(f"<td>{cell}</td>" for cell in cells.values()))


def difference(pushed: Pushed) -> str:
    """The reason for which the critical force is below the limit load, as HTML."""
    part = 100 * (1 - pushed.high / pushed.limit)
    return EARLIER.format(part=part) if part >= 1 else TOGETHER


def _alpha(pushed: Pushed) -> str:
    """α over the ranges of the fit; a dash in boxes too small for a fit."""
    if not np.isfinite(pushed.exponent):
        return "–"
    if not _decays(pushed):
        return "no power law determined here"
    return f"{between(*pushed.spread)}, by range of r"


def _decays(pushed: Pushed) -> bool:
    """Whether a fit over any range of r has |u| fall with r."""
    return bool(np.isfinite(pushed.exponent) and pushed.spread[0] > 0)


def decay_sentence(pushed: Pushed) -> str:
    """Whether |u| decays as a power law or an exponential over the range of the fit, as HTML."""
    if not np.isfinite(pushed.exponent):
        return ""
    (inner, outer), (least, most) = pushed.fit, pushed.spread
    if not _decays(pushed):
        return (
            "This push determines no power law: fits of r⁻ᵅ to mean |u| over different ranges of "
            f"r give values of α from {least:.2f} to {most:.2f}."
        ).replace("-", "−")
    r, u = _fitted(pushed)
    text = (
        f"Mean |u| falls like r⁻ᵅ with α = {between(least, most)}, depending on the range of r; "
        f"the dashed line is the fit from r = {inner:.1f} to {outer:.1f} (shaded)."
    )
    power, exponential = statistics.decay_misfits(r, u)
    if not np.isfinite([power, exponential]).all():
        return text
    return (
        f"{text} ln |u| differs by {power:.3f} (rms) from the best power law and by "
        f"{exponential:.3f} from the best exponential."
    )


def decay(pushed: Pushed, bodies: bool) -> Figure:
    """|u| of every grain against its distance from the contact, and its mean in shells."""
    unit = "half the median distance of touching bodies" if bodies else "largest radii"
    fig = figure(
        "displacement", None, f"distance r from the pushed contact, in {unit}",
        "first motion |u| (rms = 1)", height=300, x_axis_type="log", y_axis_type="log",
    )  # fmt: skip
    visible = (pushed.size > 1e-4 * pushed.size.max()) & (pushed.distance > 0)
    fig.scatter(
        pushed.distance[visible], pushed.size[visible], size=4, color=DARK, alpha=0.5,
        legend_label="one dot, one grain",
    )  # fmt: skip
    known = np.isfinite(pushed.profile) & (pushed.profile > 0)
    fig.line(
        pushed.radius[known], pushed.profile[known], color=ORIGINAL, line_width=2.5,
        legend_label="mean at this distance",
    )  # fmt: skip
    if _decays(pushed):
        r, u = _fitted(pushed)
        middle = np.exp(np.log(u).mean() + pushed.exponent * np.log(r).mean())
        inner, outer = pushed.fit
        ends = np.array([inner, outer])
        fig.line(
            ends, middle * ends**-pushed.exponent, color=DOT, line_width=2.5, line_dash="dashed",
            legend_label="fit over the shaded range",
        )  # fmt: skip
        fig.add_layout(BoxAnnotation(left=inner, right=outer, fill_alpha=0.1, fill_color="#808080"))
    legend_above(fig)
    return fig


def _fitted(pushed: Pushed) -> tuple[np.ndarray, np.ndarray]:
    """Radius and mean |u| of the shells in the fit of α."""
    inner, outer = pushed.fit
    known = np.isfinite(pushed.profile) & (pushed.profile > 0)
    known &= (pushed.radius >= inner) & (pushed.radius <= outer)
    return pushed.radius[known], pushed.profile[known]
