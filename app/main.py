"""The page: `panel serve app` from the repository's root.

It opens on the finished results in data/start.zarr, or in the folder that the environment variable
GRANFORCE_DATA names, and on the user's own cache (GRANFORCE_CACHE).
"""

import panel as pn
import panel_material_ui as pmui

from .data import Library
from .state import AppState
from .views.controls import Controls
from .views.curve import CurveView
from .views.intervals import IntervalsView
from .views.packing import PackingView
from .views.player import Player
from .views.summary import SummaryView

POLL_MS = 200  # how often the page asks a running computation how far it is

pn.extension()


def page():
    """One user's page."""
    state = AppState(pn.state.as_cached("library", Library))
    state.message = state.message or " ".join(state.library.notes)
    player = Player(sizing_mode="stretch_width")
    packing, intervals = PackingView(state), IntervalsView(state)
    summary, curve, controls = SummaryView(state), CurveView(state), Controls(state)
    player.show(state.replay)

    def show(event):
        # One batch; the player comes last, since it writes into the plots of the others.
        with pn.io.hold():
            for view in (packing, intervals, summary, player):
                view.show(event.new)

    state.param.watch(show, "replay")
    _poll_while_running(state)
    source = pmui.Typography(state.param.source, variant="subtitle2", margin=(8, 10, 0, 10))
    left = pn.Column(source, player, packing.panel(), sizing_mode="stretch_width")
    right = pn.Column(
        summary.panel(),
        intervals.panel(),
        intervals.growth_panel(),
        curve.panel(),
        sizing_mode="stretch_width",
    )
    grid = pmui.Grid(
        pmui.Grid(left, size={"xs": 12, "md": 7}),
        pmui.Grid(right, size={"xs": 12, "md": 5}),
        container=True,
        spacing=1,
        sizing_mode="stretch_width",
    )
    return pmui.Page(
        title="granforce — how undetermined are contact forces?",
        sidebar=controls.panel(),
        sidebar_width=290,
        main=[grid],
    )


def _poll_while_running(state):
    """Take over the progress of a computation; end it when its page is closed."""
    callback = pn.state.add_periodic_callback(state.poll, POLL_MS, start=False)

    def switch(event):
        if event.new:
            callback.start()
        else:
            callback.stop()

    state.param.watch(switch, "running")
    pn.state.on_session_destroyed(lambda context: state.cancel())


page().servable()
