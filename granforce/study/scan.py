"""Scans: many cells computed by processes or by a dask cluster, each stored as it ends.

Cells are independent and seeded, so a scan gives the same result for any number of workers, and an
interrupted scan, or one that lost a worker, resumes.
"""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from inspect import signature
from itertools import pairwise
from pathlib import Path
from typing import Any

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
    brief,
    friction,
    real_array,
    refuse_options,
    whole,
    worker_count,
)
from granforce.study import kinds
from granforce.study.cells import StudyCell, entry_name, get, load, row
from granforce.study.cluster import client_of, over_dask
from granforce.study.keys import Parameters, canonical
from granforce.study.processes import TRIES, Calls, Tasks, Waits, lost, one_pool, run_cell
from granforce.study.store import open_store
from granforce.system import cancelling
from granforce.system.memory import check_memory
from granforce.types import Progress

CELL_BYTES = 2000  # of memory, per cell that is not yet computed

NO_STORES = (".csv", ".json", ".npz")  # endings of files that a user expects instead


@cancelling.shown
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
            relax=relax,
            chains=chains,
            keep=keep,
        )
        for one in mus
        for seed in range(1, seeds + 1)
    ]
    return walks(
        path, cells, workers=workers, scheduler=scheduler, dtypes=dtypes, progress=progress
    )


def _check_dtypes(dtypes: Mapping[str, str]) -> None:
    """InputError unless only the states get another type, of floats."""
    try:
        kinds_of = {name: np.dtype(dtype).kind for name, dtype in dtypes.items()}
    except (AttributeError, TypeError):
        kinds_of = {"": ""}
    if kinds_of not in ({}, {"states": "f"}):
        raise InputError(f'dtypes may be {{"states": "float32"}}, got {brief(dtypes)}; correct it')


def walks(
    path: str | Path, cells: Sequence[Parameters], **options: Any
) -> tuple[list[dict[str, Any]], list[tuple[Parameters, str]]]:
    """Run walks (their parameters); see `run` for the options.

    Returns the rows in the order of the cells and a list of (walk parameters, error message).
    """
    store = open_store(path)
    rows: dict[int, dict[str, Any]] = {}
    named = [StudyCell(kinds.WALK, parameters) for parameters in cells]

    def done(k: int, cached: bool) -> None:
        # Computed again if another process removed it meanwhile.
        rows[k] = row(cells[k], get(store, *named[k])[0], cached)

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
            calls = Calls(finished, tell, enough or (lambda: False))
            if worker_count(workers) == 1:
                _one_after_another(tasks, waits, calls)
            else:
                _over_processes(tasks, waits, workers, calls)
        else:
            with client_of(scheduler) as client:
                store.make()  # only once a scheduler has answered
                first = set(needs.values())
                for part in (first, tasks.keys() - first):
                    some = {k: tasks[k] for k in sorted(part) if needs.get(k) not in failed}
                    over_dask(client, some, scheduler, finished)
    except KeyboardInterrupt:
        saved = sum(entry_name(store, *cell) in store for cell in cells) if store.exists else 0
        # Workers of a cluster may still finish the cells they are computing.
        least = "" if scheduler is None else "at least "
        raise KeyboardInterrupt(f"saved {least}{saved} of {len(cells)} cells") from None
    return [(cells[k], failed[k]) for k in sorted(failed)]


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
    shown = 0.0

    def tell(parts: float) -> None:
        nonlocal shown
        shown = max(shown, min(int(4 * parts) / 4, total))
        if progress is not None:
            progress(shown, total)

    return tell


def _one_after_another(tasks: Tasks, waits: Waits, calls: Calls) -> None:
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


def _over_processes(tasks: Tasks, waits: Waits, workers: int, calls: Calls) -> None:
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        sys.exit(1)  # in a worker that imports a script without a guard: its parent says so
    with cancelling.scope():  # the compiler cannot be interrupted
        cancelling.apart(warm_up, {cell.kind for _, cell, _ in tasks.values()})
    count = len(tasks)
    for _ in range(TRIES):
        before = count - len(tasks)
        tasks = one_pool(tasks, waits, workers, calls, before)
        if not tasks or calls.enough():
            return
    for k in tasks:
        calls.finished(k, lost)


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
