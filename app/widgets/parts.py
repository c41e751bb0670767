"""Features shared by the tabs: they compute only while visible, and their plots can be saved."""

from collections.abc import Callable
from typing import Any

import panel as pn
import panel_material_ui as pmui
from bokeh.models import CustomAction, CustomJS, GlyphRenderer, SaveTool, TapTool
from bokeh.plotting import figure as Figure

from ..background.notifications import observe
from ..browser.bundle import SHARED
from ..browser.panel_patches import together
from ..state.app_state import AppState
from ..state.view_settings import Looks
from .plot_style import plot
from .select import Select

NOTE = {"font-size": "12.5px", "line-height": "1.45", "opacity": "0.85"}

MOVES = ["moves"]  # tag of parts that the player draws itself while playing

PLAIN = {"textTransform": "none", "whiteSpace": "nowrap"}
# Small buttons: the main action, and others.
PRIMARY = {"color": "primary", "size": "small"}
OUTLINED = {"variant": "outlined", "color": "default", "size": "small"}

SVG_ICON = (
    "data:image/svg+xml;utf8,<svg xmlns='http://www.w3.org/2000/svg' width='24' height='24'>"
    "<text x='12' y='16' font-family='sans-serif' font-size='10' font-weight='bold' "
    "text-anchor='middle' fill='gray'>SVG</text></svg>"
)
SAVE = """(async () => {
const view = fig.document.views_manager.find_one(fig)
const blob = await view.export("svg").to_blob()
const link = document.createElement("a")
link.href = URL.createObjectURL(blob)
link.download = `${name}.svg`
link.click()
setTimeout(() => URL.revokeObjectURL(link.href), 1000)
})()"""


class TabView:
    """A tab's view, which calls `update` after a change of something watched, if it is on screen.

    Subclasses have a `name`, that of their tab. watched: parameters, as for `observe`.
    """

    name: str
    update: Callable[[], None]

    def __init__(self, state: AppState, *watched: str) -> None:
        self.state, self.looks = state, state.looks
        self._stale = True
        observe(self._changed, state, "looks.tab", "looks.wide", *watched)

    @property
    def visible(self) -> bool:
        """Whether the view's tab is on screen."""
        return bool(self.looks.shows(self.name))

    def catch_up(self) -> None:
        """Update if necessary and visible; call it once after building the view."""
        if self._stale and self.visible:
            self._stale = False
            together(self.update)

    def refresh(self, *events: Any) -> None:
        """Update, now or when next seen."""
        self._stale = True
        self.catch_up()

    def _changed(self, *events: Any) -> None:
        self._stale |= any(event.name not in ("tab", "wide") for event in events)
        self.catch_up()


def savable(fig: Figure, name: str) -> Figure:
    """The figure with buttons that save it as PNG and as SVG under this name."""
    fig.add_tools(
        SaveTool(filename=name),
        CustomAction(
            icon=SVG_ICON,
            description="Save as SVG",
            callback=CustomJS(args={"fig": fig, "name": name}, code=SAVE),
        ),
    )
    return fig


def plotted(fig: Figure) -> pn.pane.Bokeh:
    """A pane for a figure, as wide as the available room."""
    return pn.pane.Bokeh(fig, sizing_mode="stretch_width", margin=0)


def figure(name: str, title: str | None, x: str, y: str, **options: Any) -> Figure:
    """A savable figure in the style of all others."""
    return savable(plot(title, x, y, **options), name)


def on_tap(
    fig: Figure, act: Callable[[int, dict[str, Any]], object], *renderers: GlyphRenderer
) -> None:
    """Call act(row, data of the source) when a mark of these renderers is clicked."""
    fig.add_tools(TapTool(renderers=list(renderers)))
    for renderer in renderers:
        renderer.nonselection_glyph = renderer.selection_glyph = renderer.glyph
    for source in {renderer.data_source for renderer in renderers}:

        def tapped(name: str, old: object, new: list[int], of: Any = source) -> None:
            if new:
                of.selected.indices = []
                act(int(new[0]), of.data)

        source.selected.on_change("indices", tapped)


CLAIMS = """
.claims { border-collapse: collapse; margin-top: 10px; font-size: 12.5px; }
.claims caption { text-align: left; padding-bottom: 4px; font-weight: 600; }
.claims td { border-top: 1px solid rgba(128, 128, 128, 0.35); padding: 3px 12px 3px 0; }
.claims th { text-align: left; font-weight: 500; padding: 3px 12px 3px 0; vertical-align: bottom; }
.claims td, .claims th { min-width: 64px; }
.claims td:first-child { min-width: 150px; }
.claims td + td { vertical-align: top; }
.claims td small { display: block; opacity: 0.85; }
.judged { container-type: inline-size; }
.judged th { /* stays in view, below the titles of the tabs */
  position: sticky; top: 36px; z-index: 1; background: var(--paper);
}
.judged td:first-child { width: 42%; }
/* Instead of columns that do not fit: the claim, and below it what each sampler gives. */
@container (max-width: 620px) {
  .judged :is(table, tbody, tr, tr td:nth-child(n)) { display: block; width: auto; }
  .judged tr:first-child:nth-child(n), .judged tr td:empty:nth-child(n) { display: none; }
  .judged tr { padding: 4px 0; border-top: 1px solid rgba(128, 128, 128, 0.35); }
  .judged tr td { border: 0; padding: 1px 0; }
  .judged tr td[data-by]:nth-child(n) { display: flex; gap: 8px; }
  .judged td[data-by] small { display: inline; }
  .judged td[data-by]::before { content: attr(data-by); flex: 0 0 42%; opacity: 0.85; }
}
"""


SWATCH = (
    '<span aria-hidden="true" style="display:inline-block;width:9px;height:9px;border-radius:{};'
    'background:{};margin:0 3px 0 6px"></span>'
)


def mark(colour: str, words: str, corner: str = "1px") -> str:
    """A legend entry for a colour, as HTML; corner: its radius."""
    return SWATCH.format(corner, colour) + words


def note(text: str = "", **options: Any) -> pn.pane.HTML:
    """A note in small print, as HTML."""
    return pn.pane.HTML(
        text, styles=NOTE, stylesheets=[SHARED, CLAIMS], sizing_mode="stretch_width",
        margin=(2, 10, 8, 10), **options,
    )  # fmt: skip


def by_words(labels: dict[str, str]) -> dict[str, str]:
    """Labels {value: words} in the form for a list: {words: value}."""
    return {words: value for value, words in labels.items()}


def question(label: str, labels: dict[str, str], looks: Looks, name: str, **options: Any) -> Select:
    """A labelled list of the values {value: words} of the parameter with this name."""
    look = options or {"sizing_mode": "stretch_width", "margin": (4, 8), "max_width": 460}
    select = Select(label=label, options=by_words(labels), value=getattr(looks, name), **look)
    return linked(select, looks, name)


def linked(widget: Any, looks: Looks, name: str) -> Any:
    """A widget bound to the parameter with this name."""
    widget.link(looks, value=name, bidirectional=True)
    return widget


# Lines that open the content below them, without the shadows of cards.
FOLDS = {
    "&, & .MuiPaper-root": {"background": "transparent", "boxShadow": "none"},
    "&::before, & .MuiPaper-root::before": {"display": "none"},
    "& .MuiAccordionSummary-root": {"minHeight": "32px !important", "padding": 0},
    "& .MuiAccordionSummary-content": {"margin": "4px 0 !important"},
    "& .MuiAccordionDetails-root": {"padding": "0 0 8px"},
}


def folded_away(*titled: Any) -> Any:
    """Panels (title, panel, …) that are initially closed."""
    pairs = list(zip(titled[::2], titled[1::2], strict=True))
    return pmui.Accordion(
        *pairs, active=[], title_variant="subtitle2", sx=FOLDS, margin=(2, 10),
        sizing_mode="stretch_width",
    )  # fmt: skip


def folded(text: str) -> str:
    """Collapsed HTML for readers who want details."""
    return f"<details><summary>How was this computed?</summary>{text}</details>"
