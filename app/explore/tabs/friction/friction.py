"""Indeterminacy against friction: the paper's figures, and the packing on screen."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import panel as pn

from ....background.jobs import Job, reading
from ....packing.legend import exact_intervals
from ....results import distributions, study_data
from ....results.distributions import Row
from ....results.library import Cell
from ....results.replays import Replay
from ....state.app_state import AppState
from ....state.view_settings import SAMPLERS
from ....widgets.contact_scatter import ContactScatter
from ....widgets.parts import TabView, folded_away, note, plotted, question
from . import claims, study_figures
from .study_figures import Correlations, Indeterminacy
from .this_packing import extents, forces

# If it is wide enough, z is drawn inside Figure 1, where there is no curve; otherwise below it.
INSET = """
:host { position: absolute; top: 66px; left: 70px; width: 40% !important; z-index: 1; }
@media (max-width: 599.95px) { :host { position: static; width: 100% !important; } }
"""
CLAIMED = (1, 3, 4, 5, 6)  # figures; the claims on Figure 2 are on the tab of pushes
THIS = (
    "This packing: which contacts are least determined",
    "This packing: how many forces are large",
    "0.15 η₃ seen by other samplers, and exact",
)
WIDE = {"sizing_mode": "stretch_width"}
CHOICE: dict[str, Any] = {"width": 250, "margin": (6, 10)}


class Rows(NamedTuple):
    """Numbers of the page's packings made with the same options as the one on screen."""

    page: list[Row]
    current: Row  # that on screen


class View(TabView):
    """Figures 1, 4 and 6 of the paper with the packing on screen, and the paper's claims."""

    name = "statistics"

    def __init__(self, state: AppState) -> None:
        super().__init__(state, "replay", "exact", "catalogue", "looks.sampler")
        self.task = state.work.task(reading)
        self.first = note("Reading and drawing Figures 1, 4 and 6 …")
        self.sampler = question("Networks of Figure 1", SAMPLERS, self.looks, "sampler", **CHOICE)
        self.fourth, self.sixth, self.details = note(), note(), note()
        self.figures = [pn.Column(**WIDE) for _ in range(3)]
        self.folded = [pn.Column(**WIDE) for _ in THIS]
        self.indeterminacy: Indeterminacy | None = None
        self.correlations: Correlations | None = None
        self.scatter: ContactScatter | None = None
        self._of: Replay | None = None  # whose rings are drawn
        self.looks.param.watch(self._mark, "contact")
        self.catch_up()

    def panel(self) -> pn.Column:
        """The figures, each below its sentence; the paper's claims after the first."""
        first, fourth, sixth = self.figures
        pairs = [part for pair in zip(THIS, self.folded, strict=True) for part in pair]
        folds = folded_away(*pairs)
        self.looks.sync_opened(folds, *(f"friction{k}" for k in range(len(THIS))))
        return pn.Column(
            self.first, self.sampler, first, self.details, self.fourth, fourth, self.sixth,
            sixth, folds, **WIDE,
        )  # fmt: skip

    def update(self) -> None:
        """Read the numbers of the page's packings, then draw."""
        state = self.state
        self.task.cancel()
        if state.replay is None or state.cell is None:
            return
        others = [cell for cell in state.catalogue if cell.selection != state.cell.selection]
        cells = distributions.alike(others, state.cell)
        replay = state.replay
        if replay is not self._of:
            self._clear()
        self._of = replay
        work = read(cells, state.cell)
        self.task.start(work, lambda rows: state.work.piecewise(self._show(replay, rows)))

    def _clear(self) -> None:
        """Remove the rings and figures of another packing."""
        if self.indeterminacy is not None:
            self.indeterminacy.etas.mark()
            self.indeterminacy.z.mark()
        if self.correlations is not None:
            self.correlations.drawn.mark()
        self.scatter = None
        for figures in self.folded[:2]:
            figures.objects = []

    def _show(self, replay: Replay, rows: Rows) -> Iterator[None]:
        """Draw Figure 1 first; a generator of steps."""
        if self.indeterminacy is None or self.indeterminacy.sampler != self.looks.sampler:
            self.indeterminacy = Indeterminacy(self.looks.sampler)
            self._place(self.indeterminacy)
            self.details.object = _claims()
        self.first.object = self.indeterminacy.sentence()
        self.indeterminacy.mark(rows.current)
        yield
        fig, self.fourth.object = study_figures.extents(rows.page, rows.current["mu"])
        self.figures[1].objects = [plotted(fig)]
        yield
        if self.correlations is None:
            self.correlations = Correlations()
            self.correlations.drawn.choosable(self._choose)
            self.figures[2].objects = [plotted(self.correlations.drawn.figure)]
            self.sixth.object = self.correlations.sentence()
        self.correlations.mark(rows.current)
        yield
        self._show_packing(replay, rows)

    def _place(self, drawn: Indeterminacy) -> None:
        inset = pn.Column(plotted(drawn.z.figure), stylesheets=[INSET], **WIDE)
        self.figures[0].styles = {"position": "relative"}
        self.figures[0].objects = [plotted(drawn.etas.figure), inset]
        for part in (drawn.etas, drawn.z):
            part.choosable(self._choose)

    def _show_packing(self, replay: Replay, rows: Rows) -> None:
        """Draw the figures of the packing on screen alone."""
        exact = exact_intervals(self.state.exact, replay)
        self.scatter = extents(replay, exact, self._select)
        self._mark()
        fig, sentence = forces(replay)
        self.folded[0].objects = [plotted(self.scatter.figure)]
        self.folded[1].objects = [note(sentence), plotted(fig)]
        self.folded[2].objects = [plotted(study_figures.samplers(rows.current))]

    def _mark(self, *events: Any) -> None:
        if self.scatter is not None and self.visible:
            self.scatter.mark(self.looks.contact)

    def _select(self, contact: int) -> None:
        self.looks.contact = contact

    def _choose(self, mu: float) -> None:
        """Show such a packing; if there is none, it is made first."""
        self.state.choose(mu=mu)
        if self.state.missing:
            self.state.compute()


def read(cells: Sequence[Cell], cell: Cell) -> Callable[[Job], Rows]:
    """Work that reads the numbers of `cell`, on screen, and of others; and the study, once."""

    def work(job: Job) -> Rows:
        job.begin(f"reading {len(cells) + 1} results and the finished study")
        study_data.study()
        rows = distributions.rows([*cells, cell])
        return Rows(rows, rows[-1])

    return work


def _claims() -> str:
    tables = [claims.claims(figure, opened=figure == 1) for figure in CLAIMED]
    return claims.summary() + "".join(tables) if any(tables) else ""
