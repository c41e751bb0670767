"""Packing and plots on screen as one figure, for print."""

from typing import Any

import panel as pn

from ....packing.captions import caption, shown_stem
from ....state.app_state import AppState
from ....widgets.file_buttons import Handover
from ....widgets.number import NumberField
from ....widgets.parts import folded_away, note

TITLE = "Save as one figure"
FILES = {"": {"svg": "SVG, packing and plots", "pdf": "PDF, by printing"}}
WIDTH_MM = 170  # width of two columns
HELP = """
As on screen, as vector graphics. At 120 mm or more, the plots are next to the packing.
"""


def panel(state: AppState, tab: str) -> Any:
    """The width, and a button for each kind of file; made by composed_figure.js.

    tab: the tab's title, which the files name.
    """

    def make(kind: str) -> None:
        state.work.message = state.unsaved
        if not state.unsaved:
            name = f"{shown_stem(state)}_{tab}.{kind}"
            buttons.hand_over_picture(name, caption(state), width.value)

    buttons = Handover(make, files=FILES, margin=(4, 10, -8, 10))
    width = NumberField(
        state.work.say, label="Width, mm", value=WIDTH_MM, start=40, end=2000, step=5, width=150,
        margin=(0, 10, 4, 10),
    )  # fmt: skip
    inside = pn.Column(note(HELP), width, buttons, sizing_mode="stretch_width")
    fold = folded_away(TITLE, inside)
    state.looks.sync_opened(fold, "figure")
    return fold
