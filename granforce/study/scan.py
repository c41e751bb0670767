"""Scans: many cells computed over processes or over a dask cluster, each kept as it ends.

Cells are independent and seeded, so a scan gives the same result for any number of workers, and
one that was cut short, or lost a worker, goes on where it was.
"""

import logging
import multiprocessing
import os
import signal
import socket
import threading
import time
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from granforce.explore.intervals import intervals
from granforce.explore.random_walk import walk
from granforce.explore.uniform import sample_uniform
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.packing.compaction import pack
from granforce.perturb.critical_force import critical_forces
from granforce.records import InputError, Packing
from granforce.study import kinds
from granforce.study.cells import StudyCell, get, load, row
from granforce.study.keys import Parameters, canonical
from granforce.study.store import open_store
from granforce.system.terminal import one_line
from granforce.types import Progress

# How often it is asked what dask has finished, and how long it may have no worker until that is
# said, s.
LOOK, WORKERLESS = 0.2, 5.0

CELL_BYTES = 2000  # of memory, that a cell takes until it is computed

TRIES = 3  # a cell under way when a worker died is begun anew so often: it may have been its fault

# What workers are to run: path of the store, cell, dtypes.
Tasks = dict[int, tuple[str, StudyCell, Mapping[str, str] | None]]

_SINGLE = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def scan(
    path: str | Path,
    cells: Sequence[Parameters],
    *,
    on_row: Callable[[dict[str, Any]], object] | None = None,
    **options: Any,
) -> tuple[list[dict[str, Any]], list[tuple[Parameters, str]]]:
    """Run walks (their parameters); see `run` for the options.

    on_row(row) after each walk. Returns the rows in the order of the cells and a list of (walk
    parameters, error message).
    """
    store = open_store(path)
    rows: dict[int, dict[str, Any]] = {}
    named = [StudyCell(kinds.WALK, parameters) for parameters in cells]

    def done(k: int, cached: bool) -> None:
        # Computed anew where others have removed it meanwhile.
        rows[k] = row(cells[k], get(store, *named[k])[0], cached)
        if on_row is not None:
            on_row(rows[k])

    failed = run(path, named, on_done=done, **options)
    return [rows[k] for k in sorted(rows)], [(cell.parameters, text) for cell, text in failed]


def run(
    path: str | Path,
    cells: Sequence[StudyCell],
    *,
    workers: int = 2,
    scheduler: str | None = None,
    dtypes: Mapping[str, str] | None = None,
    progress: Progress | None = None,
    on_done: Callable[[int, bool], object] | None = None,
    enough: Callable[[], bool] | None = None,
) -> list[tuple[StudyCell, str]]:
    """Compute cells into the store at path, on one processor each; finished ones are found.

    workers: processes on this machine. scheduler: address of a dask scheduler whose workers see
    the same folder, in place of processes. dtypes: as for Store.save, for the states.
    Cells are begun in their order; one whose packing is among them waits for it, and is left out,
    without a word, where that fails.
    progress(cells done, cells in all) counts quarters of cells and never goes back;
    on_done(position in cells, whether it was found) after each. Once enough() is true no cell is
    begun; those under way are finished (not asked with a scheduler, whose cells are all handed
    over at once). Returns a list of (cell, error message). Interrupted, it loses the cells under
    way only, and workers end with this process.
    Raises InputError where the scheduler cannot be reached.
    """
    store = open_store(path)
    store.make()
    todo = []
    for k, cell in enumerate(cells):
        if load(store, *cell) is None:
            todo.append(k)
        elif on_done is not None:
            on_done(k, True)
    failed = {}
    ended, tell = 0, forwards(progress, len(todo))

    def finished(k: int, get_result: Callable[[], bool]) -> None:
        nonlocal ended
        try:
            cached = get_result()
        except InputError as error:
            failed[k] = str(error)
        else:
            if on_done is not None:
                on_done(k, cached)
        ended += 1
        tell(ended)

    if todo:
        tasks = {k: (str(store.path), cells[k], dtypes) for k in todo}
        needs = _needs({k: cells[k] for k in todo})
        if scheduler is None:
            waits = Waits(needs, failed)
            _over_processes(tasks, waits, workers, finished, tell, enough or (lambda: False))
        else:
            first = set(needs.values())
            for part in (first, tasks.keys() - first):
                some = {k: tasks[k] for k in sorted(part) if needs.get(k) not in failed}
                _over_dask(some, scheduler, finished)
    return [(cells[k], failed[k]) for k in sorted(failed)]


class Waits(NamedTuple):
    """What cells wait for: {cell: its packing, where that is to be made}, and what has failed."""

    needs: Mapping[int, int]
    failed: Mapping[int, str]

    def ready(self, todo: Sequence[int], left: Collection[int]) -> int | None:
        """The first cell to do whose packing is not among those left; None where all wait."""
        return next((k for k in todo if self.needs.get(k) not in left), None)

    def lost(self, k: int) -> bool:
        """Whether the packing of a cell has failed."""
        return self.needs.get(k) in self.failed


def _needs(cells: Mapping[int, StudyCell]) -> dict[int, int]:
    """{cell: the one among them that makes its packing}."""
    made = {
        canonical(cell.parameters): k for k, cell in cells.items() if cell.kind == kinds.PACKING
    }
    named = {k: cell.parameters.get("packing") for k, cell in cells.items()}
    wanted = {k: canonical(packing) for k, packing in named.items() if packing is not None}
    return {k: made[name] for k, name in wanted.items() if name in made}


def forwards(progress: Progress | None, total: int) -> Callable[[float], None]:
    """tell(parts), which calls progress(parts done, total), in quarters, and never goes back.

    Cells may be counted as ended before they are seen to be, and anew where a worker died; quarters
    add up exactly.
    """
    reached = 0.0

    def tell(parts: float) -> None:
        nonlocal reached
        reached = max(reached, min(int(4 * parts) / 4, total))
        if progress is not None:
            progress(reached, total)

    return tell


def _over_processes(
    tasks: Tasks,
    waits: Waits,
    workers: int,
    finished: Callable[[int, Callable[[], bool]], object],
    advanced: Callable[[float], object],
    enough: Callable[[], bool],
) -> None:
    warm_up({cell.kind for _, cell, _ in tasks.values()})
    count = len(tasks)
    for _ in range(TRIES):
        before = count - len(tasks)
        tasks = _one_pool(tasks, waits, workers, finished, advanced, before, enough)
        if not tasks or enough():
            return
    for k in tasks:
        finished(k, _lost)


def _lost() -> NoReturn:
    raise InputError(f"worker processes died {TRIES} times at it, or at cells beside it")


def _one_pool(
    tasks: Tasks,
    waits: Waits,
    workers: int,
    finished: Callable[[int, Callable[[], bool]], object],
    advanced: Callable[[float], object],
    before: int,
    enough: Callable[[], bool],
) -> Tasks:
    """Run tasks over processes, `before` have ended; those that a dead worker left are returned."""
    context = multiprocessing.get_context("spawn")
    counter = context.Value("d", 0.0)
    left, todo, broken = dict(tasks), list(tasks), False
    waiting: dict[Future[bool], int] = {}
    workers = min(workers, len(tasks))
    pool = ProcessPoolExecutor(workers, context, initializer=_share, initargs=(counter,))
    try:
        while True:
            # One for each worker: what the pool was given it would begin.
            while len(waiting) < workers and not broken and not enough():
                k = waits.ready(todo, left)
                if k is None:
                    break
                todo.remove(k)
                if waits.lost(k):
                    del left[k]
                    continue
                with _single_threaded():
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
                    finished(k, future.result)
                    del left[k]
            advanced(before + counter.value)
    except BaseException:
        # Workers would go on with the cell under way: what they hold is lost either way.
        for process in list(pool._processes.values()):
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return left


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Processes started meanwhile use one thread in linear algebra: cells, not rows, are shared."""
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


_counter = None


def _share(counter: Any) -> None:
    global _counter
    _counter = counter
    # Ctrl-C goes to the whole process group: the parent ends the workers, each without a word.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    warnings.formatwarning = one_line


def _end_with_parent() -> None:
    """A worker whose parent was killed has nobody to compute for."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


def run_cell(path: str | Path, cell: StudyCell, dtypes: Mapping[str, str] | None = None) -> bool:
    """Compute one cell into the store at path; whether it was there. Runs in a worker process."""
    if not Path(path, "zarr.json").exists():
        raise InputError(f"no store at {path} on {socket.gethostname()}: the folder must be shared")
    seen = 0.0

    def count(done: float, total: float | None) -> None:  # None: of a compaction
        nonlocal seen
        if _counter is not None and total:
            part = min(done / total, 1.0)
            with _counter.get_lock():
                _counter.value += part - seen
            seen = part

    store = open_store(path)
    _, cached = get(store, *cell, workers=1, dtypes=dtypes, progress=count)
    count(1, 1)
    if store.incomplete:
        raise InputError("it was computed, but could not be written to the store")
    return cached


def _over_dask(
    tasks: Tasks, scheduler: str, finished: Callable[[int, Callable[[], bool]], object]
) -> None:
    """Run tasks over the workers of a dask scheduler, which begins those of lost workers anew."""
    try:
        from dask.distributed import Client, KilledWorker, as_completed
    except ImportError:
        raise InputError("a scheduler needs dask: pip install 'granforce[cluster]'") from None
    gone = InputError(f"the dask scheduler at {scheduler} is gone; finished entries are saved")
    with _without_tracebacks(), _client_of(scheduler, Client) as client:
        waiting = {client.submit(run_cell, *task, pure=False): k for k, task in tasks.items()}
        completed, workers = as_completed(list(waiting)), _Workers(scheduler)
        try:
            while waiting:
                for future in completed.next_batch(block=False):
                    if future.status == "cancelled":  # what became of it, nobody knows
                        raise gone
                    dead = isinstance(future.exception(), KilledWorker)
                    finished(waiting.pop(future), _lost if dead else future.result)
                try:
                    workers.count(client.nthreads())
                except OSError:
                    raise gone from None
                time.sleep(LOOK)
        except BaseException:
            client.cancel(list(waiting))
            raise


def _client_of(scheduler: str, client: Callable[..., Any]) -> Any:
    try:
        return client(scheduler, timeout=10)
    except Exception as error:  # whatever else may answer there
        words = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(f"no dask scheduler at {scheduler}: {words}") from None


@contextmanager
def _without_tracebacks() -> Iterator[None]:
    """Within, dask does not log what ends in an error here, too."""
    logger = logging.getLogger("distributed.client")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)


class _Workers:
    """Says, each time once, that a scheduler has been without workers for some seconds."""

    def __init__(self, scheduler: str) -> None:
        self._scheduler = scheduler
        self._since, self._told = time.monotonic(), False

    def count(self, workers: Collection[Any]) -> None:
        """These are its workers just now."""
        if workers:
            self._since, self._told = time.monotonic(), False
        elif not self._told and time.monotonic() >= self._since + WORKERLESS:
            self._told = True
            warnings.warn(
                f"no worker at the dask scheduler {self._scheduler}: waiting for one to come "
                "(Ctrl-C ends)",
                stacklevel=2,
            )


def warm_up(needed: Any = None, packing: Packing | None = None) -> None:
    """Compile (or load from numba's cache) kernels once, before workers do it each.

    needed: the kinds that they are compiled for, by default all. packing: what they are run on, by
    default one that is made, for which the kernels that make packings are compiled, too.
    """
    S = ensemble(pack(12, 0.5, 0) if packing is None else packing)
    for its_kinds, run in _FIRST_RUNS:
        if needed is None or its_kinds & needed:
            run(S)


def _push(S: Ensemble) -> None:
    # A single contact, and several side by side.
    for contacts in (S.index[:1], S.index[:3]):
        critical_forces(S, contacts)


_BOUNDS = {kinds.INTERVALS, kinds.LIMIT_LOADS, kinds.OUTLINE, kinds.STRESS}
# Two contacts: their bounds are few at first, then enough to go side by side.
_FIRST_RUNS = (
    ({kinds.WALK}, lambda S: walk(S, 2, 0)),
    (_BOUNDS, lambda S: intervals(S, S.index[:2])),
    ({kinds.UNIFORM}, lambda S: sample_uniform(S, 4)),
    ({kinds.PERTURBATION}, _push),
)
