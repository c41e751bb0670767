"""What stands in the picture of S: its name, what is halfway, what a force is to reach, its axes.

Who is new is to find out how far S goes: its outline hides then, and a line says how far dots do.
"""

from typing import Any

import numpy as np
from bokeh.events import Tap
from bokeh.models import ColumnDataSource, CustomJS, GlyphRenderer, Label, Node, Span
from bokeh.plotting import figure as Figure

from ....results import planes
from ....results.planes import Outlined, Plane
from ....results.replays import Replay
from ....widgets.plot_style import DARK, DOT, GUESS, corner, lines, text

CORNER = "outline: exact; dots: networks found at random"
CORNER_FIRST = "blue: found at random; red: now"
NAMED = "possible up to here", "halfway"  # of the outline, and within it
ASK = "your guess: click how far right"
# The page's theme gives all axes one colour.
KEEP = "if (cb_obj.tags.length) cb_obj.axis_label_text_color = cb_obj.tags[0]"

Renderers = list[GlyphRenderer]


class Standing:
    """Words and lines in the plot of S."""

    def __init__(
        self,
        fig: Figure,
        outlines: list[tuple[GlyphRenderer, float, float]],
        packed: list[GlyphRenderer],
    ) -> None:
        """outlines: (renderer, opacity of its inside, of its edge); packed: network as packed."""
        self.figure, self.outlines, self.packed = fig, outlines, packed
        self.hidden = False  # whether the outline is to be found out
        self._guessed_of: tuple[Replay | None, Any] = None, None  # and the plane
        self.half = ColumnDataSource({"x": [], "y": []})
        self.words = ColumnDataSource({"x": [], "y": [], "words": []})
        fig.patch(
            "x", "y", source=self.half, fill_alpha=0, line_color=DARK, line_dash="dotted",
            line_width=1.4,
        )  # fmt: skip
        fig.text(
            "x", "y", "words", source=self.words, y_offset=20, text_align="center",
            text_font_size="12px", text_color=DARK,
        )  # fmt: skip
        self.name_of_s = Label(
            x=0, y=0, text="S", text_color=DARK, text_font_size="20px", visible=False
        )
        self.goal = Span(dimension="height", line_color=DOT, line_dash="dashed", visible=False)
        self.goal_words = Label(
            x=0, y=_edge("top", 20), x_offset=-6, text_align="right", text_color=DOT,
            text_font_size="13px", visible=False,
        )  # fmt: skip
        for part in (self.name_of_s, self.goal, self.goal_words):
            fig.add_layout(part)
        self.guess = Span(
            dimension="height", line_color=GUESS, line_width=2, line_dash="dashed", visible=False
        )
        self.guess_words = Label(
            x=_edge("left", 10), y=_edge("bottom", -12), text=ASK, text_color="white",
            background_fill_color=DOT, padding=4, border_radius=4, text_font_size="13px",
            visible=False,
        )  # fmt: skip
        for part in (self.guess, self.guess_words):
            fig.add_layout(part)
        fig.on_event(Tap, self._guess)
        for axis in (*fig.xaxis, *fig.yaxis):
            axis.js_on_change("axis_label_text_color", CustomJS(code=KEEP))
        self.corner = corner(fig, CORNER)

    def clear(self) -> None:
        """Nothing stands there."""
        self.half.data = {"x": [], "y": []}
        self.words.data = {"x": [], "y": [], "words": []}
        for part in (self.name_of_s, self.goal, self.goal_words):
            part.visible = False

    def title(self, replay: Replay, plane: Plane, dark: bool) -> None:
        """Titles of the axes of a plane, in the colours of the lines whose forces they are."""
        of, shown = self._guessed_of
        if replay is not of or shown != (plane.kind, plane.pair):
            self._guessed_of = replay, (plane.kind, plane.pair)
            self._ask()
        colours = lines(dark) if plane.pair else (text(dark),) * 2
        axes = self.figure.xaxis[0], self.figure.yaxis[0]
        for axis, words, colour in zip(axes, planes.labels(replay, plane), colours, strict=True):
            axis.update(axis_label=words, tags=[colour], axis_label_text_color=colour)

    def hide(self, hidden: bool, found: Outlined | None) -> None:
        """Hide the outline, which still decides what part of the plane is seen, or show it."""
        if hidden == self.hidden:
            return
        self.hidden = hidden
        for renderer, fill, line in self.outlines:
            shown = {"fill_alpha": fill, "line_alpha": line}
            renderer.glyph.update(**(dict.fromkeys(shown, 0) if hidden else shown))
        for packed in self.packed:
            packed.visible = not hidden
        self.corner.text = CORNER_FIRST if hidden else CORNER
        self.guess_words.visible = hidden or self.guess.visible
        if found is not None:
            self.show(found)

    def show(self, found: Outlined) -> None:
        """Its name, its half, and what its green force is to reach."""
        self.clear()
        if self.hidden:
            seen = planes.seen(found.plane)
            return self._mark(seen, f"none found beyond {seen:g}", "left")
        middle, goal = found.outer.mean(axis=0), found.plane.goal
        x, y = middle + 0.75 * (found.outer[np.argmax(found.outer[:, 0])] - middle)
        self.name_of_s.update(x=x, y=y, visible=True)
        if goal > 0:
            self._mark(goal, f"goal: {goal:g}", "right")
        if found.plane.kind != planes.STRESS:  # of which nothing is said of the middle
            half = planes.halfway(found.outer)
            self.half.data = {"x": half[:, 0], "y": half[:, 1]}
            tops = np.array([part[np.argmax(part[:, 1])] for part in (found.outer, half)])
            self.words.data = {"x": tops[:, 0], "y": tops[:, 1], "words": [*NAMED]}

    def _ask(self) -> None:
        """Nothing was guessed yet; who is new is asked to."""
        look = {"text_color": "white", "background_fill_color": DOT, "text_align": "left"}
        self.guess.visible = False
        self.guess_words.update(
            x=_edge("left", 10), x_offset=0, text=ASK, visible=self.hidden, **look
        )

    def _guess(self, event: Any) -> None:
        """Who is new clicks how far the dot may go, before finding out."""
        if self.hidden:
            words = f"your guess {event.x:.1f}"
            look = {"text_color": GUESS, "background_fill_color": None, "text_align": "right"}
            self.guess.update(location=event.x, visible=True)
            self.guess_words.update(x=event.x, text=words, x_offset=-6, **look)

    def _mark(self, x: float, words: str, align: str) -> None:
        """A line at x, with words at its upper end."""
        self.goal.update(location=x, visible=True)
        offset = 6 if align == "left" else -6
        self.goal_words.update(x=x, text=words, x_offset=offset, text_align=align, visible=True)


def _edge(symbol: str, offset: int = 0) -> Node:
    return Node(target="frame", symbol=symbol, offset=offset)
