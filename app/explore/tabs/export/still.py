"""The plots next to the packing as they are, for a file, independent of any page."""

import xarray as xr
from bokeh.plotting import figure as Figure
from param.parameterized import discard_events

from granforce.types import Floats

from ....results.library import Library
from ....results.planes import Outlined, Plane
from ....results.replays import Replay
from ....state.app_state import AppState
from ....state.known import Narrowed
from ....state.links import View
from ....state.view_settings import Looks
from ..force_space import force_space
from ..intervals import intervals


def at_rest(
    library: Library,
    replay: Replay,
    exact: xr.Dataset | None,
    view: View,
    tab: str = "",
    loads: Floats | None = None,
    narrowed: Narrowed | None = None,
) -> AppState:
    """A state that shows a replay by day, without computations and pulls."""
    state = AppState(library, query=None)
    here = view | {"tab": tab}
    with discard_events(state):
        replay = replay._replace(inviting=None)  # nothing can be dragged
        state.param.update(replay=replay, shown=replay, exact=exact, loads=loads)
    with discard_events(state.knowledge):
        state.knowledge.narrowed = narrowed
    with discard_events(state.looks):
        state.looks.param.update({name: here[name] for name in Looks.param if name in here})
    return state


def figures(
    library: Library,
    replay: Replay,
    exact: xr.Dataset | None,
    chosen: Plane,
    outlined: Outlined | None,
    view: View,
    narrowed: Narrowed | None,
) -> tuple[Figure, Figure, Figure]:
    """Bokeh figures of intervals, of the growth of η, and of the principal plane `chosen`."""
    bars = intervals.View(at_rest(library, replay, exact, view, "intervals", None, narrowed))
    space = force_space.View(at_rest(library, replay, exact, view))
    space.show_plane(replay, chosen)
    if outlined is not None:
        space.show_outline(replay, outlined)
    space.drawing.figure.sizing_mode = "scale_width"
    return bars.drawing.figure, bars.growth.figure, space.drawing.figure
