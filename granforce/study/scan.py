"""Scans: many cells computed by processes or by a dask cluster, each stored as it ends.

Cells are independent and seeded, so a scan gives the same result for any number of workers, and an
interrupted scan, or one that lost a worker, resumes.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import socket
import sys
import threading
import time
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from inspect import signature
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from granforce.explore.intervals import intervals
from granforce.explore.random_walk import walk
from granforce.explore.uniform import sample_uniform
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.packing.compaction import pack
from granforce.perturb.critical_force import critical_forces
from granforce.records import (
    InputError,
    Packing,
    ResultWarning,
    brief,
    choice,
    friction,
    real_array,
    refuse_options,
    whole,
    worker_count,
)
from granforce.study import kinds
from granforce.study.cells import StudyCell, entry_name, get, load, row
from granforce.study.keys import Parameters, canonical
from granforce.study.relaxations import RELAXATIONS
from granforce.study.store import open_store
from granforce.system import cancelling
from granforce.system.memory import check_memory
from granforce.system.terminal import one_line
from granforce.types import Progress

# Time between two queries of dask, and time without workers before a message and before an end, s.
LOOK, WORKERLESS, GIVEN_UP = 0.2, 5.0, 600.0

CELL_BYTES = 2000  # of memory, per cell that is not yet computed

NO_STORES = (".csv", ".json", ".npz")  # endings of files that a user expects instead

TRIES = 3  # attempts at a cell whose worker died: the cell may be the cause

# Work for workers: path of the store, cell, dtypes.
Tasks = dict[int, tuple[str, StudyCell, Mapping[str, str] | None]]

_SINGLE = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def scan(
    path: str | Path,
    mu: Sequence[float] | float,
    seeds: int = 1,
    n: int = 400,
    states: int = 1000,
    *,
    walk_seed: int = 0,
    ensemble_mu: float | None = None,
    relax: str = "nearest",
    chains: int = 1,
    keep: int | None = None,
    workers: int = 2,
    scheduler: str | None = None,
    dtypes: Mapping[str, str] | None = None,
    progress: Progress | None = None,
    **packing: Any,
) -> tuple[list[dict[str, Any]], list[tuple[Parameters, str]]]:
    """Packings and walks for many μ and seeds, computed into the store at path or loaded from it.

    Two and more workers are new processes: in a script, which must be a file, call it under ``if
    __name__ == "__main__":``.

    Parameters
    ----------
    path : path
        Folder of the store.
    mu : float or sequence of float
        Friction coefficients.
    seeds : int, default 1
        For each μ, packings with the seeds 1 … seeds.
    n : int, default 400
        Number of disks.
    states, walk_seed, chains
        Of each walk, as for `walk`.
    ensemble_mu : float, optional
        Friction of the cones, by default the packing's.
    relax : str, default "nearest"
        "nearest", "nearest_piqp", "gauss_seidel" or "gauss_seidel_only".
    keep : int, optional
        Number of states to store, by default all.
    workers : int, default 2
        Processes on this machine; 1: this process.
    scheduler : str, optional
        Address of a dask scheduler whose workers see the same folder, to use instead.
    dtypes : mapping, optional
        {variable: type} with which to store states, as {"states": "float32"}.
    progress : callable, optional
        progress(done, total) counts quarters of what is not stored.
    **packing
        Other options of `pack`.

    Returns
    -------
    rows : list of dict
        As `pandas.DataFrame` and `figures.indeterminacy` take them (mu, seed, packing_fraction,
        coordination, dimension h, eta1, eta2, eta3, …).
    failed : list of tuple
        (walk parameters, error message).

    Raises
    ------
    InputError
        For wrong arguments.
    """
    refuse_options(scan, packing, [*signature(kinds.PACKING.parameters).parameters][3:])
    seeds, mus = whole(seeds, "seeds", 1), [friction(one) for one in real_array(mu, "mu").ravel()]
    _check_dtypes(dtypes or {})
    if not mus:
        raise InputError("give at least one friction coefficient")
    for one in (a for a, b in pairwise(sorted(mus)) if a == b):
        raise InputError(f"mu {one:g} is given twice; give it once")
    worker_count(workers)
    if Path(path).suffix in NO_STORES:
        raise InputError(
            f"{path}: results are stored in a folder, such as {Path(path).stem}.zarr; the rows "
            "that scan returns can be written as a table"
        )
    check_memory(CELL_BYTES * len(mus) * seeds, f"{len(mus) * seeds} cells")
    cells = [
        kinds.WALK.parameters(
            kinds.PACKING.parameters(n, one, seed, **packing),
            states,
            walk_seed,
            mu=ensemble_mu,
            relax=RELAXATIONS[choice(relax, RELAXATIONS, "relax")],
            chains=chains,
            keep=keep,
        )
        for one in mus
        for seed in range(1, seeds + 1)
    ]
    rows, failed = walks(
        path, cells, workers=workers, scheduler=scheduler, dtypes=dtypes, progress=progress
    )
    return rows, [(kinds.typed(parameters), message) for parameters, message in failed]


def _check_dtypes(dtypes: Mapping[str, str]) -> None:
    """InputError unless only the states get another type, of floats."""
    try:
        kinds_of = {name: np.dtype(dtype).kind for name, dtype in dtypes.items()}
    except (AttributeError, TypeError):
        kinds_of = {"": ""}
    if kinds_of not in ({}, {"states": "f"}):
        raise InputError(f'dtypes may be {{"states": "float32"}}, got {brief(dtypes)}; correct it')


def walks(
    path: str | Path,
    cells: Sequence[Parameters],
    *,
    on_row: Callable[[dict[str, Any]], object] | None = None,
    **options: Any,
) -> tuple[list[dict[str, Any]], list[tuple[Parameters, str]]]:
    """Run walks (their parameters); see `run` for the options.

    on_row(row) is called after each walk. Returns the rows in the order of the cells and a list of
    (walk parameters, error message).
    """
    store = open_store(path)
    rows: dict[int, dict[str, Any]] = {}
    named = [StudyCell(kinds.WALK, parameters) for parameters in cells]

    def done(k: int, cached: bool) -> None:
        # Computed again if another process removed it meanwhile.
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
    """Compute cells into the store at path, on one processor each; stored ones are skipped.

    workers: processes on this machine; 1: this process. scheduler: address of a dask scheduler
    whose workers see the same folder, to use instead of processes. dtypes: as for Store.save, for
    the states. Cells are started in order; a cell whose packing is among them waits for it, and is
    skipped silently if that fails. progress(done, total) counts quarters of the cells that are not
    stored yet, and never decreases; on_done(position in cells, whether it was stored) is called
    after each. Once enough() is true no further cell is started; running ones are finished (not
    called with a scheduler, which gets all cells at once). An interruption loses only running
    cells, and workers end with this process; the KeyboardInterrupt says how many cells are saved.

    Returns a list of (cell, error message). Raises InputError if the scheduler cannot be reached.
    """
    store = open_store(path)
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

    if not todo:
        return []
    tasks = {k: (str(store.path), cells[k], dtypes) for k in todo}
    needs = _needs({k: cells[k] for k in todo})
    try:
        if scheduler is None:
            store.make()
            waits = Waits(needs, failed)
            calls = _Calls(finished, tell, enough or (lambda: False))
            if worker_count(workers) == 1:
                _one_after_another(tasks, waits, calls)
            else:
                _over_processes(tasks, waits, workers, calls)
        else:
            with _client_of(scheduler) as client:
                store.make()  # only once a scheduler has answered
                first = set(needs.values())
                for part in (first, tasks.keys() - first):
                    some = {k: tasks[k] for k in sorted(part) if needs.get(k) not in failed}
                    _over_dask(client, some, scheduler, finished)
    except KeyboardInterrupt:
        saved = sum(entry_name(store, *cell) in store for cell in cells) if store.exists else 0
        # Workers of a cluster may still finish the cells they are computing.
        least = "" if scheduler is None else "at least "
        raise KeyboardInterrupt(f"saved {least}{saved} of {len(cells)} cells") from None
    return [(cells[k], failed[k]) for k in sorted(failed)]


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


def _needs(cells: Mapping[int, StudyCell]) -> dict[int, int]:
    """{cell: the cell among them that makes its packing}."""
    makers = {
        canonical(cell.parameters): k for k, cell in cells.items() if cell.kind == kinds.PACKING
    }
    named = {k: cell.parameters.get("packing") for k, cell in cells.items()}
    needed = {k: canonical(packing) for k, packing in named.items() if packing is not None}
    return {k: makers[name] for k, name in needed.items() if name in makers}


def forwards(progress: Progress | None, total: int) -> Callable[[float], None]:
    """A function of the fraction done that calls progress(done, total) and never decreases.

    Fractions are in quarters, which add up exactly. Cells may be counted as ended before they are
    reported, and again if a worker died.
    """
    reached = 0.0

    def tell(parts: float) -> None:
        nonlocal reached
        reached = max(reached, min(int(4 * parts) / 4, total))
        if progress is not None:
            progress(reached, total)

    return tell


class _Calls(NamedTuple):
    """What running cells calls."""

    finished: Callable[[int, Callable[[], bool]], object]  # a cell, and whether it was stored
    advanced: Callable[[float], object]  # the number of cells that are done, and parts of them
    enough: Callable[[], bool]  # whether to start no further cell


def _one_after_another(tasks: Tasks, waits: Waits, calls: _Calls) -> None:
    """Run tasks in this process, which needs no script that workers could import."""
    left = dict(tasks)
    while left and not calls.enough():
        k = waits.ready(list(left), left)
        assert k is not None  # a packing waits for nothing
        if not waits.lost(k):
            tell = _from(len(tasks) - len(left), calls.advanced)
            calls.finished(k, partial(run_cell, *tasks[k], advanced=tell))
        del left[k]


def _from(before: int, advanced: Callable[[float], object]) -> Callable[[float], object]:
    return lambda part: advanced(before + part)


def _over_processes(tasks: Tasks, waits: Waits, workers: int, calls: _Calls) -> None:
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        sys.exit(1)  # in a worker that imports a script without a guard: its parent says so
    with cancelling.scope():  # the compiler cannot be interrupted
        cancelling.apart(warm_up, {cell.kind for _, cell, _ in tasks.values()})
    count = len(tasks)
    for _ in range(TRIES):
        before = count - len(tasks)
        tasks = _one_pool(tasks, waits, workers, calls, before)
        if not tasks or calls.enough():
            return
    for k in tasks:
        calls.finished(k, _lost)


def _lost() -> NoReturn:
    raise InputError(f"worker processes died {TRIES} times while computing this cell or others")


def _one_pool(tasks: Tasks, waits: Waits, workers: int, calls: _Calls, before: int) -> Tasks:
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


def _over_dask(
    client: Any,
    tasks: Tasks,
    scheduler: str,
    finished: Callable[[int, Callable[[], bool]], object],
) -> None:
    """Run tasks on the workers of a dask scheduler, which restarts those of lost workers."""
    from dask.distributed import KilledWorker, as_completed

    unreachable = InputError(
        f"the dask scheduler at {scheduler} was lost; finished entries are saved"
    )
    waiting = {client.submit(run_cell, *task, pure=False): k for k, task in tasks.items()}
    completed, workers = as_completed(list(waiting)), _Workers(scheduler)
    try:
        while waiting:
            for future in completed.next_batch(block=False):
                if future.status == "cancelled":  # its fate is unknown
                    raise unreachable
                dead = isinstance(future.exception(), KilledWorker)
                finished(waiting.pop(future), _lost if dead else future.result)
            try:
                present = client.nthreads()
            except OSError:
                raise unreachable from None
            workers.count(present)
            time.sleep(LOOK)
    except BaseException:
        client.cancel(list(waiting))
        raise


@contextmanager
def _client_of(scheduler: str) -> Iterator[Any]:
    """A client of a dask scheduler; InputError if it cannot be reached."""
    try:
        from dask.distributed import Client
    except ImportError:
        raise InputError("a scheduler needs dask: pip install 'granforce[cluster]'") from None
    with _without_tracebacks():
        try:
            client = Client(scheduler, timeout=10)
        except Exception as error:  # another service at this address may answer anything
            words = " ".join(str(error).split())[:200] or type(error).__name__
            raise InputError(f"no dask scheduler at {scheduler}: {words}") from None
        with client:
            yield client


@contextmanager
def _without_tracebacks() -> Iterator[None]:
    """Within, dask does not log errors that are handled here."""
    logger = logging.getLogger("distributed.client")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)


class _Workers:
    """Reports, once each time, that a scheduler has no workers, and ends after GIVEN_UP."""

    def __init__(self, scheduler: str) -> None:
        self._scheduler = scheduler
        self._since, self._reported = time.monotonic(), False

    def count(self, workers: Collection[Any]) -> None:
        """Update with its present workers; InputError after GIVEN_UP without any."""
        if workers:
            self._since, self._reported = time.monotonic(), False
            return
        missed, minutes = time.monotonic() - self._since, f"{GIVEN_UP / 60:g} minutes"
        if missed >= GIVEN_UP:
            raise InputError(
                f"the dask scheduler {self._scheduler} had no worker for {minutes}: start one with "
                f"dask worker {self._scheduler}; finished entries are saved"
            )
        if missed >= WORKERLESS and not self._reported:
            self._reported = True
            warnings.warn(
                f"no worker at the dask scheduler {self._scheduler}: waiting up to {minutes} for "
                "one (Ctrl-C ends)",
                stacklevel=2,
            )


def warm_up(needed: Any = None, packing: Packing | None = None) -> None:
    """Compile kernels (or load them from numba's cache) once, before each worker does it.

    needed: the kinds for which to compile, by default all. packing: used to run them, by default a
    new one, which also compiles the kernels that make packings.
    """
    S = ensemble(pack(12, 0.5, 0) if packing is None else packing)
    for its_kinds, run in _FIRST_RUNS:
        if needed is None or its_kinds & needed:
            run(S)


def _push(S: Ensemble) -> None:
    # A single contact, and several in lanes.
    for contacts in (S.index[:1], S.index[:3]):
        critical_forces(S, contacts)


_BOUNDS = {kinds.INTERVALS, kinds.LIMIT_LOADS, kinds.OUTLINE, kinds.STRESS}
# Two contacts: first few bounds, then enough for lanes.
_FIRST_RUNS = (
    ({kinds.WALK}, lambda S: walk(S, 2, 0)),
    (_BOUNDS, lambda S: intervals(S, S.index[:2])),
    ({kinds.UNIFORM}, lambda S: sample_uniform(S, 4)),
    ({kinds.PERTURBATION}, _push),
)
