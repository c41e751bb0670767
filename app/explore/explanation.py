"""Explanations of the picture, in sentences with the numbers of the packing on screen."""

from typing import Any

import numpy as np
import xarray as xr

import granforce
from granforce.glossary import TERMS

from ..results import study_data
from ..results.replays import Replay, worded
from ..state.app_state import AppState
from ..widgets.header import Header
from ..widgets.hints import term

DOI = "https://doi.org/10.1103/PhysRevE.79.052302"
QUESTION = "What am I seeing? Why more than one force network?"
FRICTION = (
    "<p><b>How friction matters.</b> Each μ has its own packing. More friction "
    "lets each contact carry a wider range of forces, but a packing made with more friction "
    "comes to rest with fewer contacts, so fewer forces are free. With little friction many "
    "directions are open, but narrow; with a lot of it few, but wide: the indeterminacy "
    "rises and then falls{}.</p>"
)

ABOUT = (
    f"<p><b>To cite:</b> granforce {granforce.__version__} (CITATION.cff), and "
    f'{TERMS["paper"].sentence} <a href="{DOI}" target="_blank" rel="noopener">{DOI}</a></p>'
)


def summary_html(replay: Replay) -> str:
    """The contents of the picture, and why there is more than one network, as HTML."""
    summary = replay.summary
    n, free = summary["n"], summary["dimension"]
    if free == 0:
        statement = f"These {n} disks never move, and the forces between them are fixed."
        text = f"No number is free: there is just one {term('network', 'force network')}."
        text += " Choose μ > 0 to see more." if summary["mu"] == 0 else ""
    else:
        statement = f"These {n} disks never move, yet the forces between them can vary."
        text = (
            "Lines are the forces between touching disks: the thicker, the stronger. Balance "
            f"leaves {term('h', f'{free} numbers')} free, so infinitely many sets of forces hold "
            f"the same disks in place. Play shows some of these {term('network', 'networks')}, "
            "sampled at random: alternatives, not moments in time."
        )
    return worded(replay, f"<h2>{statement}</h2><p>{text}</p>")


def rest(replay: Replay) -> str:
    """Why there are many networks, their number, its measures, and the plots around them."""
    summary = replay.summary
    loose = summary.get("rattlers", 0)
    forces, grains = 2 * summary["contacts"], summary["n"] - loose
    free, mu, closed = summary["dimension"], summary["mu"], bool(np.isfinite(replay.box).all())
    carry = f"{grains} of the {summary['n']} disks carry force (the faint ones are loose)."
    carry = carry if loose else f"All {grains} disks carry force."
    if mu == 0:
        why = (
            f"{carry} Without friction each of the {summary['contacts']} contacts carries one "
            "force, and there are as many equations as forces: the forces are determined, h = 0. "
            "Choose μ > 0 to see more than one network."
        )
    else:
        needed = forces - free
        pressed = f" and the pressure{_dependent(3 * grains + 1 - needed)}" if closed else ""
        why = (
            f"{carry} Newton's laws require balance: two forces and a torque at each that can "
            f"move{pressed and ','}{pressed}: {needed} independent equations. "
            f"But {summary['contacts']} contacts carry {forces} unknown force components, a "
            f"{term('fn')} and a {term('ft')} each: <b>h = {free}</b> numbers are left free "
            f"({term('h')}). That the forces are not determined by balance is called force "
            f"indeterminacy. {term('s', 'S')} is the set of networks in which no contact pulls (fₙ "
            "≥ 0) and none slips (|fₜ| ≤ μ fₙ)."
        )
    text = (
        f"<p><b>Why not just one?</b> {why}</p><p><b>How undetermined?</b> {term('eta1')}: how "
        f"much a contact's force varies between networks. {term('eta2')}: how far apart two "
        f"networks are. {term('eta3')}: how long the intervals of possible forces are. All are "
        "relative to typical forces: 0 means determined, 0.1 means uncertain by about a "
        "tenth.</p><p><b>Where the networks "
        f"come from.</b> {term('walk')}: perturb all forces at random, move to the nearest "
        f"network in balance, and repeat. The {term('original')} is the one it came to rest with. "
        f"The definitions follow {term('paper')}, whose own walk relaxes by sweeps.</p>"
    )
    around = (
        f"<p><b>Around the picture.</b> Dashed: the box{_sides(replay)}; disks outside it are "
        "periodic copies of those inside.</p>"
    )
    return worded(replay, text) if replay.outlines else text + FRICTION.format(_largest()) + around


def _largest() -> str:
    """The μ of the largest indeterminacy in the study, in words; empty without the study."""
    near = {f"{peak['value']:.1g}" for peak in study_data.maxima()}
    return f", and is largest near μ = {' to '.join(sorted(near))}" if near else ""


def _sides(replay: Replay) -> str:
    """The size and tilt of the box in words; empty for an open box."""
    sides = [f"{side:.2f}" for side in replay.box if np.isfinite(side)]
    tilted = f", tilted by {replay.tilt:.2f}".replace("-", "−") if replay.tilt else ""
    return f" of {' × '.join(sides)} largest radii{tilted}" if sides else ""


def _dependent(count: int) -> str:
    """The number of equations that follow from the others, in words."""
    if count < 1:
        return ""
    return f" (minus {count} that follow from the others, because each force acts on two disks)"


def more(replay: Replay) -> str:
    """The longer part, collapsed, as HTML for a page without scripts of its own."""
    return f"<details><summary>{QUESTION}</summary>{rest(replay)}</details>"


def of_all(replay: Replay, exact: xr.Dataset | None) -> Replay:
    """A Replay with the dimension of all of S, as its networks may have held forces."""
    if exact is None:
        return replay
    return replay._replace(summary=replay.summary | {"dimension": exact["dimension"].item()})


def follow(state: AppState, header: Header) -> None:
    """Make the help of the page explain what is on screen."""

    def tell(*events: Any) -> None:
        if state.replay is not None:
            replay = of_all(state.replay, state.exact)
            header.help = summary_html(replay) + rest(replay) + ABOUT

    state.param.watch(tell, "replay")
    tell()
