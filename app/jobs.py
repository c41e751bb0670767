"""Walks computed in the background: threads run them, the page asks now and then how far they are.

The kernels release the interpreter lock, so a thread keeps neither the page nor others waiting.
"""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

from granforce import study
from granforce.records import Cancelled, InputError

# All users together: more would only slow each other down.
_pool = ThreadPoolExecutor(max_workers=2, thread_name_prefix="granforce")

# A part of the bar for the compaction; it is never told to be full before it ends.
PACKING_SHARE, NEARLY = 0.5, 0.95


class Job:
    """One walk under way. Fields are written by its thread and read by the page."""

    def __init__(self, library, params):
        self.library, self.params = library, params
        self.stage = "waiting for a free processor"
        self.fraction = None  # done, 0 … 1; None where unknown
        self.seconds_left = None  # of this stage
        self.error = ""
        self.cell = None  # the result
        self.ended = False
        self._begun = time.perf_counter()
        self._steps = None  # of the compaction, as expected
        self._cancelled = threading.Event()
        self._future = _pool.submit(self._run)

    def cancel(self):
        """Ask it to end; it does so within about a second."""
        self._cancelled.set()
        if self._future.cancel():
            self.ended = True

    @property
    def cancelled(self):
        """Whether it was asked to end."""
        return self._cancelled.is_set()

    def wait(self, timeout=None):
        """Until it ends; for tests and scripts."""
        self._future.result(timeout)

    def _run(self):
        try:
            self.cell = self._compute()
        except Cancelled:
            pass
        except InputError as error:
            self.error = str(error)
        except Exception as error:  # told on the page, or nobody would see it
            self.error = f"the computation failed: {type(error).__name__}: {error}"
        finally:
            self.ended = True

    def _compute(self):
        cell = self.library.find(self.params)
        if cell is not None:
            return cell
        if self.library.cache is None:
            raise InputError("no cache folder can be written, so nothing can be computed")
        packing = self.params["packing"]
        self.library.lend_packing(packing)
        self._steps = self.library.expected_steps(packing["n"], packing["mu"])
        self._begin("compaction")
        options = {"cancel": self._cancelled.is_set}
        study.get_packing(self.library.cache, packing, progress=self._packing_told, **options)
        self._begin("random walk")
        study.get_walk(self.library.cache, self.params, progress=self._walk_told, **options)
        return self.library.find(self.params)

    def _begin(self, stage):
        self.stage, self._begun = stage, time.perf_counter()
        self.seconds_left = None

    def _packing_told(self, step, message):
        self.stage = f"compaction, step {step}: {message}"
        if self._steps:
            self.fraction = PACKING_SHARE * min(NEARLY, step / self._steps)
            self._tell_time_left(step, self._steps)

    def _walk_told(self, done, total):
        self.stage = f"random walk, {done} of {total} states"
        self.fraction = PACKING_SHARE + (1 - PACKING_SHARE) * done / total
        self._tell_time_left(done, total)

    def _tell_time_left(self, done, total):
        spent = time.perf_counter() - self._begun
        self.seconds_left = spent / done * (total - done) if 0 < done <= total else None
