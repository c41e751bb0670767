"""The instrument on one screen: packing and player, tabs, and results."""

from collections.abc import Iterator
from functools import partial
from typing import Any
from urllib.parse import parse_qsl

import panel as pn
from bokeh.document import Document

from ..browser.panel_patches import send_what_waits
from ..packing.player import Player
from ..state import held_file, page_session
from ..state.app_state import AppState
from ..widgets.header import Header
from ..widgets.hints import Hints
from ..widgets.page_frame import framed
from ..widgets.unfolding import Unfolding
from . import explanation
from .controls import Controls
from .page_address import Address
from .results_line import Results
from .status_line import StatusLine
from .tabs.tabs import Tabs, pale_when_old

WAITING_MS = 250  # interval of sending messages that Panel holds back
WIDE = {"sizing_mode": "stretch_width", "margin": 0}
KEYS = [
    ["Space", "play; pause at the nearest network"],
    ["← →  Home End", "previous or next network; first or last"],
    ["N  Shift N", "select the next contact, the largest force first"],
    ["[ ]", "pull the selected force down or up"],
    ["H", "hold or release the selected force"],
    ["Z  Esc", "undo the last pull; undo all pulls (held forces stay held)"],
    ["1 … 6", "the tabs"],
    ["?", "this list"],
]

# At the foot of a scrolled part: letters fade there instead of being cut. Once the end of the
# content is in view, the shade is below it.
SHADE = {
    "content": '""', "flex": "none", "position": "sticky", "bottom": 0, "zIndex": 2,
    "height": "28px", "background": "linear-gradient(transparent, var(--paper) 85%)",
    "pointerEvents": "none",
}  # fmt: skip
SCROLLED = ":host > * { max-height: none; }"  # as high as its content: the shade follows it

# Below 900 px everything is in one column. Above, the page is one screen high: the packing is a
# square of the available height, with tabs and results next to it; from 1800 px on force space has
# its own column between them (player.js).
GRID = {
    "& .main-content": {
        "display": "grid",
        "gridTemplateColumns": "minmax(0, 1fr)",
        "alignContent": "start",
    },
    "& .controls": {"padding": "8px 24px 6px"},
    "& .side, & .space, & .panels, & .results": {"padding": "4px 24px"},
    "@media (max-width: 599.95px)": {
        "& .controls, & .side, & .space, & .panels, & .results": {"padding": "6px 12px"},
    },
    # Instead of plots that would belong to another packing; see player.js.
    "& .panels::before": {
        "content": "var(--waiting, none)", "position": "sticky", "top": "64px", "height": 0,
        "paddingLeft": "24px", "whiteSpace": "nowrap", "zIndex": 2, "color": "var(--quiet)",
    },
    "& .status.urgent": {"flex": "none", "position": "sticky", "bottom": 0, "zIndex": 5},
    "@media (min-width: 900px)": {
        "& .main-content": {
            "gridTemplate": (
                '"header header" auto "controls controls" auto "side panels" minmax(240px, 1fr)'
                ' "side results" auto "status status" auto'
                " / min(52vw, max(420px, 100dvh - 244px)) minmax(0, 1fr)"
            ),
            "height": "100dvh",
            "columnGap": "28px",
            "alignContent": "stretch",
        },
        "& .header-row": {"gridArea": "header"},
        "& .controls": {"gridArea": "controls", "minHeight": "68px", "boxSizing": "border-box"},
        "& .side": {
            "gridArea": "side", "containerType": "size", "overflow": "hidden auto",
            "height": "auto", "padding": "0 0 0 24px",
        },
        "& .panels": {
            "gridArea": "panels", "height": "auto", "overflow": "hidden auto",
            "padding": "0 14px 0 0", "marginLeft": "-10px", "scrollPadding": "44px 0 32px",
            "isolation": "isolate",  # its shade is below force space
        },
        "& .panels::after, & .space::after": SHADE,
        "& .space": {
            "gridArea": "panels", "height": "auto", "overflow": "hidden auto", "zIndex": 1,
            "padding": "0 14px 0 0", "margin": "44px 0 0 -10px",  # below the titles of the tabs
        },
        "& .results": {
            "gridArea": "results", "padding": "4px 12px 8px", "margin": "0 24px 0 -12px",
            "background": "var(--ground)", "borderRadius": "6px",
        },
        "& .status": {"gridArea": "status"},
    },
    "@media (min-width: 1800px)": {
        "& .main-content": {
            "gridTemplate": (
                '"header header header" auto "controls controls controls" auto'
                ' "side space panels" minmax(240px, 1fr) "side space results" auto'
                ' "status status status" auto'
                " / min(40vw, 100dvh - 244px) minmax(0, 1fr) minmax(0, 1.1fr)"
            ),
        },
        "& .space": {"gridArea": "space", "padding": 0, "margin": 0},
    },
}  # fmt: skip


def explore_page(document: Document, query: str) -> Any:
    """The page of large packings for a link's query; `embed=1`: only the packing."""
    wake = page_session.waker(document)
    state = AppState(page_session.library(), wake, query, page_session.visitor(document))
    looks, work = state.looks, state.work
    looks.dark = page_session.dark(query)
    work.message = work.message or " ".join(state.library.notes)
    held_file.follow(state.knowledge)
    side = pn.Column(Player(state, document), css_classes=["side"], **WIDE)
    if dict(parse_qsl(query.lstrip("?"))).get("embed") == "1":
        whole = framed(None, [side], dark=looks.dark)
    else:
        around = _Around(state, side)
        pn.state.onload(partial(work.piecewise, around.parts()))
        whole = framed(around.header, around.columns, dark=looks.dark, styles=GRID)
    page_session.poll_while_running(work, document)
    document.add_periodic_callback(partial(send_what_waits, document), WAITING_MS)
    page_session.at_end(work.close)
    return whole


class _Around:
    """The parts around the packing: header, controls, tabs, results and the status line."""

    def __init__(self, state: AppState, side: pn.Column) -> None:
        self.state = state
        self.header = Header(
            door="explore", dark=state.looks.dark, keys=KEYS, css_classes=["header-row"], **WIDE
        )
        self.header.link(state.looks, dark="dark")
        self.address = Address(state)  # created before the visitor can change the view
        self.side, self.controls = side, pn.Column(css_classes=["controls"], **WIDE)
        scrolled = WIDE | {"stylesheets": [SCROLLED]}
        self.space = pn.Column(visible=False, css_classes=["space", "in-plane"], **scrolled)
        self.panels = pn.Column(css_classes=["panels"], **scrolled)
        self.results = pn.Column(css_classes=["results"], **WIDE)
        self.status = StatusLine(state, css_classes=["status"], **WIDE)
        self.columns = [
            self.controls, side, self.panels, self.space, self.results, self.status
        ]  # fmt: skip

    def parts(self) -> Iterator[None]:
        """Create everything that follows the packing, in steps."""
        state, controls = self.state, Controls(self.state)
        self.controls[:] = [controls.line, controls.options]
        yield
        tabs = Tabs(state, self.space)
        pale_when_old([*tabs.pages.items(), ("results", self.results)])
        self.panels[:] = [tabs.tabs]
        tabs.drawn()
        self.results[:] = [Results(state, **WIDE)]
        yield
        yield from tabs.fill(state.looks.tab)
        if state.looks.wide:
            yield from tabs.fill("plane")
        self.panels.append(Unfolding())
        self.controls.extend([self.address, Hints()])  # not in the panels, which are isolated
        explanation.follow(state, self.header)
        state.read_ahead()
