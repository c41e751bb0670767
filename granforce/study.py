"""Cells of a study: one packing and one walk each, found in the store or computed and kept.

A cell is named by plain parameters. Cells are independent and seeded, so a sweep over processes
gives the same result for any number of workers, and one that was cut short goes on where it was.
"""

import hashlib
import json
import multiprocessing
import signal
import time
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait

import numpy as np

from granforce import measures
from granforce.bounds import intervals, limit_load_bounds
from granforce.compaction import pack
from granforce.polytope import ensemble
from granforce.random_walk import walk
from granforce.records import Cancelled, InputError, friction
from granforce.relax.accelerated import accelerated
from granforce.relax.gauss_seidel import gauss_seidel
from granforce.relax.nearest import nearest
from granforce.schema import dataset_packing, labelled, packing_dataset
from granforce.store import open_store
from granforce.tolerances import EQUILIBRIUM

# Raised when an algorithm gives other numbers for the same parameters: older entries are not used.
PACKING_VERSION = 1
WALK_VERSION = 1
INTERVALS_VERSION = 1
LIMIT_LOADS_VERSION = 1

# Forces whose exact interval is longer than this, in ⟨f_n⟩, are undetermined.
UNDETERMINED = 1e-6

RELAXATIONS = {
    "gauss_seidel": {"relax": gauss_seidel},
    "gauss_seidel_only": {"relax": gauss_seidel, "rest": None, "tolerance": EQUILIBRIUM},
    "nearest": {"relax": nearest},
    "accelerated": {"relax": accelerated},
}


def packing_parameters(
    n, mu, seed, *, radii="uniform:0.5,1", pressure=1.0, dt=0.01, box_mass=100.0, sweeps=100
):
    """The parameters that name a packing in the store; as for `pack`."""
    named = {"n": int(n), "mu": friction(mu), "seed": int(seed), "radii": radii}
    return {**named, "pressure": pressure, "dt": dt, "box_mass": box_mass, "sweeps": sweeps}


def imported_parameters(packing):
    """The parameters that name a packing made elsewhere: a hash of its arrays."""
    digest = hashlib.sha256()
    arrays = (packing.x, packing.r, packing.box, packing.forces, packing.load, *packing.contacts)
    for array in (*arrays, np.array([packing.mu, packing.pressure])):
        digest.update(np.ascontiguousarray(array).tobytes())
    return {"imported": digest.hexdigest(), "mu": packing.mu}


def walk_parameters(packing, states, seed=0, *, mu=None, relax="accelerated", chains=1, keep=None):
    """The parameters that name a walk: those of its packing, and how it goes.

    mu: friction coefficient of the ensemble, by default the packing's. keep: number of evenly
    spaced states that are stored (measures always come from all).
    """
    if relax not in RELAXATIONS:
        raise InputError(f"unknown relaxation {relax!r}: take one of {', '.join(RELAXATIONS)}")
    if not 1 <= int(chains) <= int(states) or (keep is not None and keep < 1):
        raise InputError("states, keep and chains must be at least 1, and chains ≤ states")
    return {
        "packing": packing,
        "mu": packing["mu"] if mu is None else friction(mu),
        "states": int(states),
        "seed": int(seed),
        "relax": relax,
        "chains": int(chains),
        "keep": None if keep is None or keep >= states else int(keep),
    }


def get_packing(store, parameters, *, max_steps=100_000, progress=None, cancel=None):
    """The packing of these parameters and whether it came from the store."""
    found = store.load("packing", parameters, version=PACKING_VERSION)
    if found is not None:
        return dataset_packing(found), True
    if "imported" in parameters:
        raise InputError("the imported packing is not in this store: import it again")
    packing = pack(**parameters, max_steps=max_steps, progress=progress, cancel=cancel)
    keep_packing(store, parameters, packing)
    return packing, False


def keep_packing(store, parameters, packing):
    """Save a packing under its parameters; returns the entry's name."""
    return store.save("packing", parameters, packing_dataset(packing), version=PACKING_VERSION)


def get_walk(store, parameters, *, workers=1, dtypes=None, progress=None, cancel=None):
    """The dataset of this walk with all its measures, and whether it came from the store.

    progress(done, total) counts states; dtypes as for Store.save.
    """
    found = store.load("walk", parameters, version=WALK_VERSION)
    if found is not None:
        return found, True
    packing, _ = get_packing(store, parameters["packing"], cancel=cancel)
    S = ensemble(packing, parameters["mu"])
    begin = time.perf_counter()
    done = walk(
        S,
        parameters["states"],
        parameters["seed"],
        chains=parameters["chains"],
        workers=workers,
        **RELAXATIONS[parameters["relax"]],
        progress=progress,
        cancel=cancel,
    )
    seconds = time.perf_counter() - begin
    dataset = walk_dataset(S, done, keep=parameters["keep"], seconds=seconds)
    store.save("walk", parameters, dataset, version=WALK_VERSION, dtypes=dtypes)
    return dataset, False


def walk_dataset(S, done, *, keep=None, seconds=0.0):
    """A Walk with its measures as a dataset; `keep` evenly spaced states are kept, or all."""
    states = done.states
    centre = measures.mean_network(states)
    low, high = measures.intervals_seen(states)
    extent = measures.normal_extent(low, high)
    in_error = measures.correlation_range(states, extent)
    distance = measures.distances(states, centre) / S.force_scale
    start = measures.distances(S.original[None], centre)[0] / S.force_scale
    pick = slice(None) if keep is None else np.linspace(0, len(states) - 1, keep).astype(int)
    return labelled(
        {
            "states": states[pick],
            "residual": done.residual[pick],
            "violation": done.violation[pick],
            "sweeps": done.sweeps[pick],
            "attempts": done.attempts[pick],
            "distance_to_centre": distance[pick],
            "backbone": S.index,
            "original": S.original,
            "low": low,
            "high": high,
            "eta1": measures.eta1(states),
            "eta2": measures.eta2(states),
            "eta3": measures.eta3(low, high),
            "correlation": measures.correlation(S.original[:, 0], extent),
            "correlation_low": in_error[0],
            "correlation_high": in_error[1],
            "packing_fraction": S.packing.packing_fraction,
            "coordination": S.coordination,
            "dimension": S.dimension,
            "force_scale": S.force_scale,
            "original_distance": start,
            "acceptance": done.acceptance,
            **done.counts,
            **S.skipped,
            "seconds": seconds,
        }
    )


def exact_parameters(packing, *, mu=None, contacts=None, slice_=None):
    """The parameters that name exact bounds or limit loads of one packing.

    mu: friction coefficient of the ensemble, by default the packing's. contacts: positions in the
    packing's contact list, by default all that carry. slice_: (x0, x1, y0, y1) in parts of the
    box: contacts with a grain outside are frozen at their original forces.
    """
    mu = packing["mu"] if mu is None else friction(mu)
    chosen = None if contacts is None else sorted({int(c) for c in contacts})
    return {
        "packing": packing,
        "mu": mu,
        "contacts": chosen,
        "slice": None if slice_ is None else [float(edge) for edge in slice_],
    }


def exact_ensemble(store, parameters, *, cancel=None):
    """The ensemble that exact_parameters name, and the asked contacts as positions in it."""
    packing, _ = get_packing(store, parameters["packing"], cancel=cancel)
    frozen = None
    if parameters["slice"] is not None:
        frozen = outside_slice(packing, parameters["slice"])
    S = ensemble(packing, parameters["mu"], frozen=frozen)
    if parameters["contacts"] is None:
        return S, np.arange(len(S.index))
    asked = np.array(parameters["contacts"], dtype=int)
    unknown = np.setdiff1d(asked, S.index)
    if len(unknown):
        raise InputError(
            f"contact {unknown[0]} is none of the {len(S.index)} that carry a load in this packing"
        )
    return S, np.searchsorted(S.index, asked)


def get_intervals(store, parameters, *, workers=2, progress=None, cancel=None):
    """Dataset of exact bounds and η3, clusters of undetermined contacts; and if it was kept."""
    found = store.load("intervals", parameters, version=INTERVALS_VERSION)
    if found is not None:
        return found, True
    S, contacts = exact_ensemble(store, parameters, cancel=cancel)
    begin = time.perf_counter()
    bounds = intervals(S, contacts, workers=workers, progress=progress, cancel=cancel)
    seconds = time.perf_counter() - begin
    _complete(bounds, "exact bounds", cancel)
    low, high = bounds.lower, bounds.upper
    original = S.original[contacts]
    i, j = S.contacts.i[contacts], S.contacts.j[contacts]
    tolerance = UNDETERMINED * S.force_scale
    cluster, _ = measures.undetermined_clusters(i, j, high - low, tolerance)
    extent = measures.normal_extent(low, high)
    dataset = labelled(
        {
            "backbone": S.index[contacts],
            "original": original,
            "low": low,
            "high": high,
            "interval_gap": bounds.gap,
            "max_gap": bounds.max_gap,
            "position": measures.position_in_interval(original[:, 0], low, high),
            "cluster": cluster,
            "eta3": measures.eta3(low, high),
            "correlation": measures.correlation(original[:, 0], extent),
            "dimension": S.dimension,
            "coordination": S.coordination,
            "force_scale": S.force_scale,
            **S.skipped,
            "seconds": seconds,
        },
        {"counts": json.dumps(bounds.counts)},
    )
    store.save("intervals", parameters, dataset, version=INTERVALS_VERSION)
    return dataset, False


def get_limit_loads(store, parameters, *, workers=2, progress=None, cancel=None):
    """Dataset of the limit loads of contacts, and whether it came from the store."""
    found = store.load("limit_loads", parameters, version=LIMIT_LOADS_VERSION)
    if found is not None:
        return found, True
    S, contacts = exact_ensemble(store, parameters, cancel=cancel)
    begin = time.perf_counter()
    loads = limit_load_bounds(S, contacts, workers=workers, progress=progress, cancel=cancel)
    seconds = time.perf_counter() - begin
    _complete(loads, "limit loads", cancel)
    dataset = labelled(
        {
            "backbone": S.index[contacts],
            "original": S.original[contacts],
            "limit_load": loads.load,
            "load_gap": loads.gap,
            "max_gap": loads.max_gap,
            "force_scale": S.force_scale,
            "seconds": seconds,
        },
        {"counts": json.dumps(loads.counts)},
    )
    store.save("limit_loads", parameters, dataset, version=LIMIT_LOADS_VERSION)
    return dataset, False


def _complete(result, what, cancel):
    """Only finished results are kept: Cancelled or InputError for others."""
    if cancel is not None and cancel():
        raise Cancelled(f"{what} cancelled")
    if not result.converged:
        raise InputError(f"{what} not certified: largest duality gap {result.max_gap:.1e} ⟨f_n⟩")


def outside_slice(packing, edges):
    """Mask (N_c,) of contacts with a grain centre outside x0 … x1, y0 … y1 (parts of the box).

    Raises InputError unless 0 ≤ x0 < x1 ≤ 1 and 0 ≤ y0 < y1 ≤ 1.
    """
    if len(edges) != 4:
        raise InputError("a slice is given by four numbers x0,x1,y0,y1")
    x0, x1, y0, y1 = edges
    if not (0 <= x0 < x1 <= 1 and 0 <= y0 < y1 <= 1):
        raise InputError(f"slice {edges} must satisfy 0 ≤ x0 < x1 ≤ 1 and 0 ≤ y0 < y1 ≤ 1")
    place = np.mod(packing.x, packing.box) / packing.box
    inside = np.all((place >= (x0, y0)) & (place <= (x1, y1)), axis=1)
    contacts = packing.contacts
    # A contact that reaches across the box's edge leaves the slice even if both grains are in it.
    step = (
        packing.x[contacts.j] - packing.x[contacts.i] - contacts.normal * contacts.length[:, None]
    )
    crossing = np.any(np.abs(step) > 0.5 * packing.box, axis=1)
    return ~(inside[contacts.i] & inside[contacts.j]) | crossing


ROW = ("packing_fraction", "coordination", "dimension", "eta1", "eta2", "eta3", "acceptance")
ROW_COUNTS = ("accepted", "rejected", "unconverged", "skipped", "rattlers", "unloaded_contacts")


def row(parameters, dataset, cached):
    """One line of a sweep's table: plain numbers of one cell."""
    packing = parameters["packing"]
    return {
        "mu": packing["mu"],
        "seed": packing.get("seed"),
        **{name: dataset[name].item() for name in (*ROW, *ROW_COUNTS)},
        "residual": float(dataset["residual"].max()),
        "cached": cached,
    }


def sweep(path, cells, *, workers=2, dtypes=None, progress=None, on_row=None):
    """Run cells (lists of walk parameters) over processes, keeping each in the store at path.

    Finished cells are found, not computed. progress(states done, states in all); on_row(row) after
    each cell. Returns the rows in the order of the cells and a list of (cell, error message).
    Interrupted, it loses the cells under way only.
    """
    store = open_store(path)
    store.clean()
    rows, failed, todo = {}, [], []
    for k, cell in enumerate(cells):
        found = store.load("walk", cell, version=WALK_VERSION)
        if found is None:
            todo.append(k)
        else:
            rows[k] = row(cell, found, True)
            _tell(on_row, rows[k])
    if todo:
        warm_up()
        _run(path, cells, todo, workers, dtypes, progress, on_row, rows, failed)
    return [rows[k] for k in sorted(rows)], failed


def _run(path, cells, todo, workers, dtypes, progress, on_row, rows, failed):
    context = multiprocessing.get_context("spawn")
    counter = context.Value("q", 0)
    total = sum(cells[k]["states"] for k in todo)
    pool = ProcessPoolExecutor(workers, context, initializer=_share, initargs=(counter,))
    try:
        waiting = {pool.submit(run_cell, path, cells[k], dtypes): k for k in todo}
        while waiting:
            ended, _ = wait(waiting, timeout=0.5, return_when=FIRST_COMPLETED)
            if progress is not None:
                progress(counter.value, total)
            for future in ended:
                k = waiting.pop(future)
                try:
                    rows[k] = future.result()
                    _tell(on_row, rows[k])
                except InputError as error:
                    failed.append((cells[k], str(error)))
    except BaseException:
        # Workers would go on with the cell under way: what they hold is lost either way.
        for process in list(pool._processes.values()):
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _tell(on_row, line):
    if on_row is not None:
        on_row(line)


_counter = None


def _share(counter):
    global _counter
    _counter = counter
    # Ctrl-C goes to the whole process group: the parent ends the workers, each without a word.
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def run_cell(path, cell, dtypes=None):
    """Compute one cell into the store at path; returns its row. Runs in a worker process."""
    seen = 0

    def count(done, total):
        nonlocal seen
        if _counter is not None:
            with _counter.get_lock():
                _counter.value += done - seen
        seen = done

    dataset, cached = get_walk(open_store(path), cell, dtypes=dtypes, progress=count)
    count(cell["states"], cell["states"])
    return row(cell, dataset, cached)


def warm_up():
    """Compile (or load from numba's cache) every kernel once, before workers do it each."""
    packing = pack(12, 0.5, 0)
    walk(ensemble(packing), 2, 0)
