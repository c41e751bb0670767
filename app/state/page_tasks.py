"""The computations of one page: its tasks, and their intermediate results."""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any

import param

from ..background.jobs import Job, Pool, Task, Visitor, computing, reading
from ..results import compute
from ..results.library import Library, Shown
from ..results.progress_feed import Following
from ..results.selection import Selection


class Work(param.Parameterized):
    """The tasks of one page, which end with it, independent of the view."""

    busy = param.Boolean(doc="whether any task is running")
    message = param.String(doc="one line about what went wrong, or empty")
    progress = param.Dict(default={}, doc="fraction, words and keeps of `foremost`; {}: none")
    live = param.Parameter(doc="the Following of what is being computed, or None")
    arriving = param.Parameter(doc="exact bounds found so far, see compute.exact; None: no search")
    moving = param.Boolean(doc="whether a packing is on screen that is being compressed")
    fourfold = param.Integer(doc="how often the walk under way has grown fourfold: new axes")

    def __init__(
        self,
        wake: Callable[[Callable[[], object]], object] | None = None,
        visitor: Visitor | None = None,
    ) -> None:
        """wake(function): call a function soon on the page's thread; see jobs.Task."""
        super().__init__()  # type: ignore[no-untyped-call]  # param has no type hints
        self._wake, self._visitor = wake, visitor
        self.tasks: list[Task] = []
        self._ahead: list[Job] = []
        self._closed = False
        self.computation, self.reader = self.task(), self.task(reading)
        self.loading = self.task()
        self.looking, self.measuring = self.task(reading), self.task()  # for the volume of S
        self.computation.param.watch(self._arrive, ["running", "fraction"])

    # Tasks

    def piecewise(self, pieces: Iterator[Any]) -> None:
        """Run a generator to its end; other pages are served between its steps."""
        if self._wake is None:
            for _ in pieces:
                pass
        elif next(pieces, "end") != "end":
            self._wake(partial(self.piecewise, pieces))

    def task(self, pool: Pool = computing, *, reported: bool = True) -> Task:
        """A new Task of this page: work off the event loop, ended when the page is closed.

        reported: whether the page reports its errors; otherwise the caller does.
        """
        task = Task(pool, self._wake, self._visitor)
        if reported:
            task.param.watch(self._tell, "message")
        task.param.watch(self._count, "running")
        self.tasks.append(task)
        if self._closed:
            task.close()
        return task

    def read_ahead(self, works: Iterable[Callable[[Job], Any]]) -> None:
        """Read these in advance, instead of earlier ones."""
        for job in self._ahead:
            job.cancel()
        self._ahead = [Job(work, reading) for work in works]

    def poll(self) -> None:
        """Update the progress of all tasks."""
        for task in self.tasks:
            task.poll()
        self._report()

    def cancel(self) -> None:
        """End all running work of the page."""
        for task in self.tasks:
            task.cancel()
        for job in self._ahead:
            job.cancel()

    def close(self) -> None:
        """End all work of the page for good."""
        self._closed = True
        self.cancel()
        for task in self.tasks:
            task.close()

    def say(self, line: str) -> None:
        """Report a problem."""
        self.message = line

    def _tell(self, event: Any) -> None:
        if event.new:
            self.say(event.new)

    def _count(self, event: Any) -> None:
        self.busy = any(task.running for task in self.tasks)
        self._report()

    @property
    def foremost(self) -> Task | None:
        """The first computation under way, which the page reports; reading is not reported."""
        return next((one for one in self.tasks if one.running and one.pool is computing), None)

    def _report(self) -> None:
        task, now = self.foremost, {}
        if task is not None and task.job is not None:
            now = {"fraction": task.fraction, "words": task.words, "keeps": task.job.keeps}
        if now != self.progress:
            self.progress = now

    # Intermediate results

    def compute(
        self, library: Library, selection: Selection, done: Callable[[Shown], object]
    ) -> None:
        """Compute states in the background; `live` follows them as they are found."""
        self.param.update(live=Following(selection), arriving=None)
        self.computation.start(compute.states(library, selection), done)

    def compute_exact(
        self, library: Library, shown: Shown, done: Callable[[Shown], object]
    ) -> None:
        """Compute exact intervals in the background; `arriving` has them as they are found."""
        self.message = ""
        self.computation.start(compute.exact(library, shown), done)
        self.arriving = {}

    def _arrive(self, *events: Any) -> None:
        task = self.computation
        if self.arriving is None or not task.running:
            self.arriving = None
        elif task.job is not None and task.job.so_far is not None:
            self.arriving = {side: found.copy() for side, found in task.job.so_far.items()}

    def shown(self, selection: Selection) -> None:
        """These states are on screen: computations of others are no longer awaited."""
        if self.live is not None and not self.live.selection.names(selection):
            self.computation.cancel()
        self.param.update(live=None, moving=False, arriving=None)

    def follow(self) -> Following | None:
        """The Following of the current computation, or None; ended ones are dropped."""
        if not self.computation.running:
            self.param.update(live=None, moving=False)
        return self.live
