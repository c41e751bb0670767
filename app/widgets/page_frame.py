"""The frame of every page: its colours and fonts, and the header."""

from typing import Any

import panel_material_ui as pmui

from ..browser.panel_patches import early_template, without_busy_watch
from .header import Header

TITLE = "granforce"
# Colours of the page by day and by night, by name in the styles of all components.
LIGHT = {
    "--paper": "#ffffff", "--ink": "#1d252d", "--quiet": "#5a636e", "--line": "#e4e8ec",
    "--field": "#c3cbd5", "--hover": "#f0f3f6", "--accent": "#1464c8", "--pale": "#dbe8f7",
    "--on-accent": "#ffffff", "--warn": "#7a4a00", "--warn-paper": "#fff3dc", "--hand": "#b5236b",
    "--ground": "#f6f8fa",
}  # fmt: skip
DARK = {
    "--paper": "#121212", "--ink": "#e8ecf1", "--quiet": "#a4adb8", "--line": "#2c333b",
    "--field": "#4a545f", "--hover": "#20262d", "--accent": "#7db7ff", "--pale": "#1d3350",
    "--on-accent": "#0b1a2c", "--warn": "#ffcf87", "--warn-paper": "#33260d", "--hand": "#ff5ca8",
    "--ground": "#1a1e23",
}  # fmt: skip
HIDDEN = {"display": "none"}
# Remove Material UI's own bar and the room for it, as the page has its own header.
FRAME = {
    **LIGHT,
    "&.mui-dark": DARK,
    "color": "var(--ink)",
    "& .MuiAppBar-root, & .MuiToolbar-root": HIDDEN,
    "& .main": {"backgroundColor": "var(--paper) !important"},
}
THEME = {
    "light": {"palette": {"primary": {"main": LIGHT["--accent"]}}},
    "dark": {"palette": {"primary": {"main": DARK["--accent"]}}},
}


def framed(
    header: Header | None, main: list[Any], *, dark: bool, styles: dict[str, Any] | None = None
) -> pmui.Page:
    """A page with this header above `main`, in the header's theme.

    header: None if the page is embedded in another one. styles: of the content of `main`, as `sx`.
    """
    whole = pmui.Page(
        title=TITLE,
        main=main if header is None else [header, *main],
        sx=FRAME | (styles or {}),
        template=early_template(),
        dark_theme=dark,
        busy_indicator=None,  # the player has its own; for this one Bokeh searches the whole page
        theme_config=THEME,
    )
    without_busy_watch(whole)
    if header is not None:
        header.param.watch(lambda event: whole.param.update(dark_theme=event.new), "dark")
    return whole
