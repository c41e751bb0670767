"""The page: `panel serve app` from the repository's root.

It opens on the finished results in data/start.zarr, or in the folder that the environment variable
GRANFORCE_DATA names, and on the user's own cache (GRANFORCE_CACHE); GRANFORCE_LIMITS says how much
a visitor may ask for, see app/limits.py.
"""

import importlib
from functools import partial

import panel as pn
import panel_material_ui as pmui
import param
from panel.util import edit_readonly

from . import garbage
from .data import Library
from .state import VIEW, AppState
from .views.controls import Controls
from .views.packing import PackingView
from .views.parts import PLAIN, together
from .views.summary import SummaryView

# Packing and tabs; under each other where there is no room.
SIDE_BY_SIDE = {
    "& .main-content": {
        "display": "grid",
        "gridTemplateColumns": "repeat(auto-fit, minmax(min(100%, 440px), 1fr))",
        "alignItems": "start",
        "alignContent": "start",
        "columnGap": "8px",
    }
}
POLL_MS = 200  # how often the page asks running work how far it is

# The tabs: name in links → title, module of app.views whose `View(state)` fills it when first seen.
TABS = {
    "intervals": "Intervals",
    "statistics": "Statistics",
    "projection": "Force space",
    "perturb": "Perturb",
    "upload": "Your packing",
    "export": "Export",
}

pn.extension()


def page():
    """One visitor's page."""
    document = pn.state.curdoc

    def wake(function):
        document.add_next_tick_callback(partial(together, function))

    query = pn.state.location.search if pn.state.location else ""
    state = AppState(pn.state.as_cached("library", _open_library), wake, query)
    state.message = state.message or " ".join(state.library.notes)
    wide = {"sizing_mode": "stretch_width"}
    packing = PackingView(state)
    left, right, sidebar = pn.Column(packing.player, **wide), pn.Column(**wide), pn.Column()
    whole = pmui.Page(
        title="granforce — see force space",
        sidebar=[sidebar],
        sidebar_width=290,
        main=[left, right],
        sx=SIDE_BY_SIDE,
        dark_theme=state.dark,
        busy_indicator=None,  # but the player's: for this one Bokeh looks through the whole page
    )
    with edit_readonly(whole):
        # pn.state, to which it was bound, would keep every closed page, and does if given a value.
        whole.busy = param.rx(False)

    def parts():
        """What follows the packing."""
        left.append(packing.legend)
        widgets = Controls(state).panel()
        yield
        for k in range(0, len(widgets), 3):
            sidebar.extend(widgets[k : k + 3])
            yield
        right.append(SummaryView(state).panel())
        tabs = Tabs(state)
        packing.player.on_digit = tabs.choose
        yield
        right.append(tabs.tabs)
        yield
        yield from tabs.filling(state.tab)
        state.read_ahead()

    pn.state.onload(partial(state.piecewise, parts()))
    whole.param.watch(lambda event: state.param.update(dark=event.new), "dark_theme")
    _poll_while_running(state, document)
    _tell_address(state)
    closed = garbage.opened()  # a name of the page: those of this module are gone by then
    pn.state.on_session_destroyed(lambda context: (state.close(), closed()))
    return whole


def _open_library():
    """The stores, once for all visitors."""
    garbage.settle()
    return Library()


class Tabs:
    """Views beside the packing; each is made when it is first seen, and told when it is hidden."""

    def __init__(self, state):
        self.state = state
        self.names = list(TABS)
        self._begun = set()
        self.pages = {name: pn.Column(sizing_mode="stretch_width") for name in self.names}
        if state.tab not in self.names:
            state.tab = self.names[0]
        self.tabs = pmui.Tabs(
            *((TABS[name], self.pages[name]) for name in self.names),
            active=self.names.index(state.tab),
            sx={"& .MuiTab-root": {"minWidth": 0, "padding": "12px 8px", **PLAIN}},
            sizing_mode="stretch_width",
        )
        self.tabs.param.watch(lambda event: state.piecewise(self._showing()), "active")
        state.param.watch(lambda event: self.choose(self.names.index(event.new) + 1), "tab")

    def choose(self, number):
        """Show tab 1, 2, …; other numbers do nothing."""
        if 1 <= number <= len(self.names):
            self.tabs.active = number - 1

    def _showing(self):
        name = self.names[self.tabs.active]
        yield from self.filling(name)  # first, so that those who follow the state find it there
        if name == self.names[self.tabs.active]:
            self.state.tab = name

    def filling(self, name):
        """Make the view of a tab, once; a generator of pieces."""
        if name not in self._begun:
            self._begun.add(name)
            yield
            view = _module(name).View(self.state)
            yield
            pieces = list(view.panel())
            # Choices, then two at a time: not one by one, since each time Bokeh goes through all.
            for k in range(-1, len(pieces), 2):
                self.pages[name].extend(pieces[max(k, 0) : k + 2])
                yield


def _module(name):
    # Relative: `panel serve` names the package after the folder, without a place to find it by.
    return importlib.import_module(f".views.{name}", __package__)


def _poll_while_running(state, document):
    """Take over the progress of tasks while there are any."""
    polling = []

    def switch(*events):
        if state.busy and not polling:
            poll = partial(together, state.poll)
            polling.append(document.add_periodic_callback(poll, POLL_MS))
        elif polling and not state.busy:
            document.remove_periodic_callback(polling.pop())

    state.param.watch(switch, "busy")
    switch()


def _tell_address(state):
    """Keep the address such that a copy of it reopens the view."""

    def tell(*events):
        if pn.state.location is not None and state.cell is not None:
            pn.state.location.search = f"?{state.link()}"

    state.param.watch(tell, ["selection", *VIEW])
    tell()


page().servable()
