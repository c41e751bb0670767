"""What is being computed for one page: its tasks, and what is seen of them while they run."""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any

import param

from ..background.jobs import Job, Pool, Task, Visitor, computing, reading
from ..results import compute
from ..results.library import Library, Shown
from ..results.progress_feed import Arriving, Following
from ..results.selection import Selection


class Work(param.Parameterized):
    """The tasks of one page, which end with it; what is on screen it does not know."""

    busy = param.Boolean(doc="whether any task is running")
    message = param.String(doc="one line about what went wrong, or empty")
    live = param.Parameter(doc="the Following of what is being computed, or None")
    arriving = param.Parameter(doc="the Arriving of exact intervals under way, or None")
    moving = param.Boolean(doc="whether a packing is on screen that is being compressed")
    fourfold = param.Integer(doc="how often the walk under way has grown fourfold: new axes")

    def __init__(
        self,
        wake: Callable[[Callable[[], object]], object] | None = None,
        visitor: Visitor | None = None,
    ) -> None:
        """wake(function): call a function soon on the page's thread; see jobs.Task."""
        super().__init__()  # type: ignore[no-untyped-call]  # param says no types
        self._wake, self._visitor = wake, visitor
        self.tasks: list[Task] = []
        self._ahead: list[Job] = []
        self._closed = False
        self.computation, self.reader = self.task(), self.task(reading)
        self.loading = self.task()
        self.looking, self.measuring = self.task(reading), self.task()  # for the volume of S

    # Tasks

    def piecewise(self, pieces: Iterator[Any]) -> None:
        """Have a generator run to its end; other pages are served between its pieces."""
        if self._wake is None:
            for _ in pieces:
                pass
        elif next(pieces, "end") != "end":
            self._wake(partial(self.piecewise, pieces))

    def task(self, pool: Pool = computing, *, told: bool = True) -> Task:
        """A new Task of this page: work off the event loop, ended when the page is closed.

        told: whether the page tells what goes wrong in it; else whoever asks for it does.
        """
        task = Task(pool, self._wake, self._visitor)
        if told:
            task.param.watch(self._tell, "message")
        task.param.watch(self._count, "running")
        self.tasks.append(task)
        if self._closed:
            task.close()
        return task

    def read_ahead(self, works: Iterable[Callable[[Job], Any]]) -> None:
        """Have this read meanwhile, instead of what was to be read before."""
        for job in self._ahead:
            job.cancel()
        self._ahead = [Job(work, reading) for work in works]

    def poll(self) -> None:
        """Take over the progress of all tasks."""
        for task in self.tasks:
            task.poll()

    def cancel(self) -> None:
        """End all work of the page that is under way."""
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

    def _tell(self, event: Any) -> None:
        if event.new:
            self.message = event.new

    def _count(self, event: Any) -> None:
        self.busy = any(task.running for task in self.tasks)

    # What is seen while it is computed

    def compute(
        self, library: Library, selection: Selection, done: Callable[[Shown], object]
    ) -> None:
        """Compute states in the background; `live` has them as they are found."""
        self.param.update(live=Following(selection), arriving=None)
        self.computation.start(compute.states(library, selection), done)

    def computes(self, selection: Selection) -> bool:
        """Whether this is what is being computed."""
        return self.computation.running and self.live and self.live.selection == selection

    def compute_exact(
        self, library: Library, shown: Shown, done: Callable[[Shown], object]
    ) -> None:
        """Compute exact intervals in the background; `arriving` has them as they are found."""
        self.message = ""
        self.computation.start(compute.exact(library, shown), done)
        self.arriving = Arriving(shown.cell.selection.intervals)

    def shown(self, selection: Selection) -> None:
        """These states are on screen: what is computed for others is waited for no more."""
        if self.live is not None and not self.live.selection.names(selection):
            self.computation.cancel()
        self.param.update(live=None, moving=False, arriving=None)

    def follow(self) -> Following | Arriving | None:
        """The Following or Arriving of what is computed, or None; what has ended is dropped."""
        if not self.computation.running:
            self.param.update(live=None, moving=False, arriving=None)
        return self.live or self.arriving
