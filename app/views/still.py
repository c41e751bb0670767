"""The plots beside the packing as they are, for a file: bound to no page."""

from types import SimpleNamespace

import numpy as np

from ..looks import Looks
from ..state import AppState
from ..work import Work
from . import intervals, plane


class _Deaf:
    """Stands where views watch the state: nothing changes any more."""

    def watch(self, *arguments):
        """Never calls."""


class Light:
    """What of the state views ask for, by day."""

    param = _Deaf()

    def __init__(self, replay, exact, view, tab="", loads=None):
        # All else as where nothing is computed, chosen or known.
        self.__dict__.update({name: AppState.param[name].default for name in AppState.param})
        here = view | {"dark": False, "between": None, "second": None, "tab": tab}
        self.looks = Looks(**{name: here[name] for name in Looks.param if name in here})
        self.loads, self.replay, self.seen = loads, replay, replay
        self.exact = self.possible = exact
        self.work = Work()
        self.knowledge = SimpleNamespace(
            task=self.work.task(), narrowed=None, known=[], param=_Deaf()
        )
        self.hand = SimpleNamespace(pulls=[])
        self.growing = self.exact_wanted = False


def figures(replay, exact, chosen, outlined, view):
    """Bokeh figures of intervals, of η as it grows, and of the principal plane `chosen`."""
    bars = intervals.View(Light(replay, exact, view, "intervals"))
    space = plane.View(Light(replay, exact, view))
    space._show(replay, chosen)
    if outlined is not None and np.array_equal(outlined.plane.axes, chosen.axes):
        space._outlined(replay, outlined)
    space.figure.sizing_mode = "scale_width"
    return bars.figure, bars.growth_figure, space.figure
