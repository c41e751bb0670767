"""What the picture shows, in sentences with the numbers of the packing on screen."""

from typing import Any

import numpy as np

from ..results.progress_feed import Summary
from ..results.replays import Replay
from ..results.selection import Selection
from ..state.app_state import AppState
from ..widgets.foldout import Foldout
from ..widgets.hints import term

QUESTION = "What am I seeing? Why more than one force network?"


def lead(state: AppState) -> str:
    """The question that the picture answers, and what is seen, as HTML."""
    if state.work.moving and not state.selection.imported:
        return jamming(state.selection)
    if state.seen is None:
        return ""
    return first(state.seen.summary, state.looks.tab, state.looks.fresh)


# What the packing is looked at for, by tabs, where it is not what is free; and what is seen of it.
ASKED = {
    "statistics": (
        "How much can one force vary while no disk moves?",
        "Here is a packing made with friction μ = {mu:g}. With different friction the disks "
        "would have settled elsewhere.",
    ),
    "perturb": (
        "How hard can you push before something moves?",
        "Each line is the force between two touching disks at rest: thicker means stronger.",
    ),
}


# The same to somebody who is new.
ASKED_FIRST = {
    "plane": (
        "Each dot is one way to hold these {n} disks still.",
        "The picture shows the red dot's forces. Drag the dot, and watch all the lines change.",
    ),
}


def first(summary: Summary, tab: str = "", fresh: bool = False) -> str:
    """What does not move, what is free, and what playing shows; or what is asked beside.

    fresh: whether to somebody who is new, for whom playing waits.
    """
    n, free = summary["n"], summary["dimension"]
    if free == 0:
        found = f"These {n} disks never move, and the forces between them are fixed."
        told = f"No number is free: there is just one {term('network', 'force network')}."
        told += " Choose some friction to see more." if summary["mu"] == 0 else ""
    elif tab in ASKED or (fresh and tab in ASKED_FIRST):
        found, told = ASKED.get(tab) or ASKED_FIRST[tab]
        found, told = found.format(n=n), told.format(mu=summary["mu"])
    else:
        found = f"These {n} disks never move, yet the forces between them can vary."
        told = "Lines are the forces between touching disks: the thicker, the stronger. "
        told += f"<b>Balance leaves {term('h', f'{free} numbers')} free</b>, so countless sets of "
        told += "forces "
        told += "hold the very same disks. "
        told += (
            "No photograph shows which of them is there."
            if fresh
            else f"Play goes through some such {term('network', 'networks')}, found at random: "
            "alternatives, not moments in time."
        )
    return f"<h2>{found}</h2><p>{told}</p>"


def rest(replay: Replay) -> str:
    """Why there are many networks, how many, what measures that, and what is drawn around them."""
    summary = replay.summary
    loose = summary.get("rattlers", 0)
    forces, grains = 2 * summary["contacts"], summary["n"] - loose
    free, mu = summary["dimension"], summary["mu"]
    carry = f"{grains} of the {summary['n']} disks carry (pale ones are loose)."
    carry = carry if loose else f"All {grains} disks carry."
    if mu == 0:
        why = (
            f"{carry} Without friction each of the {summary['contacts']} contacts carries one "
            "force, and there are as many equations as forces: the forces are determined, h = 0. "
            "Choose some friction to see more than one network."
        )
    else:
        needed = forces - free
        why = (
            f"{carry} Newton's laws require balance: two forces and a torque at each of them, and "
            f"the pressure{_dependent(3 * grains + 1 - needed)}: {needed} independent equations. "
            f"But {summary['contacts']} contacts carry {forces} unknown force components, a "
            f"{term('fn')} and a {term('ft')} each: <b>h = {free}</b> numbers are left free "
            f"({term('h')}). That the forces are not determined by balance is called force "
            "indeterminacy. "
            f"{term('s')} is all that is left once no contact pulls (fₙ ≥ 0) and none slips "
            "(|fₜ| ≤ μ fₙ)."
        )
    return (
        f"<p><b>Why not just one?</b> {why}</p>"
        f"<p><b>How undetermined?</b> {term('eta1')}: how much a contact's force scatters over the "
        f"networks. {term('eta2')}: how far apart two networks are. {term('eta3')}: how long a "
        "contact's interval of possible forces is. All are measured against the mean force: 0 "
        "means determined, 0.1 means uncertain by about a tenth.</p>"
        "<p><b>How friction matters.</b> Each μ has its own packing. More friction lets each "
        "contact carry a wider range of forces, but a packing made with more friction comes to "
        "rest with fewer contacts, so fewer forces are free. With little friction many directions "
        "are open, but narrow; with a lot of it few, but wide: the indeterminacy rises and "
        "then falls, and is largest around μ = 0.2 to 0.3.</p>"
        f"<p><b>Where the networks come from.</b> {term('walk')}: kick all forces at random, take "
        f"the network in balance that is nearest to the kicked forces, go on from there. The "
        f"{term('original')} is the one it came to rest with. All this follows "
        f"{term('paper')}.</p>"
        f"<p><b>Around the picture.</b> Dashed: the box{_sides(replay)}; disks outside it are "
        "periodic copies of those inside.</p>"
    )


def _sides(replay: Replay) -> str:
    """How large and how tilted the box is, in words; nothing of a box without sides."""
    sides = [f"{side:.2f}" for side in replay.box if np.isfinite(side)]
    tilted = f", tilted by {replay.tilt:.2f}".replace("-", "−") if replay.tilt else ""
    return f" of {' × '.join(sides)} largest radii{tilted}" if sides else ""


def _dependent(count: int) -> str:
    """In words, how many of the equations follow from the others."""
    if count < 1:
        return ""
    return f" (less {count} that follow from the others, as each force acts on two disks)"


def jamming(selection: Selection) -> str:
    """What moves while a packing is made."""
    return (
        "<h2>These disks move until they jam.</h2>"
        f"<p>A gas of {selection.packing['n']} rigid disks is compressed by one pressure: the box "
        "shrinks, collisions (the short chains) turn into contacts that last, and at last nothing "
        "can move any more. From then on the disks never move again, and the contact forces are "
        f"explored on that {term('packing')}.</p>"
    )


def more(replay: Replay) -> str:
    """The longer part, to be opened, as HTML for a page without scripts of its own."""
    return f"<details><summary>{QUESTION}</summary>{rest(replay)}</details>"


def view(state: AppState) -> Foldout:
    """The longer part of the explanation, below the packing."""
    made = Foldout(line=QUESTION, sizing_mode="stretch_width", margin=(4, 10))

    def tell(*events: Any) -> None:
        if state.work.moving and not state.selection.imported:
            made.inside = ""
        elif state.seen is not None:
            made.inside = rest(state.seen)

    state.param.watch(tell, "seen")
    state.work.param.watch(tell, "moving")
    tell()
    return made
