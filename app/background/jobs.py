"""Work off the event loop: threads run it, and the page polls its progress.

The kernels release the interpreter lock, so a thread blocks neither the page nor other threads. Of
jobs that need the same thing, one computes it, in its turn, as long as any of them needs it.
"""

from __future__ import annotations

import logging
import math
import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple
from weakref import WeakSet, WeakValueDictionary

import param

from granforce.records import Cancelled, InputError
from granforce.system import cancelling

from .gc_pauses import settle
from .limits import LIMITS
from .notifications import as_one

# Time, s, and part of a stage after which its end can be estimated: earlier, it is off by factors.
ESTIMATED, ESTIMATED_PART = 1.0, 0.05
LONGEST_LINE = 500  # characters of an error message on a page
# Options of the command and arguments of the function in a message, such as " (--walls floor, or
# walls=)", and what the page has instead, where its name is not the same.
OPTIONS = re.compile(r" \((?:(?:[^()]* )?(--[a-z-]+)|\w+=)[^()]*\)")
INSTEAD = {"--ensemble-mu": " (Friction μ)", "--known": " (select the contact and press H)"}
LONG = 3.0  # s after which a job is a long one
_ASK = 0.2  # s between two polls, and for which a job waits for its turn before it frees the thread
WAITING = "waiting for a free processor"  # stage of a job that has not begun

_log = logging.getLogger(__name__)
_turns: WeakValueDictionary[str, Turn] = WeakValueDictionary()
_turns_lock = threading.Lock()


class Later(Exception):
    """Raised by work that cannot continue yet; its job goes to the end of the queue."""


class Turn:
    """The turn among jobs that need the thing with one name, and the list of these jobs."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.job: Job | None = None
        self._wanting: WeakSet[Job] = WeakSet()
        self._guard = threading.Lock()

    def join(self, job: Job) -> None:
        """Add a job to those that need it."""
        with self._guard:
            self._wanting.add(job)

    def wanted(self, without: Job) -> bool:
        """Whether another job needs it that is neither cancelled nor ended."""
        with self._guard:
            others = [job for job in self._wanting if job is not without]
        return not all(job.cancelled() or job.ended for job in others)


def turn_of(named: Any) -> Turn:
    """The Turn of a name, which exists while it is referenced."""
    with _turns_lock:
        return _turns.setdefault(repr(named), Turn())


@contextmanager
def in_turn(job: Job, *named: Any) -> Iterator[None]:
    """Run one job at a time for each name: the next finds the result of the first in the cache.

    Raises Later while another job has the turn, so that a waiting job frees its thread.
    """
    turn = turn_of(named)
    turn.join(job)
    if not turn.lock.acquire(timeout=_ASK):
        job.follow(turn.job)
        raise Later
    turn.job = job
    job.begin("starting")
    job.turns.append(turn)
    try:
        yield
    finally:
        job.turns.remove(turn)
        turn.job = None
        turn.lock.release()


class Visitor(NamedTuple):
    """The owner of a job; pages from the same address share its quota."""

    address: str
    page: str


class Pool:
    """Threads that run jobs; they end with the server, whatever the jobs are doing.

    Waiting jobs of the visitors with the fewest running jobs come first. If long jobs occupy all
    threads, a visitor without a running job does not wait for them: `extra` more threads run such
    jobs, and all jobs then slow each other down.
    """

    def __init__(
        self, workers: int, name: str, *, extra: int = 0, seconds: float | None = None
    ) -> None:
        """seconds: time limit of a job, or None."""
        self.seconds = seconds
        self._workers, self._extra = workers, extra
        self._waiting: list[Job] = []
        self._running: list[tuple[Job, float]] = []  # with their start times
        self._changed = threading.Condition()
        for k in range(workers + extra):
            # Not concurrent.futures: its threads would keep a server that is to end waiting.
            threading.Thread(target=self._serve, name=f"{name}-{k}", daemon=True).start()

    def submit(self, job: Job) -> None:
        """Have job.run() called when a thread is free."""
        with self._changed:
            if not job.ended:
                self._waiting.append(job)
                self._changed.notify_all()

    def before(self, job: Job) -> int:
        """Number of jobs before a waiting one: running jobs, and jobs ahead of it in the queue."""
        with self._changed:
            waiting = [other for other in self._waiting if not other.ended]
            if job not in waiting:
                return 0
            waiting.sort(key=self._under_way)
            return len(self._running) + waiting.index(job)

    def _serve(self) -> None:
        while True:
            with self._changed:
                while (job := self._next()) is None:
                    # No event signals that a job has become long or may be retried.
                    self._changed.wait(_ASK if self._waiting else None)
                running = job, time.monotonic()
                self._running.append(running)
            try:
                job.run()
                settle()
            except BaseException:  # a thread that ended would be missing for all visitors
                _log.exception("a job failed outside its work")
            finally:
                with self._changed:
                    self._running.remove(running)
                    self._changed.notify_all()
                del job, running  # otherwise the thread would keep the job until the next one

    def _next(self) -> Job | None:
        """Remove and return the next job to run, or None if none can run yet."""
        now = time.monotonic()
        self._waiting = [job for job in self._waiting if not job.ended]
        ready = [job for job in self._waiting if job.not_before <= now]
        if not ready or len(self._running) >= self._workers + self._extra:
            return None
        job = min(ready, key=self._under_way)  # the earliest of several
        if len(self._running) >= self._workers:
            of_address, of_page = self._under_way(job)
            long = sum(now - since > LONG for _, since in self._running)
            # One thread is reserved for other addresses, however many pages one address has.
            if long < self._workers or of_page or of_address > self._workers:
                return None
        self._waiting.remove(job)
        return job

    def _under_way(self, job: Job) -> tuple[int, int]:
        """Number of running jobs of its visitor's address, and of its page."""
        if job.visitor is None:
            return 0, 0
        others = [other.visitor for other, _ in self._running if other.visitor is not None]
        of_address = sum(other.address == job.visitor.address for other in others)
        return of_address, sum(other == job.visitor for other in others)


# For all users together: more threads would only slow each other down.
computing = Pool(
    LIMITS.computations, "granforce-compute", extra=LIMITS.computations, seconds=LIMITS.seconds
)
# Reading stores must not wait for a computation to end.
reading = Pool(2, "granforce-read")


@dataclass(frozen=True)
class Work:
    """Work for a Job that takes turns: `wants` names what it needs, so that others wait for it."""

    run: Callable[[Job], Any]
    wants: tuple[Any, ...]

    def __call__(self, job: Job) -> Any:
        """Do it."""
        return self.run(job)


class Job:
    """One piece of work. Its thread writes the fields, and the page reads them.

    work(job) returns the result; if it sets `job.keeps`, `stop` ends it with the partial result. It
    may pass `job.tell` as progress callback and set `job.stage` to a description of its current
    step. It ends soon after `cancel`, unless other jobs need its result. If it raises Later it is
    called again. Work that takes turns is a Work, which names what it needs.
    """

    def __init__(
        self,
        work: Callable[[Job], Any],
        pool: Pool = computing,
        on_end: Callable[[], object] | None = None,
        visitor: Visitor | None = None,
    ) -> None:
        """on_end(): called from another thread when the job has ended.

        visitor: its owner; None: the job itself.
        """
        self.stage = WAITING
        self.visitor = visitor
        self.not_before = 0.0  # earliest time to run (again), as time.monotonic
        self._until = math.inf  # when it is ended
        self.fraction: float | None = None  # done, 0 … 1; None if unknown
        self._entering = threading.Lock()  # so that nobody sees a stage with the bar of another
        self._left: float | None = None  # s of this stage, by its progress
        self._longest = False
        self._expected = math.inf  # its end, as time.perf_counter, before there is progress
        self.error = ""
        self.so_far: Any = None  # its partial result, if the work provides one
        self.result: Any = None
        self._work: Callable[[Job], Any] | None = work
        self._pool, self._on_end = pool, on_end
        self._counted: tuple[float, float] | None = None  # time and work done at the first `tell`
        self._cancel, self._ended = threading.Event(), threading.Event()
        self.keeps = False  # whether its partial result is a valid result
        self._stop = threading.Event()
        self.turns: list[Turn] = []  # its current turns
        self._wants = [turn_of(named) for named in (work.wants if isinstance(work, Work) else ())]
        for turn in self._wants:
            turn.join(self)
        self._taken = threading.Lock()  # by the thread that runs it, or the first caller of cancel
        pool.submit(self)

    @property
    def doing(self) -> str:
        """Its current step, or its place in the queue, in words."""
        count = self._pool.before(self) if self.stage == WAITING else 0
        if not count:
            return self.stage
        return f"{WAITING}: {count} {'computation' if count == 1 else 'computations'} before it"

    @property
    def words(self) -> str:
        """Its current step and, if it can be estimated, the time left, in words."""
        left = self.seconds_left
        about = "up to" if self._longest else "about"
        return self.doing + ("" if left is None else f" — {about} {_duration(left)} more")

    @property
    def progress(self) -> dict[str, Any]:
        """Its fraction and words, of the same stage."""
        with self._entering:
            return {"fraction": self.fraction, "words": self.words}

    def begin(self, stage: str, expected: float = math.inf, longest: bool = False) -> None:
        """Enter a stage, whose bar and remaining time start anew.

        expected: its duration, s, to be said until its progress gives a better estimate; longest:
        whether most take less, so that it is a limit.
        """
        with self._entering:
            self.stage, self._counted, self._longest = stage, None, longest
            self.fraction = self._left = None
            self._expected = time.perf_counter() + expected

    def follow(self, other: Job | None) -> None:
        """Take the progress of the other job, which works for both."""
        with self._entering:
            self.stage = "already under way"
            if other is not None:
                self.stage += f": {other.stage}"
                self.fraction, self._longest = other.fraction, other._longest
                self._left, self.so_far = other.seconds_left, other.so_far

    @property
    def seconds_left(self) -> float | None:
        """Seconds left of this stage; None if unknown, or if it takes longer than expected."""
        left = self._expected - time.perf_counter()
        return left if self._left is None and 0 < left < math.inf else self._left

    def tell(self, done: float, total: float | None) -> None:
        """Progress of the stage.

        Within a stage the bar never goes back, even if the total grows. Without a total, the bar
        stays where it is and nothing is estimated.
        """
        if total is None:
            self._left = None
            return
        self.fraction = max(min(1.0, done / total), self.fraction or 0.0)
        now = time.perf_counter()
        if self._counted is None:
            self._counted = now, done
        spent, new = now - self._counted[0], done - self._counted[1]
        known = new > ESTIMATED_PART * (total - self._counted[1]) and spent > ESTIMATED
        self._left = spent / new * max(0.0, total - done) if known else None

    def cancel(self) -> None:
        """Request its end: at once if not yet begun, else within a second unless it is needed."""
        self._cancel.set()
        if self._taken.acquire(blocking=False):
            self._end()

    def stop(self) -> None:
        """Request its end with the partial result, unless other jobs need more."""
        self._stop.set()

    def enough(self) -> bool:
        """Whether the partial result is all that is needed; afterwards cancelling has no effect."""
        return self._stop.is_set() and not self._wanted

    def cancelled(self) -> bool:
        """Whether its end was requested."""
        return self._cancel.is_set()

    @property
    def _wanted(self) -> bool:
        """Whether another job needs what it is computing."""
        return any(turn.wanted(self) for turn in list(self.turns))

    def _ends(self) -> bool:
        """Whether its work is to end: nobody needs it, or it exceeds the time limit."""
        return (self.cancelled() and not self._wanted) or time.monotonic() > self._until

    @property
    def ended(self) -> bool:
        """Whether it has ended, for any reason."""
        return self._ended.is_set()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait up to a time in s for its end; return whether it ended. For tests and scripts."""
        return self._ended.wait(timeout)

    def run(self) -> None:
        """Do the work unless cancelled, and end; called by a thread of the pool.

        Whoever holds `_taken` may end the job: this thread, or the first `cancel` before it runs.
        """
        if not self._taken.acquire(blocking=False):
            return
        if self.stage == WAITING:
            self.begin("starting")
        try:
            work = self._work
            if work is not None and not self.cancelled():
                self._until = time.monotonic() + (self._pool.seconds or math.inf)
                with cancelling.scope(self._ends):
                    self.result = work(self)
        except Later:
            self.not_before = time.monotonic() + _ASK  # meanwhile the thread is free for others
            self._taken.release()
            self._pool.submit(self)
            if self.cancelled():  # cancelled meanwhile: it need not wait for its turn
                self.cancel()
            return
        except Cancelled:
            # By the time limit; or nobody needs it any more, or the server is ending: no words.
            if time.monotonic() > self._until and not self.cancelled():
                self.error = (
                    f"this took longer than the {self._pool.seconds:g} s allowed per computation "
                    "on this server: choose smaller values, or run it on your computer (Copy CLI "
                    "command)"
                )
        except BaseException as error:  # reported on the page, where it would otherwise be lost
            self.error = error_line(error)
        self._end()

    def _end(self) -> None:
        self._work = None  # it may refer to large objects
        self._ended.set()
        on_end, self._on_end = self._on_end, None
        try:
            if on_end is not None:
                on_end()
        except Exception:
            _log.exception("the end of a job could not be reported")


def _duration(seconds: float) -> str:
    """In whole seconds below ten, tens of seconds below two minutes, and minutes."""
    if seconds < 10:
        return f"{max(1.0, seconds):.0f} s"
    return f"{round(seconds, -1):.0f} s" if seconds < 115 else f"{seconds / 60:.0f} min"


def error_line(error: BaseException) -> str:
    """An error in one line for the page."""
    line = OPTIONS.sub(lambda found: INSTEAD.get(found[1], ""), " ".join(str(error).split()))
    line = line[:LONGEST_LINE]
    if isinstance(error, InputError):
        return line
    return f"the computation failed: {type(error).__name__}: {line}"


class Task(param.Parameterized):
    """One kind of work as a view sees it: at most one job at a time; a new one replaces it.

    Jobs run in threads, but the parameters change only within `poll`, on the page's own thread.
    """

    running = param.Boolean()
    fraction = param.Number(default=None, allow_None=True, doc="part done, None if unknown")
    words = param.String(doc="step of the running job and time left, or empty")
    dismissed = param.Boolean(doc="triggered when the visitor cancels; never stays True")
    message = param.String(doc="one line about what went wrong, or empty")

    def __init__(
        self,
        pool: Pool = computing,
        wake: Callable[[Callable[[], object]], object] | None = None,
        visitor: Visitor | None = None,
        **params: Any,
    ) -> None:
        """wake(function): call a function soon on the page's thread; without it, call `poll`."""
        super().__init__(**params)  # type: ignore[no-untyped-call]  # param has no type hints
        self.pool, self._wake, self._visitor = pool, wake, visitor
        self.job: Job | None = None  # the running job
        self._done: Callable[[Any], object] | None = None
        self._closed = False

    def start(
        self, work: Callable[[Job], Any], done: Callable[[Any], object] | None = None
    ) -> None:
        """Begin work(job), as for Job; done(result) is called within `poll` unless it failed.

        Nothing begins once the task is closed.
        """
        self.cancel()
        if self._closed:
            return
        on_end = None if self._wake is None else partial(self._wake, self.poll)
        self.job, self._done = Job(work, self.pool, on_end, self._visitor), done
        self.param.update(running=True, fraction=None, words=self.job.words, message="")

    def poll(self) -> None:
        """Update the progress of the job and, when it has ended, its result."""
        job = self.job
        if job is None:
            return
        if job.cancelled():  # it ends soon, or continues for others
            self.job = self._done = None
            self.param.update(running=False, words="", message="")
            return
        if not job.ended:
            self.param.update(**job.progress)
            return
        done, self.job, self._done = self._done, None, None
        # Announced together, so that the work is never over without its result.
        with as_one(self):
            self.param.update(running=False, words="", message=job.error)
            if done is not None and not job.error:
                try:
                    done(job.result)
                except Exception as error:
                    _log.exception("a result could not be shown")
                    self.message = error_line(error)

    def cancel(self) -> None:
        """Request the end of the job; its result is dropped."""
        if self.job is not None:
            self.job.cancel()

    def dismiss(self) -> None:
        """Cancel on the visitor's request; observers then restore the previous view."""
        self.cancel()
        self.poll()
        self.dismissed = True
        self.dismissed = False

    def stop(self) -> None:
        """Request the end of the job with its partial result."""
        if self.job is not None and self.job.keeps:
            self.job.stop()

    def close(self) -> None:
        """End the job and accept no other: the page is closed."""
        self._closed = True
        self.cancel()
