"""Cells computed by processes of this machine, which end with the process that began them."""

from __future__ import annotations

import multiprocessing
import os
import signal
import socket
import threading
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from granforce.records import InputError, ResultWarning
from granforce.study.cells import StudyCell, get
from granforce.study.store import open_store
from granforce.system.terminal import one_line

TRIES = 3  # attempts at a cell whose worker died: the cell may be the cause

# Work for workers: path of the store, cell, dtypes.
Tasks = dict[int, tuple[str, StudyCell, Mapping[str, str] | None]]

_SINGLE = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class Waits(NamedTuple):
    """Dependencies of cells: {cell: the cell of its packing}, and the failed cells."""

    needs: Mapping[int, int]
    failed: Mapping[int, str]

    def ready(self, todo: Sequence[int], left: Collection[int]) -> int | None:
        """The first cell to do whose packing is not among those left; None if all must wait."""
        return next((k for k in todo if self.needs.get(k) not in left), None)

    def lost(self, k: int) -> bool:
        """Whether the packing of a cell has failed."""
        return self.needs.get(k) in self.failed


class Calls(NamedTuple):
    """What running cells calls."""

    finished: Callable[[int, Callable[[], bool]], object]  # a cell, and whether it was stored
    advanced: Callable[[float], object]  # the number of cells that are done, and parts of them
    enough: Callable[[], bool]  # whether to start no further cell


def lost() -> NoReturn:
    raise InputError(f"worker processes died {TRIES} times while computing this cell or others")


def one_pool(tasks: Tasks, waits: Waits, workers: int, calls: Calls, before: int) -> Tasks:
    """Run tasks in processes, `before` of which have ended; return those left by a dead worker."""
    context = multiprocessing.get_context("spawn")
    counter = context.Value("d", _NONE_BEGAN)
    left, todo, broken = dict(tasks), list(tasks), False
    waiting: dict[Future[bool], int] = {}
    workers = min(workers, len(tasks))
    pool = ProcessPoolExecutor(workers, context, initializer=_share, initargs=(counter,))
    try:
        while True:
            # One for each worker: the pool would start every task it was given.
            while len(waiting) < workers and not broken and not calls.enough():
                k = waits.ready(todo, left)
                if k is None:
                    break
                todo.remove(k)
                if waits.lost(k):
                    del left[k]
                    continue
                with _single_threaded(), _interrupts_blocked():
                    try:
                        waiting[pool.submit(run_cell, *tasks[k])] = k
                    except BrokenProcessPool:
                        broken = True
            if not waiting:
                break
            ended, _ = wait(waiting, timeout=0.5, return_when=FIRST_COMPLETED)
            for future in ended:
                k = waiting.pop(future)
                if isinstance(future.exception(), BrokenProcessPool):
                    broken = True
                else:
                    calls.finished(k, future.result)
                    del left[k]
            calls.advanced(before + max(0.0, counter.value))
        if broken and counter.value == _NONE_BEGAN:
            raise InputError(
                "worker processes ended before they began: use workers=1, or call this in a script "
                'that is a file (not read from stdin), under if __name__ == "__main__":'
            )
    except BaseException:
        # Workers would continue the current cell, whose result is lost anyway.
        for process in list(pool._processes.values()):
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return left


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Within, started processes use one thread in linear algebra: cells are shared, not rows."""
    before = {name: os.environ.get(name) for name in _SINGLE}
    os.environ.update(dict.fromkeys(_SINGLE, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Within, started processes do not receive Ctrl-C, which goes to the whole process group.

    Otherwise those that still import modules would print tracebacks.
    """
    if not hasattr(signal, "pthread_sigmask"):  # on Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_counter = None
_NONE_BEGAN = -1.0  # value of the counter before a worker has begun


def _share(counter: Any) -> None:
    global _counter
    _counter = counter
    with counter.get_lock():
        counter.value = max(0.0, counter.value)
    # Ctrl-C goes to the whole process group: the parent ends the workers silently.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    warnings.formatwarning = one_line
    warnings.simplefilter("ignore", ResultWarning)  # the stored results say so


def _end_with_parent() -> None:
    """End a worker whose parent was killed, as nobody needs its results."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


def _counting() -> Callable[[float], object]:
    """A function of the part of a cell that is done, which adds to the workers' counter."""
    reported = 0.0

    def count(part: float) -> None:
        nonlocal reported
        if _counter is not None:
            with _counter.get_lock():
                _counter.value += part - reported
            reported = part

    return count


def run_cell(
    path: str | Path,
    cell: StudyCell,
    dtypes: Mapping[str, str] | None = None,
    advanced: Callable[[float], object] | None = None,
) -> bool:
    """Compute one cell into the store at path; return whether it was stored.

    advanced(part): called with the part of it that is done; None: in a worker, which counts for
    its parent.
    """
    if not Path(path, "zarr.json").exists():
        raise InputError(f"no store at {path} on {socket.gethostname()}: the folder must be shared")
    tell = _counting() if advanced is None else advanced

    def count(done: float, total: float | None) -> None:  # None: for a compaction
        if total:
            tell(min(done / total, 1.0))

    store = open_store(path)
    _, cached = get(store, *cell, workers=1, dtypes=dtypes, progress=count)
    count(1, 1)
    if store.incomplete:
        raise InputError("it was computed, but could not be written to the store")
    return cached
