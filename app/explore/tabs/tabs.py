"""The tabs next to the packing; each view is created when it is first visible."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import panel as pn
import panel_material_ui as pmui

from ...state.app_state import AppState
from ...state.view_settings import TABS
from ...widgets.parts import PLAIN, note
from .export import export, figure
from .force_space import force_space
from .friction import friction
from .intervals import intervals
from .push import push
from .your_packing import upload

# Components must be defined before any page opens: if defined later, only the first page learns of
# them.
VIEWS: dict[str, Callable[[AppState], Any]] = {
    kind.name: kind
    for kind in (
        intervals.View, force_space.View, friction.View, push.View, upload.View, export.View,
    )
}  # fmt: skip
LOOK = {
    "& .MuiTabs-root": {
        "minHeight": "36px", "padding": "0 clamp(0px, 3vw - 12px, 10px)",
        "background": "var(--paper)",
        "@media (min-width: 900px)": {
            "position": "sticky", "top": 0, "zIndex": 2,
            "boxShadow": "0 3px 3px var(--paper)",  # letters below fade instead of being cut
        },
    },
    "& .MuiTab-root": {
        "minWidth": 0, "minHeight": "36px", "padding": "6px 2px",
        "marginRight": "clamp(4px, 2.6vw - 18px, 20px)",
        "fontSize": "clamp(13px, 1.4vw, 15px)", "letterSpacing": 0,
        "color": "var(--quiet)", **PLAIN,
    },
    "& .MuiTab-root.Mui-selected": {"color": "var(--ink)", "fontWeight": 600},
    "& > .MuiBox-root": {"overflow": "visible"},  # otherwise heads of tables scroll with them
    "& .MuiTabs-list, & .MuiTabs-flexContainer": {"borderBottom": "1px solid var(--line)"},
    # On a wide screen force space needs no tab: see explore_page.py.
    "@media (min-width: 1800px)": {"& .MuiTab-root:nth-of-type(2)": {"display": "none"}},
}  # fmt: skip
OPENING = "Opening …"  # until the view exists
SPACE = f"<h2>{TABS['plane']}</h2>"
HEADING = """
h2 {
  margin: 0; padding: 6px 2px; border-bottom: 1px solid var(--line);
  font-size: 15px; font-weight: 600; line-height: 23px;
}
@media (max-width: 1799.95px) { h2 { display: none; } }
"""
PLOTTED = ("intervals", "plane", "statistics", "perturb")  # what can be saved with the packing
PLANE = list(TABS).index("plane")
# At once, however busy the server; `Tabs._place` does the same for changes from there.
SHOW = f"space.visible = source.active === {PLANE} || matchMedia('(min-width: 1800px)').matches"
OF_ONE_PACKING = ("intervals", "plane", "perturb")
GROWING = ("intervals", "plane")  # views that show a walk during its computation


class Tabs:
    """Views next to the packing; each is created when first visible, and notified when hidden.

    Force space has its own column, `space`: below the titles of the tabs, or beside the tabs on a
    wide screen, which always shows it.
    """

    def __init__(self, state: AppState, space: pn.Column) -> None:
        self.state, self.looks, self.space = state, state.looks, space
        self.names = list(TABS)
        self._begun: set[str] = set()
        self.pages = {
            name: pn.Column(css_classes=[f"in-{name}"], sizing_mode="stretch_width")
            for name in self.names
        }
        if self.looks.tab not in self.names:
            self.looks.tab = self.names[0]
        self.tabs = pmui.Tabs(
            *((TABS[name], self.pages[name]) for name in self.names),
            active=self.names.index(self.looks.tab), sx=LOOK, sizing_mode="stretch_width",
        )  # fmt: skip
        self._shown = self.tabs.jscallback(args={"space": space}, active=SHOW)
        self.pages["plane"] = space
        for page in self.pages.values():
            page[:] = [note(OPENING)]
        self.tabs.param.watch(lambda event: state.work.piecewise(self._showing()), "active")
        self.looks.param.watch(self._place, ["tab", "wide"])
        self._place()

    def drawn(self) -> None:
        """Let go of what the browser has: Panel keeps callbacks, and pages with them, for ever."""
        self._shown.unwatch()

    def _place(self, *events: Any) -> None:
        self.space.visible = self.looks.shows("plane")
        active = self.names.index(self.looks.tab)
        if not (self.looks.wide and active == PLANE):
            self.tabs.active = active
        elif self.tabs.active == PLANE:  # beside the tabs, force space has none
            self.tabs.active = 0
        if events and self.looks.wide:
            self.state.work.piecewise(self.fill("plane"))

    def _showing(self) -> Iterator[None]:
        name = self.names[self.tabs.active]
        yield from self.fill(name)
        self._tell(name)

    def _tell(self, name: str) -> None:
        """The tab on screen, whose view exists: it has its sentences from here on."""
        if name == self.names[self.tabs.active]:
            self.looks.tab = name

    def fill(self, name: str) -> Iterator[None]:
        """Create the view of a tab, once; a generator of steps."""
        if name not in self._begun:
            self._begun.add(name)
            yield
            view = VIEWS[name](self.state)
            self._tell(name)
            yield
            pieces = list(view.panel())
            if name == "plane":
                pieces.insert(0, pn.pane.HTML(SPACE, stylesheets=[HEADING], margin=0))
            if name in PLOTTED and not (name == "plane" and self.looks.wide):  # there once
                pieces.append(figure.panel(self.state, TABS[name].lower().replace(" ", "_")))
            # Two at a time, first choices and a sentence: Bokeh processes everything at each step.
            # What can be unfolded comes last: it would be built anew with anything that follows.
            for end in (*range(2, len(pieces) - 1, 2), len(pieces)):
                self.pages[name][:] = pieces[:end]
                yield
            self.looks.views += 1


def pale_when_old(parts: Iterable[tuple[str, Any]]) -> None:
    """Dim parts (name, view) that belong to older states than requested; see player.js.

    Plots of one packing are hidden while the requested states are being computed; figures of the
    study are not.
    """
    for name, part in parts:
        old = "growing" if name in GROWING else "still"
        part.styles = part.styles | {
            "opacity": f"var(--{old}{'-plots' if name in OF_ONE_PACKING else ''}, 1)",
            "filter": f"var(--{old}-colours, none)",
        }
