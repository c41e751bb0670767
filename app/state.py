"""What the page is showing and doing, as parameters: no widgets, no plots."""

import param

from granforce import study
from granforce.records import InputError

from .jobs import Job

OPENING_MU = 0.1  # where forces are least determined, and most is to be seen


class AppState(param.Parameterized):
    """The walk selected, the catalogue to select from, and the computation under way."""

    catalogue = param.List(doc="all cells, by series and μ")
    series = param.String(doc="of the walk on screen: everything but μ, in words")
    mu = param.Number(default=None, allow_None=True, doc="of the walk on screen")
    replay = param.Parameter(doc="the Replay on screen, or None")
    source = param.String(doc="where the states on screen come from, in words")
    message = param.String(doc="one line about what went wrong, or empty")
    running = param.Boolean(doc="whether a walk is being computed")
    stage = param.String(doc="what the computation is doing")
    fraction = param.Number(default=None, allow_None=True, doc="part done, None if unknown")
    seconds_left = param.Number(default=None, allow_None=True)

    def __init__(self, library, **params):
        super().__init__(**params)
        self.library = library
        self.job = None
        self.refresh()

    def cells(self):
        """The cells of the selected series, by μ."""
        return [cell for cell in self.catalogue if cell.series == self.series]

    def refresh(self, show=None):
        """Read the catalogue anew and show a cell: the given one, or what fits best."""
        self.catalogue = self.library.cells()
        if show is not None:
            self.show(show)
        elif self.catalogue:
            self.choose(series=self.series or self._fullest())

    def series_offered(self):
        """The names of all series."""
        return list(dict.fromkeys(cell.series for cell in self.catalogue))

    def _fullest(self):
        """The series with the most values of μ: the one most worth opening with."""
        names = [cell.series for cell in self.catalogue]
        return max(self.series_offered(), key=names.count)

    def choose(self, series=None, mu=None):
        """Show the cell of this series with this μ or the nearest; by default those on screen."""
        series = self.series if series is None else series
        mu = self.mu if mu is None else mu
        near = OPENING_MU if mu is None else mu
        cells = [cell for cell in self.catalogue if cell.series == series]
        if cells:
            self.show(min(cells, key=lambda cell: abs(cell.mu - near)))

    def show(self, cell):
        """Load a cell and put it on screen; what cannot be read leaves a message."""
        try:
            replay = self.library.replay(cell)
        except InputError as error:
            self.message = str(error)
            return
        shipped = cell.store is self.library.shipped
        where = "finished results" if shipped else "your cache"
        source = f"μ = {cell.mu:g}, {cell.series} (from {where})"
        self.param.update(series=cell.series, mu=cell.mu, source=source, replay=replay)

    def compute(self, n, mu, seed, states, relax):
        """Show the walk of these parameters: from a store, or computed in the background."""
        self.message = ""
        if self.running:
            return
        try:
            packing = study.packing_parameters(n, mu, seed)
            if packing["n"] < 3:
                raise InputError(f"a packing needs at least 3 disks, got {n}")
            params = study.walk_parameters(packing, states, relax=relax)
        except (InputError, TypeError, ValueError) as error:
            self.message = str(error) if isinstance(error, InputError) else "fill in every field"
            return
        self.job = Job(self.library, params)
        self.stage, self.fraction, self.seconds_left = self.job.stage, None, None
        self.running = True

    def poll(self):
        """Take over how far the computation is; when it has ended, show its result."""
        job = self.job
        if job is None:
            return
        if not job.ended:
            self.param.update(
                stage="cancelling …" if job.cancelled else job.stage,
                fraction=job.fraction,
                seconds_left=job.seconds_left,
            )
            return
        self.job, self.running = None, False
        self.message = job.error
        if job.cell is not None:
            self.refresh(show=job.cell)

    def cancel(self):
        """End the computation, if there is one; nothing of it is kept but a finished packing."""
        if self.job is not None:
            self.job.cancel()
