"""The tabs next to the packing; each view is created when it is first visible."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import panel as pn
import panel_material_ui as pmui

from ...state.app_state import AppState
from ...widgets.parts import PLAIN, note
from .export import export, figure
from .force_space import force_space
from .friction import friction
from .intervals import intervals
from .push import push
from .your_packing import upload

# Name in links → title, and view. Components must be defined before any page opens: if defined
# later, only the first page learns of them.
TABS: dict[str, tuple[str, Callable[[AppState], Any]]] = {
    "intervals": ("Intervals", intervals.View),
    "plane": ("Force space", force_space.View),  # the second: see WITHOUT_SPACE
    "statistics": ("Friction", friction.View),
    "perturb": ("Push", push.View),
    "upload": ("Your packing", upload.View),
    "export": ("Export", export.View),
}
LOOK = {
    "& .MuiTabs-root": {"minHeight": "36px", "margin": "0 10px"},
    "& .MuiTab-root": {
        "minWidth": 0, "minHeight": "36px", "padding": "6px 2px",
        "marginRight": "clamp(8px, 1.2vw, 20px)",
        "fontSize": "15px", "letterSpacing": 0, "color": "var(--quiet)", **PLAIN,
    },
    "& .MuiTab-root.Mui-selected": {"color": "var(--ink)", "fontWeight": 600},
    "& .MuiTabs-list, & .MuiTabs-flexContainer": {"borderBottom": "1px solid var(--line)"},
}  # fmt: skip
# The same without force space, which has its own column on a wide screen.
WITHOUT_SPACE = LOOK | {"& .MuiTab-root:nth-of-type(2)": {"display": "none"}}
WIDE = {"sizing_mode": "stretch_width", "margin": 0}
OPENING = "Opening …"  # until the view exists
SPACE = f"<h2>{TABS['plane'][0]}</h2>"
HEADING = "h2 { margin: 0; padding: 6px 2px; border-bottom: 1px solid var(--line); "
HEADING += "font-size: 15px; font-weight: 600; line-height: 23px; }"
PLOTTED = ("intervals", "plane", "statistics", "perturb")  # what can be saved with the packing
GROWING = ("intervals", "plane")  # views that show a walk during its computation


class Tabs:
    """Views next to the packing; each is created when first visible, and notified when hidden."""

    def __init__(self, state: AppState) -> None:
        self.state, self.looks = state, state.looks
        self.names = list(TABS)
        self._begun: set[str] = set()
        self._space: Any = None  # the view of force space, wherever it is
        self._apart = False  # whether it is in its own column, or on its way there
        self.pages = {
            name: pn.Column(note(OPENING), css_classes=[f"in-{name}"], sizing_mode="stretch_width")
            for name in self.names
        }
        if self.looks.tab not in self.names:
            self.looks.tab = self.names[0]
        self.tabs = pmui.Tabs(
            *((TABS[name][0], self.pages[name]) for name in self.names),
            active=self.names.index(self.looks.tab),
            sx=LOOK,
            sizing_mode="stretch_width",
        )
        self.tabs.param.watch(lambda event: state.work.piecewise(self._showing()), "active")
        self.looks.param.watch(lambda event: self.choose(self.names.index(event.new) + 1), "tab")

    def choose(self, number: int) -> None:
        """Show tab 1, 2, …; other numbers and tabs without content here have no effect."""
        if 1 <= number <= len(self.names) and not self._has_place(self.names[number - 1]):
            self.tabs.active = number - 1

    def _showing(self) -> Iterator[None]:
        name = self.names[self.tabs.active]
        yield from self.filling(name)  # first, so that observers of the state find it
        if name == self.names[self.tabs.active]:
            self.looks.tab = name

    def reserve(self, place: Any) -> None:
        """Make a wide screen reserve the column of force space at once."""
        wide = self.looks.wide
        self.tabs.sx = WITHOUT_SPACE if wide else LOOK
        place.visible = wide  # other screens do not show it
        if wide and not place.objects:
            place[:] = [pn.pane.HTML(SPACE, stylesheets=[HEADING], **WIDE), note(OPENING)]

    def beside(self, place: Any) -> Iterator[None]:
        """Put force space into its own column on a wide screen, otherwise back into its tab."""
        wide, page = self.looks.wide, self.pages["plane"]
        self.reserve(place)
        if wide == self._apart:
            return
        self._apart = wide
        if wide:
            if self.looks.tab == "plane":
                self.tabs.active = self.names.index("intervals")
            self._begun.add("plane")
            self._leave(page)
            yield  # two plots of one name must not be in one message
            view = self._space = TABS["plane"][1](self.state)
            yield
            place[1] = view.panel()
        else:
            self._leave(place)
            self._begun.discard("plane")
        yield

    def _leave(self, place: Any) -> None:
        """Remove force space from a place; it is created again for another."""
        place[:] = []
        if self._space is not None:
            self._space.left = True

    def filling(self, name: str) -> Iterator[None]:
        """Create the view of a tab, once; a generator of steps."""
        if name not in self._begun and not self._has_place(name):
            self._begun.add(name)
            yield
            view = TABS[name][1](self.state)
            if name == "plane":
                self._space = view
            yield
            pieces = list(view.panel())
            if name in PLOTTED:
                pieces.append(figure.panel(self.state))
            # Choices first, then two at a time: Bokeh processes everything at each step.
            there = []
            for k in range(-1, len(pieces), 2):
                if self._has_place(name):
                    return
                there += pieces[max(k, 0) : k + 2]
                self.pages[name][:] = there
                yield
            self.looks.views += 1

    def _has_place(self, name: str) -> bool:
        """Whether a tab's view is outside the tabs; only one may exist."""
        return self.looks.wide and name == "plane"


def pale_when_old(parts: Iterable[tuple[str, Any]]) -> None:
    """Dim parts (name, view) that belong to older states than requested; see player.js."""
    for name, part in parts:
        old = "growing" if name in GROWING else "still"
        part.styles = part.styles | {
            "opacity": f"var(--{old}, 1)",
            "filter": f"var(--{old}-colours, none)",
        }
