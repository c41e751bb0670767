"""Work off the event loop: threads run it, the page asks now and then how far it is.

The kernels release the interpreter lock, so a thread keeps neither the page nor others waiting.
"""

import threading
import time
from queue import SimpleQueue

import param

from granforce.records import Cancelled, InputError

from .garbage import settle
from .limits import LIMITS


class Pool:
    """Threads that run jobs in turn; they end with the server, whatever they are doing."""

    def __init__(self, workers, name):
        self._jobs = SimpleQueue()
        for k in range(workers):
            # Not concurrent.futures: its threads would keep a server that is to end waiting.
            threading.Thread(target=self._serve, name=f"{name}-{k}", daemon=True).start()

    def submit(self, job):
        """Have job.run() called when a thread is free."""
        self._jobs.put(job)

    def _serve(self):
        while True:
            self._jobs.get().run()
            settle()


# All users together: more would only slow each other down.
computing = Pool(LIMITS.computations, "granforce-compute")
# What only reads stores must not wait for a computation to end.
reading = Pool(2, "granforce-read")


class Job:
    """One piece of work under way. Fields are written by its thread and read by the page.

    work(job) returns the result. It may give `job.tell` as progress callback, `job.cancelled` as
    cancel callable, and set `job.stage` to say what it is doing.
    """

    def __init__(self, work, pool=computing, on_end=None):
        """on_end(): called from another thread when the job has ended."""
        self.stage = "waiting for a free processor"
        self.fraction = None  # done, 0 … 1; None where unknown
        self.seconds_left = None  # of this stage
        self.error = ""
        self.result = None
        self._work, self._on_end = work, on_end
        self._begun = time.perf_counter()
        self._cancel, self._ended = threading.Event(), threading.Event()
        self._taken = threading.Lock()  # by the thread that runs it, or by whoever cancels it first
        pool.submit(self)

    def begin(self, stage):
        """Enter a stage; its time left is counted from here."""
        self.stage, self._begun = stage, time.perf_counter()
        self.seconds_left = None

    def tell(self, done, total, *, part=(0.0, 1.0)):
        """Progress of the stage; part: where on the whole bar the stage begins and ends."""
        begin, end = part
        self.fraction = begin + (end - begin) * min(1.0, done / total)
        spent = time.perf_counter() - self._begun
        self.seconds_left = spent / done * (total - done) if 0 < done <= total else None

    def cancel(self):
        """Ask it to end; it does so within about a second, or at once if it has not begun."""
        self._cancel.set()
        if self._taken.acquire(blocking=False):
            self._end()

    def cancelled(self):
        """Whether it was asked to end."""
        return self._cancel.is_set()

    @property
    def ended(self):
        """Whether it has ended, one way or another."""
        return self._ended.is_set()

    def wait(self, timeout=None):
        """Whether it ends in time, in s; for tests and scripts."""
        return self._ended.wait(timeout)

    def run(self):
        """Do the work, unless cancelled before; called by a thread of the pool."""
        if not self._taken.acquire(blocking=False):
            return
        self.begin("starting")
        try:
            self.result = self._work(self)
        except Cancelled:
            pass
        except InputError as error:
            self.error = str(error)
        except Exception as error:  # told on the page, or nobody would see it
            self.error = f"the computation failed: {type(error).__name__}: {error}"
        finally:
            self._end()

    def _end(self):
        self._work = None  # what it refers to may be large
        self._ended.set()
        if self._on_end is not None:
            self._on_end()


class Task(param.Parameterized):
    """One kind of work as a view sees it: at most one job at a time, a later one replaces it.

    Jobs run in threads, but the parameters change only within `poll`, on the page's own thread.
    """

    running = param.Boolean()
    stage = param.String(doc="what the job is doing")
    fraction = param.Number(default=None, allow_None=True, doc="part done, None if unknown")
    seconds_left = param.Number(default=None, allow_None=True)
    message = param.String(doc="one line about what went wrong, or empty")

    def __init__(self, pool=computing, wake=None, **params):
        """wake(function): call a function soon on the page's thread; without it, poll yourself."""
        super().__init__(**params)
        self._pool, self._wake = pool, wake
        self._job = self._done = None

    def start(self, work, done=None):
        """Begin work(job), as for Job; done(result) follows within `poll` unless it failed."""
        self.cancel()
        on_end = None if self._wake is None else lambda: self._wake(self.poll)
        self._job, self._done = Job(work, self._pool, on_end), done
        self.param.update(
            running=True, stage=self._job.stage, fraction=None, seconds_left=None, message=""
        )

    def poll(self):
        """Take over how far the job is; when it has ended, its result."""
        job = self._job
        if job is None:
            return
        if not job.ended:
            self.param.update(
                stage="cancelling …" if job.cancelled() else job.stage,
                fraction=job.fraction,
                seconds_left=job.seconds_left,
            )
            return
        done, self._job, self._done = self._done, None, None
        self.param.update(running=False, message=job.error)
        if done is not None and not job.error and not job.cancelled():
            done(job.result)

    def cancel(self):
        """Ask the job to end; its result is dropped."""
        if self._job is not None:
            self._job.cancel()
