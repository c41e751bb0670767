"""What the page is showing and doing, as parameters: no widgets, no plots."""

import param

from granforce import study
from granforce.records import InputError

from .jobs import Job


class AppState(param.Parameterized):
    """The walk selected, the catalogue to select from, and the computation under way."""

    catalogue = param.List(doc="all cells, by series and μ")
    series = param.Selector(objects=[None], doc="everything but μ")
    mu = param.Selector(objects=[None], doc="friction coefficient μ of the ensemble")
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

    def refresh(self, select=None):
        """Read the catalogue anew and show a cell: the given one, or what fits best."""
        self.catalogue = self.library.cells()
        series = list(dict.fromkeys(cell.series for cell in self.catalogue)) or [None]
        self.param.series.objects = series
        wanted = select.series if select is not None else self.series
        self.series = wanted if wanted in series else self._fullest(series)
        self._offer(select.mu if select is not None else self.mu)

    def _fullest(self, series):
        """The series with the most values of μ: the one most worth opening with."""
        number = [sum(cell.series == name for cell in self.catalogue) for name in series]
        return series[number.index(max(number))]

    @param.depends("series", watch=True)
    def _series_changed(self):
        self._offer(self.mu)

    def _offer(self, mu):
        """Offer the series' values of μ and select one: the given if there, else nearest 0.1."""
        values = [cell.mu for cell in self.cells()] or [None]
        if mu not in values:
            mu = min(values, key=lambda value: abs((value or 0) - 0.1))
        with param.parameterized.discard_events(self):
            self.param.mu.objects = values
            self.mu = mu
        self.param.trigger("mu")

    @param.depends("mu", watch=True)
    def _mu_changed(self):
        cell = next((cell for cell in self.cells() if cell.mu == self.mu), None)
        if cell is None:
            self.replay = None
            return
        try:
            replay = self.library.replay(cell)
        except InputError as error:
            self.message = str(error)
            return
        shipped = cell.store is self.library.shipped
        where = "finished results" if shipped else "your cache"
        self.source = f"μ = {cell.mu:g}, {cell.series} (from {where})"
        self.replay = replay

    def compute(self, n, mu, seed, states, relax):
        """Show the walk of these parameters: from a store, or computed in the background."""
        self.message = ""
        if self.running:
            return
        try:
            packing = study.packing_parameters(n, mu, seed)
            if packing["n"] < 3:
                raise InputError(f"a packing needs at least 3 disks, got {n}")
            params = study.walk_parameters(packing, states, seed, relax=relax)
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
            self.refresh(select=job.cell)

    def cancel(self):
        """End the computation, if there is one; nothing of it is kept but a finished packing."""
        if self.job is not None:
            self.job.cancel()
