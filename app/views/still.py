"""The plots beside the packing as they are, for a file: bound to no page."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import xarray as xr
from bokeh.plotting import figure as Figure

from granforce.records import Floats

from ..links import View
from ..looks import Looks
from ..planes import Outlined, Plane
from ..replays import Replay
from ..state import AppState
from ..work import Work
from . import intervals, plane


class _Deaf:
    """Stands where views watch the state: nothing changes any more."""

    def watch(self, *arguments: Any) -> None:
        """Never calls."""


class Light:
    """What of the state views ask for, by day."""

    param = _Deaf()

    def __init__(
        self,
        replay: Replay,
        exact: xr.Dataset | None,
        view: View,
        tab: str = "",
        loads: Floats | None = None,
    ) -> None:
        # All else as where nothing is computed, chosen or known.
        self.__dict__.update({name: AppState.param[name].default for name in AppState.param})
        here = view | {"dark": False, "between": None, "tab": tab}
        self.looks = Looks(  # type: ignore[no-untyped-call]  # param says no types
            **{name: here[name] for name in Looks.param if name in here}
        )
        self.loads, self.replay, self.seen = loads, replay, replay
        self.exact = self.possible = exact
        self.work = Work()
        self.knowledge = SimpleNamespace(
            task=self.work.task(), narrowed=None, known=[], param=_Deaf()
        )
        self.hand = SimpleNamespace(pulls=[])
        self.growing = self.exact_wanted = False


def figures(
    replay: Replay,
    exact: xr.Dataset | None,
    chosen: Plane,
    outlined: Outlined | None,
    view: View,
) -> tuple[Figure, Figure, Figure]:
    """Bokeh figures of intervals, of η as it grows, and of the principal plane `chosen`."""
    bars = intervals.View(Light(replay, exact, view, "intervals"))  # type: ignore[arg-type]  # has what is asked of it
    space = plane.View(Light(replay, exact, view))  # type: ignore[arg-type]  # has what is asked of it
    space._show(replay, chosen)
    if outlined is not None and np.array_equal(outlined.plane.axes, chosen.axes):
        space._outlined(replay, outlined)
    space.figure.sizing_mode = "scale_width"
    return bars.figure, bars.growth_figure, space.figure
