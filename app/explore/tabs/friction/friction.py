"""Statistics of the states on screen, and of all those in the stores that were made alike."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui
from bokeh.models import (
    ColumnDataSource,
    FreehandDrawTool,
    GlyphRenderer,
    Scatter,
    Span,
    TapTool,
)
from bokeh.plotting import figure as Figure

from granforce.measures import statistics
from granforce.types import Floats

from ....background.jobs import Job, reading
from ....browser.panel_patches import together
from ....obsolete.glimpse import Glimpses, glimpse
from ....packing.view import exact_intervals
from ....results import distributions
from ....results.distributions import Row
from ....results.library import Cell, Library
from ....results.replays import Replay
from ....state.app_state import AppState
from ....state.view_settings import AXES, FIGURES
from ....widgets import plot_style
from ....widgets.parts import (
    LATER,
    TabView,
    choice,
    figure,
    folded,
    folded_away,
    linked,
    note,
    one_of_several,
    plotted,
    question,
)
from ....widgets.plot_style import DARK, DOT, ORIGINAL, PALE, STATES, corner, hover, legend_above
from . import study_figures
from .study_figures import Drawn

SCALED = {"eta": "linear", "extent": "log", "force": "log"}  # those with both scales, the usual one
LARGEST, BINS = 6.0, 40  # of P(f_n): ⟨f_n⟩ at most on its axis, and into how many bins it is cut
# Before the curve over friction is shown to who has never seen it, and what is said then.
GUESS = (
    "<b>One force, while no disk moves:</b> a dot is the force at the marked contact on the left, "
    "in one set of forces that holds its disks. It varies by ±{:.2f} (standard deviation; mean "
    "force 1)."
)
ASKED = "<b>Guess first: in packings made with more friction, one force varies …</b>"
ASKED_OF = "<b>In which packing does a typical force vary most?</b> Click one."
# Frictions whose packings are to be chosen among, about, and what they are like.
OFFERED = {0.01: ": slippery", 0.2: "", 10.0: ": like cogwheels"}
# One contact's forces, a dot each, on a line from 0, with its mean and what is typical about it.
STRIP = """<svg viewBox="0 0 520 58" width="520" height="58" style="max-width:100%;display:block"
 role="img" aria-label="the forces at the marked contact, with their spread" fill="none"
 stroke="currentColor" font-size="12">
 <path d="M10 34H510" stroke-opacity="0.4"/><g fill="{dots}" stroke="none">{points}</g>
 <path d="M{low:.0f} 14V8H{high:.0f}V14" stroke="{mark}" stroke-width="2"/>
 <g fill="currentColor" stroke="none">{ticks}
 <text x="{named}" y="15" text-anchor="{anchor}">force at the marked contact</text>
 <text x="{beside:.0f}" y="15" fill="{mark}">± {spread:.2f}</text></g></svg>"""
SHOW = "Just show me"
DRAWN_FIRST = "The grey line is your guess. "
GUESSES = ("more ↗", "less ↘", "more, then less ∩", "less, then more ∪")
RIGHT, ANSWERS = 2, ("Not quite. ", "Well guessed. ")
EACH = (
    "<b>Each dot is one contact:</b> the farther up, the less its force is determined; the farther "
    "right, the stronger it is. Click a dot to find its contact in the packing."
)


class View(TabView):
    """One figure at a time; those over μ are drawn in a thread by granforce.figures."""

    name = "statistics"

    def __init__(self, state: AppState) -> None:
        super().__init__(state, "replay", "exact", "catalogue")
        self.guesses = pn.FlexBox(
            *(
                one_of_several(text, on_click=partial(self._guessed, k))
                for k, text in enumerate((*GUESSES, SHOW))
            ),
            visible=False,
        )
        self.glimpses = Glimpses(self._picked)
        self.offered: list[Cell] = []  # whose packings are to be chosen among,
        self.offered_for: tuple[Any, ...] = ()  # and for whom: number of disks and seed
        self.showing = state.work.task(reading, told=False)
        self._curve: Figure | None = None  # over friction, where it is drawn
        self._found = self._said = ""  # what figures over μ show, and what is said on a guess
        self.what = question("Question", FIGURES, self.looks, "figure")
        self.scale = linked(choice(AXES, self.looks.axis), self.looks, "axis")
        self.plots = pn.Column(sizing_mode="stretch_width")
        # Always on the page: what React draws must not leave it meanwhile.
        self.folded = [pn.Column(sizing_mode="stretch_width") for _ in study_figures.FOLDED]
        self.more = folded_away(*chain(*zip(study_figures.FOLDED, self.folded, strict=True)))
        self.lead, self.told, self.meant = note(), note(), note()  # the last: what varying means
        self.task = state.work.task(reading)
        self.bar = pmui.LinearProgress(visible=False, sizing_mode="stretch_width")
        self.chosen = ColumnDataSource({"x": [], "y": []})
        self.guessed = ColumnDataSource({"xs": [], "ys": []}, name="guessed")  # drawn by hand
        self._pencil: FreehandDrawTool | None = None  # in the figure that is to be guessed
        self._drawn: str | None = None  # what the plots are of
        self.what.param.watch(self._choose, "value")
        self.scale.param.watch(self.refresh, "value")
        self.task.param.watch(self._follow, ["running", "message"])
        self.looks.param.watch(self._mark, "contact")
        self.looks.param.watch(lambda event: together(self._hide), "guess")
        self.catch_up()

    def panel(self) -> pn.Column:
        """Choices, figure, and what it shows."""
        wide = {"sizing_mode": "stretch_width"}
        return pn.Column(
            pn.Column(self.what, styles=LATER, **wide),
            self.bar,
            self.lead,
            self.guesses,
            self.glimpses,
            self.meant,
            self.plots,
            self.more,
            pn.Column(self.scale, self.told, styles=LATER, **wide),
            **wide,
        )

    def _choose(self, event: Any) -> None:
        scale = SCALED.get(event.new, self.scale.value)
        if scale == self.scale.value:
            self.refresh()
        else:
            self.scale.value = scale  # which has it drawn

    def update(self) -> None:
        """Draw the figure chosen: at once from the states on screen, or over μ in a thread."""
        state, what = self.state, self.what.value
        self.task.cancel()
        self._curve = None
        if what != self._drawn:  # another figure's plot is no answer to this choice
            self.plots.objects, self._found, self.told.object = [], "", ""
            self._drawn = what
        self._hide()
        if state.replay is None:
            return
        if what in ("scatter", "force"):
            self.bar.visible = False
            draw = self._scatter if what == "scatter" else self._force
            fig, self.lead.object, self.told.object = draw(state.replay)
            self.plots.objects = [plotted(fig)]
            return
        log = self.scale.value == "log"
        cells = distributions.alike(state.catalogue, state.cell) or [state.cell]
        work = over_friction(state.library, cells, state.cell, what, log)
        self.task.start(work, self._show)

    def _show(self, found: Drawn) -> None:
        self.state.work.piecewise(self._showing(found))

    def _showing(self, found: Drawn) -> Iterator[None]:
        figures, self._found, self.told.object = found
        for fig in figures:
            self._choosable(fig)
        if self.what.value == "eta":
            self._curve = figures[0]
        self._hide()
        first = [plotted(figures[0])]
        self.plots.objects = first
        yield
        if self.plots.objects == first:  # nothing else was chosen
            for place, fig in zip(self.folded, figures[1:], strict=False):
                place.objects = [plotted(fig)]

    # The curve over friction is guessed before it is seen for the first time

    def _guessed(self, k: int, event: Any) -> None:
        self._answer(k == RIGHT if k < len(GUESSES) else None)

    def _picked(self, k: int) -> None:
        measured = [row["eta1"] for row in distributions.rows(self.offered)]
        self._answer(bool(np.argmax(measured) == k))

    def _answer(self, right: bool | None) -> None:
        """Show the curve, and say whether the guess was right; None: none was made in words."""
        self._said = "" if right is None else ANSWERS[right]
        self._said += DRAWN_FIRST if len(self.guessed.data["xs"]) else ""
        self.looks.guess = False

    def _offer(self) -> None:
        """Have pictures made of packings of other frictions, where there are enough; once."""
        state, made = self.state, self.state.cell.selection.packing
        if self.offered_for == (made.get("n"), made.get("seed")):
            return
        self.offered_for, self.glimpses.items = (made.get("n"), made.get("seed")), []
        like = [
            cell
            for cell in distributions.alike(state.catalogue, state.cell)
            if cell.mu in OFFERED and cell.selection.packing.get("seed") == made.get("seed")
        ]
        if len(like) != len(OFFERED) or state.cell.selection.imported:
            return
        self.offered = sorted(like, key=lambda cell: cell.mu)

        def work(job: Job) -> list[list[Any]]:
            return [
                [*_glimpse(state.library, cell), f"friction {cell.mu:g}{OFFERED[cell.mu]}"]
                for cell in self.offered
            ]

        def done(items: list[list[Any]]) -> None:
            self.glimpses.items = items
            self._hide()

        self.showing.start(work, done)

    def _hide(self) -> None:
        """Hide what a guess is asked of, and show it, with what was found, once there was one."""
        what, replay = self.what.value, self.state.replay
        hidden = what == "eta" and self.looks.guess and replay is not None
        if hidden:
            self._offer()
        shown = len(self.glimpses.items) > 0
        self.guesses.visible, self.glimpses.visible = hidden and not shown, hidden and shown
        self.plots.visible = not self.glimpses.visible
        self.scale.visible = what in SCALED and not hidden
        self.more.visible = what == "eta" and not hidden
        if self._curve is not None:
            study_figures.hide_curve(self._curve, hidden)
            self._give_pencil(self._curve, replay, hidden)
        self.meant.object = _guess_first(replay) if hidden else ""
        if hidden:
            self.lead.object = ASKED_OF if shown else ASKED
        elif what in DRAWN:
            self.lead.object = (self._said if what == "eta" else "") + self._found

    def _give_pencil(self, fig: Figure, replay: Replay | None, hidden: bool) -> None:
        """Have what is dragged over the figure draw the guess, while the curve is hidden."""
        if self._pencil is not None and (not hidden or self._pencil not in fig.tools):
            fig.toolbar.update(active_drag="auto", active_tap="auto")
            fig.tools = [tool for tool in fig.tools if tool is not self._pencil]
            self._pencil = None
        if hidden and self._pencil is None and replay is not None:
            line = fig.multi_line(
                "xs", "ys", source=self.guessed, line_color=plot_style.GUESS, line_width=3,
                name=study_figures.GUESS,
            )  # fmt: skip
            mu, eta = (replay.summary[name] for name in ("mu", "eta1"))
            fig.text(
                [mu], [eta], ["or draw a curve through here"], x_offset=-14, y_offset=4,
                text_align="right", text_color=DOT, text_font_size="12px", name=study_figures.DRAW,
            )  # fmt: skip
            self._pencil = FreehandDrawTool(renderers=[line], num_objects=1)
            fig.add_tools(self._pencil)
            # Of taps, too: what listens to both is active for both, or for neither.
            fig.toolbar.update(active_drag=self._pencil, active_tap=self._pencil)

    def _follow(self, *events: Any) -> None:
        self.bar.visible = self.task.running and self.what.value in DRAWN
        if self.task.message:
            self.told.object = self.task.message

    def _choosable(self, fig: Figure) -> None:
        """A tap on a point shows such a packing, made first if there is none."""
        points = [r for r in fig.select(GlyphRenderer) if isinstance(r.glyph, Scatter)]
        if self.what.value == "extent" or not points:
            return
        for renderer in points:
            source = renderer.data_source
            source.selected.on_change("indices", lambda a, o, n, s=source: self._tapped(s, n))
            renderer.nonselection_glyph = renderer.glyph
        fig.add_tools(TapTool(renderers=points))
        if self.state.cell.mu > 0:
            here = Span(
                location=self.state.cell.mu, dimension="height", line_width=9, line_alpha=0.18,
                line_color="#888888", name=study_figures.BAND,
            )  # fmt: skip
            fig.add_layout(here)

    def _tapped(self, source: ColumnDataSource, indices: list[int]) -> None:
        if indices:
            self.state.choose(mu=float(source.data["x"][indices[0]]))
            if self.state.missing:
                self.state.compute()

    # Of the states on screen

    def _scatter(self, replay: Replay) -> tuple[Figure, str, str]:
        """ΔF_n against the original f_n, one point a contact: figure, lead and small print.

        A tap selects the contact.
        """
        original = replay.normal[0]
        seen = (replay.high - replay.low)[:, 0]
        exact = exact_intervals(self.state.exact, replay)
        fig = figure(
            "extent_against_force", None, "normal force fₙ as packed, in mean forces",
            "length ΔFₙ of its interval, in mean forces", height=380,
        )  # fmt: skip
        layers = [("seen in the networks", seen, DARK, 4.5)]
        if exact:
            layers.insert(0, ("possible (exact)", exact["high"] - exact["low"], PALE, 6))
        for label, extent, colour, size in layers:
            source = ColumnDataSource(
                {"x": original, "y": extent.astype(np.float32), "contact": replay.backbone}
            )
            points = fig.scatter(
                "x", "y", source=source, color=colour, size=size, alpha=0.75, legend_label=label,
                nonselection_alpha=0.75,
            )  # fmt: skip
            source.selected.on_change("indices", lambda a, o, n, s=source: self._select(s, n))
        rows = ("contact", "@contact"), ("fₙ", "@x{0.000}"), ("ΔFₙ", "@y{0.000}")
        fig.add_tools(hover([points], *rows), TapTool())
        fig.scatter(
            "x", "y", source=self.chosen, size=13, fill_alpha=0, line_color=DOT, line_width=2
        )
        self._points = original, seen
        self._mark()
        legend_above(fig)
        corner(fig, "exact pale, seen dark" if exact else "seen by the networks")
        values = [f"{replay.summary['correlation']:.2f} of what was seen"]
        if exact:
            values.append(f"{self.state.exact['correlation'].item():.2f} of what is possible")
        return fig, EACH, folded(f"Correlation of fₙ with ΔFₙ: {', '.join(values)}.")

    def _select(self, source: ColumnDataSource, indices: list[int]) -> None:
        if indices:
            self.looks.contact = int(indices[0])
            source.selected.indices = []

    def _mark(self, *events: Any) -> None:
        """A ring around the selected contact."""
        contact = self.looks.contact
        if self.what.value != "scatter" or not self.visible:
            return
        none = contact is None or not hasattr(self, "_points")
        x, y = ([], []) if none else ([float(v[contact])] for v in self._points)
        self.chosen.data = {"x": x, "y": y}

    def _force(self, replay: Replay) -> tuple[Figure, str, str]:
        """P(f_n) of the original network and of all states shown: figure, lead and small print."""
        log = self.scale.value == "log"
        fig = figure(
            "force_distribution", None, "normal force fₙ, in mean forces",
            "how often, P(fₙ)", height=380,
            y_axis_type="log" if log else "linear",
        )  # fmt: skip
        several = len(replay.normal) > 1
        layers = [("as packed", replay.normal[0], ORIGINAL)]
        if several:
            layers.insert(0, ("networks", replay.normal[1:], DARK))
        edges = np.linspace(0, min(LARGEST, float(replay.normal.max())), BINS + 1)
        for label, values, colour in layers:
            density = statistics.density(values.ravel(), edges)
            height = np.where(density > 0, density, np.nan) if log else density
            middle = (edges[1:] + edges[:-1]) / 2
            if label == "networks":
                fig.quad(
                    left=edges[:-1], right=edges[1:], top=height,
                    bottom=np.nanmin(height) / 2 if log else 0,
                    fill_color=PALE, line_color=PALE, legend_label=label,
                )  # fmt: skip
            else:
                fig.line(middle, height, color=colour, line_width=2, legend_label=label)
                fig.scatter(middle, height, color=colour, size=5)
        legend_above(fig)
        corner(fig, "measured: of the networks shown")
        beyond, weak = np.mean(replay.normal > LARGEST), np.mean(replay.normal < 1)
        lead = (
            f"<b>{weak:.0%} of the forces are smaller than the mean force</b>, the largest "
            f"{replay.normal.max():.1f} times as large. Yellow: the network as packed; pale: all "
            "networks shown."
        )
        text = (
            f"{len(replay.normal) - 1} networks of {replay.normal.shape[1]} contacts; "
            f"{beyond:.2%} of the forces lie beyond the axis."
        )
        return fig, lead, folded(text)


def over_friction(
    library: Library, cells: Sequence[Cell], cell: Cell, what: str, log: bool
) -> Callable[[Job], Drawn]:
    """Work that draws a figure of the paper from the cells: ([Bokeh figures], lead, caption).

    cell: that on screen, one of them.
    """

    def work(job: Job) -> Drawn:
        job.begin(f"reading {len(cells)} results and the finished study")
        rows = distributions.rows(cells)
        exact = distributions.exact_rows(library, cells)
        job.begin("drawing")
        drawn, lead, text = DRAWN[what](rows, exact, rows[cells.index(cell)], log)
        return drawn, lead, folded(text) + study_figures.claims(what)

    return work


# Figures over μ, of rows, exact rows, the row on screen, and whether the axis is logarithmic.
DRAWN: dict[str, Callable[[list[Row], list[Row], Row, bool], Drawn]] = {
    "eta": study_figures.indeterminacy,
    "extent": lambda rows, exact, here, log: study_figures.extents(rows, here["mu"], log),
    "correlation": lambda rows, exact, here, log: study_figures.correlations(rows, exact),
}


def _glimpse(library: Library, cell: Cell) -> list[Any]:
    """What Glimpses draw of a cell's packing and of its states."""
    found = library.dataset(cell)
    normal = found["states"].values[:, :, 0] / found["force_scale"].item()
    return glimpse(library.packing(cell.params["packing"]), found["backbone"].values, normal)


def _guess_first(replay: Replay) -> str:
    """What varying means, by the forces of a typical contact, as HTML."""
    forces = replay.normal[:, replay.typical]
    return GUESS.format(forces.std()) + _strip(forces)


def _strip(forces: Floats) -> str:
    """Forces (k,), a dot each, with their mean and standard deviation, as SVG."""
    mean, typical = float(forces.mean()), float(forces.std())
    scale = 500 / max(1.25 * float(forces.max()), 1e-9)
    low, high = (10 + scale * (mean + sign * typical) for sign in (-1, 1))
    heights = 34 + 7 * np.sin(2.4 * np.arange(len(forces)))  # so that dots do not hide each other
    points = "".join(
        f'<circle cx="{10 + scale * f:.1f}" cy="{y:.1f}" r="2"/>'
        for f, y in zip(forces, heights, strict=True)
    )
    ticks = "".join(
        f'<text x="{10 + scale * at:.0f}" y="55" text-anchor="middle">{at:g}</text>'
        for at in np.arange(0, 500 / scale, 0.5)
    )
    return STRIP.format(
        points=points, low=low, high=high, beside=high + 8, spread=typical,
        named=10 if low > 200 else 510, anchor="start" if low > 200 else "end",
        ticks=ticks, dots=STATES, mark=DOT,
    )  # fmt: skip
