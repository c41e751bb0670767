"""Sentences about the projection of S onto a plane."""

import numpy as np

from granforce.types import Floats

from ....results import planes
from ....results.planes import Outlined, Plane
from ....results.replays import Replay, worded
from ....widgets.hints import term
from ....widgets.parts import mark
from ....widgets.plot_style import DOT, ORIGINAL, PALE, STATES

MANY = 10  # dimensions above which nearly all volume of a body is near its centre
MOSTLY = 0.75  # fraction of the dots in the inner half above which they are described as central

CROWDED = ": to move far out, many forces have to change together, which is unlikely by chance"
HEADING = "<b>Every network, and the one on screen.</b> "
HELP = (
    "Click a line in the packing to make it the green one. The plot shows the shadow "
    f"({term('principal', 'projection')}) that {term('s', 'S')} casts on a plane, not a section: "
    f"all of S lies inside the shaded {term('outline')}."
)
COMPUTED = (
    " The outline is exact to {outlined.gap:.1g} of the mean force ({outlined.programs} linear "
    "programs, one for each direction, in {outlined.seconds:.1f} s). Halfway means the outline "
    "shrunk to half its size about its centre."
)


def lead(replay: Replay, plane: Plane, outlined: bool, left: int | None = None) -> str:
    """The meaning of the marks in the plot, as HTML; left: dimensions given the held forces."""
    marks = [
        mark(STATES, "a dot: a whole force network", "50%"),
        mark(DOT, "the one in the packing: drag it", "50%"),
        mark(ORIGINAL, term("original", worded(replay, "as packed"))),
    ]
    if outlined:
        marks.insert(0, mark(PALE, f"all possible values ({term('exact', 'exact')})"))
    h = replay.summary["dimension"]
    count = f"{h} dimensions" + (f", {left} with the held forces" if left is not None else "")
    shadow = f" {term('s', 'S')} has {term('h', count)}; this is its shadow on two"
    shadow += " of the forces." if plane.components else "."
    return HEADING + ". ".join(marks) + "." + (shadow if h > 2 else "")


def finding(outlined: Outlined, replay: Replay, others: Floats, called: str) -> str:
    """How many of the states, and of others (k, 2), are near the centre of S, as HTML."""
    path = outlined.plane.path[1:]
    inner = planes.inner_share(path, outlined.outer)
    many = "All" if inner == 1 else f"{min(inner, 0.99):.0%}"
    words = f"{_drawn(replay)} <b>{many} of them lie less than halfway from the middle of the "
    words += "shaded shape to its edge</b> (dotted)"
    if len(others):
        share = planes.inner_share(others, outlined.outer)
        words += f", and {share:.0%} of the {len(others)} {called}"
    crowded = replay.summary["dimension"] >= MANY and inner > MOSTLY
    return words + (CROWDED if crowded else "") + "."


def computed(outlined: Outlined, replay: Replay) -> str:
    """What is drawn, how much of the outline the states reach, and how it was computed."""
    path = outlined.plane.path[1:]
    part = np.ptp(path, axis=0) / np.ptp(outlined.outer, axis=0)
    area = planes.area(path) / planes.area(outlined.outer)
    named = [replay.backbone[contact] for contact in outlined.plane.pair]
    which = " Green: contact {}; violet: contact {}.".format(*named) if named else ""
    share = (
        f" The {len(path)} dots span {part[0]:.0%} of its width, "
        f"{part[1]:.0%} of its height, and fill {area:.1%} of its area"
        f"{_variance(outlined.plane)}."
    )
    return HELP + which + share + COMPUTED.format(outlined=outlined)


def stresses(outlined: Outlined) -> str:
    """The meaning of the outline of all stresses, as HTML."""
    reach = np.hypot(*outlined.inner.T).max(initial=0.0)
    path = np.hypot(*outlined.plane.path.T)
    return (
        f"Shaded: every {term('stress', 'stress')} that these contacts can carry at this "
        f"pressure, exactly ({outlined.programs} linear programs, {outlined.seconds:.1f} s). The "
        f"farther from (0, 0), the larger the shear: at most <b>{reach:.3f}</b> of the pressure, "
        f"certified not to exceed {reach + outlined.gap:.3f}; the network as packed carries "
        f"{path[0]:.3f}, the {len(path) - 1} networks shown up to {path[1:].max():.3f}. Only the "
        "pressure is prescribed."
    )


def _drawn(replay: Replay) -> str:
    """The number of networks drawn as dots, in a sentence."""
    stored, states = replay.summary["kept"], replay.summary["states"]
    some = f"{stored} of the {states} networks, about every {round(states / stored)}th"
    return f"The dots are {some if stored < states else f'all {stored} networks'}."


def _variance(plane: Plane) -> str:
    """The share of the states' variance along the axes, for principal axes."""
    if not np.isfinite(plane.share).all():
        return ""
    across, up = plane.share
    return f", and {across:.0%} of their variance goes across, {up:.0%} upwards"
