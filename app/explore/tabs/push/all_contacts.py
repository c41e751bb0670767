"""Limit loads of all contacts against their forces as packed."""

from collections.abc import Callable

import numpy as np

from ....results.replays import Replay
from ....state.perturbations import Loads
from ....widgets.contact_scatter import ContactScatter
from ....widgets.hints import term
from ....widgets.plot_style import DARK

ASKED = (
    f"<b>How hard can each contact be pushed?</b> The {term('limit_load', 'limit load')}: the "
    "largest pair of opposite forces on its two disks for which a balanced network exists."
)
HELD = " Held forces are ignored here: all admissible networks count."


def drawn(replay: Replay, loads: Loads, choose: Callable[[int], object]) -> ContactScatter:
    """One dot per contact; a click selects it."""
    words = "limit load, in mean forces", "limit load"
    return ContactScatter("limit_loads", words, replay, [("", loads.load, DARK, 4.5)], choose)


def sentence(loads: Loads) -> str:
    """The loads that contacts bear, as HTML."""
    median, most = np.percentile(loads.load, [50, 90])
    return (
        f"<b>Half of the contacts withstand a push of {median:.2f} mean forces, one in ten "
        f"more than {most:.2f}.</b> Each dot is one contact: click it to select it in the "
        "packing."
    )


def computed(loads: Loads) -> str:
    """How the loads were computed."""
    return (
        f"One linear program for each of {len(loads.load)} contacts, certified to "
        f"{loads.gap:.0e} of the mean force, in {loads.seconds:.1f} s."
    )
