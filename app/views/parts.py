"""What the tabs share: they compute only while they are seen, and their plots can be saved."""

import panel as pn
import panel_material_ui as pmui
from bokeh.models import CustomAction, CustomJS, SaveTool
from panel.io import unlocked

from .style import plot

NOTE = {"font-size": "12.5px", "line-height": "1.45", "opacity": "0.85"}

PLAIN = {"textTransform": "none", "whiteSpace": "nowrap"}

SVG_ICON = (
    "data:image/svg+xml;utf8,<svg xmlns='http://www.w3.org/2000/svg' width='24' height='24'>"
    "<text x='12' y='16' font-family='sans-serif' font-size='10' font-weight='bold' "
    "text-anchor='middle' fill='gray'>SVG</text></svg>"
)
SAVE_SVG = """
const view = fig.document.views_manager.find_one(fig)
const blob = await view.export("svg").to_blob()
const link = document.createElement("a")
link.href = URL.createObjectURL(blob)
link.download = name + ".svg"
link.click()
setTimeout(() => URL.revokeObjectURL(link.href), 1000)
"""


def together(function, **arguments):
    """Call a function, and send all it changes on the page as one message, in its turn."""
    # Bokeh sends by itself what Panel does not hold, and that may overtake what waits in Panel's
    # queue: changes of a plot would reach a browser that has not got the plot yet.
    with unlocked():
        function(**arguments)


class Seen:
    """A view that calls `update` when something watched has changed, but only while it is seen.

    Subclasses have a `name`, that of their tab.
    """

    def __init__(self, state, *watched):
        self.state = state
        self._stale = True
        state.param.watch(self._changed, ["tab", *watched])

    @property
    def visible(self):
        """Whether the view's tab is on screen."""
        return self.state.tab == self.name

    def catch_up(self):
        """Update if need be and if seen; to be called once when the view has been built."""
        if self._stale and self.visible:
            self._stale = False
            together(self.update)

    def refresh(self, *events):
        """Update, now or when next seen."""
        self._stale = True
        self.catch_up()

    def _changed(self, *events):
        self._stale |= any(event.name != "tab" for event in events)
        self.catch_up()


def savable(fig, name):
    """The figure with buttons that save it as PNG and as SVG under this name."""
    code = f"(async () => {{{SAVE_SVG}}})()"
    fig.add_tools(
        SaveTool(filename=name),
        CustomAction(
            icon=SVG_ICON,
            description="Save as SVG",
            callback=CustomJS(args={"fig": fig, "name": name}, code=code),
        ),
    )
    return fig


def figure(name, title, x, y, **options):
    """A savable figure in the style of all others."""
    return savable(plot(title, x, y, **options), name)


def note(text="", **options):
    """Small print, as HTML."""
    return pn.pane.HTML(
        text, styles=NOTE, sizing_mode="stretch_width", margin=(2, 10, 8, 10), **options
    )


def choice(labels, value):
    """Buttons of which one is pressed; labels {value: words}."""
    return pmui.RadioButtonGroup(
        options={words: key for key, words in labels.items()},
        value=value,
        size="small",
        margin=(6, 8),
        # Capitals would make other symbols of fₙ and fₜ.
        sx={"& .MuiToggleButton-root": PLAIN, **PLAIN},
    )
