"""The effect of the solver on the random walk, and walks against exact intervals."""

import contextlib
import multiprocessing
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np

from granforce import measures
from granforce.bench.runner import Row, means, note
from granforce.bench.runner import packings as cases_of
from granforce.explore.intervals import intervals as exact_intervals
from granforce.explore.random_walk import walk
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import nearest
from granforce.forces.nearest_piqp import nearest_piqp
from granforce.motion.gauss_seidel import gauss_seidel
from granforce.packing.compaction import pack
from granforce.records import NotJammedError, Packing
from granforce.system.clock import timed
from granforce.tolerances import EQUILIBRIUM
from granforce.types import Floats

Ways = Mapping[str, dict[str, Any]]
WALKS: Ways = {
    "Gauss–Seidel alone": {
        "relax": gauss_seidel,
        "rest": None,
        "tolerance": EQUILIBRIUM,
        "max_iterations": 20_000,
    },
    "Gauss–Seidel, exact finish": {"relax": gauss_seidel},
    "nearest (PIQP)": {"relax": nearest_piqp},
    "nearest": {"relax": nearest},
}
FRICTIONS = (0.01, 0.1, 1.0)
# Attempts per state after which a walk has failed: Gauss–Seidel alone, which seldom ends in
# equilibrium at large μ, would take hours.
ATTEMPTS = 4


def walks(
    n: int = 400,
    packings: int = 10,
    states: int = 60,
    frictions: Sequence[float] = FRICTIONS,
    ways: Ways = WALKS,
) -> list[Row]:
    """Rows: η1, η2, η3 and distance from the centre, mean ± standard error over packings.

    Every solver walks on the same packings with the same seeds. The distance is ⟨|F − C|⟩/|C|, C
    the mean over the solvers of their mean networks; `original` is that of the packing's own
    network. A walk that needed more than ATTEMPTS per state is left out and counted in `failed`:
    such a row is a mean over fewer packings and cannot be compared with the others. ways: {name of
    a solver: options of `walk`}.
    """
    rows = []
    for mu in frictions:
        results: dict[str, list[Row]] = {name: [] for name in ways}
        for seed in range(1, packings + 1):
            note(f"walks: N = {n}, μ = {mu:g}, packing {seed} of {packings}")
            S = ensemble(pack(n, mu, seed))
            for name, values in _walked(S, states, seed, ways).items():
                results[name].append(values)
        for name, samples in results.items():
            row = {"n": n, "mu": mu, "solver": name, "packings": packings, "states": states}
            rows.append(row | _over_packings(samples))
    return rows


def _walked(S: Ensemble, states: int, seed: int, ways: Ways) -> dict[str, Row]:
    """Measures by solver on one packing; an empty dict for a walk that failed."""
    done, seconds = {}, {}
    for name, options in ways.items():
        with contextlib.suppress(NotJammedError):
            walk(S, 1, seed, max_attempts=ATTEMPTS, **options)  # compiles
        begin = time.perf_counter()
        with contextlib.suppress(NotJammedError):
            done[name] = walk(S, states, seed, max_attempts=ATTEMPTS * states, **options)
        seconds[name] = time.perf_counter() - begin
    if not done:
        return {name: {} for name in ways}
    centre = np.mean([measures.mean_network(w.states) for w in done.values()], axis=0)
    size = np.linalg.norm(centre)
    results: dict[Any, dict[Any, Any]] = {name: {} for name in ways}
    for name, one in done.items():
        results[name] = {
            "eta1": measures.eta1(one.states),
            "eta2": measures.eta2(one.states),
            "eta3": measures.eta3(*measures.sampled_intervals(one.states)),
            "distance": float(measures.distances(one.states, centre).mean() / size),
            "original": float(np.linalg.norm(S.original - centre) / size),
            "acceptance": one.acceptance,
            "seconds": seconds[name],
        }
    return results


def _over_packings(samples: Sequence[Row]) -> Row:
    complete = [one for one in samples if one]
    row: Row = {"failed": len(samples) - len(complete)}
    for key, mean in means(samples).items():
        row[key] = mean
        if key.startswith(("eta", "distance")) and len(complete) > 1:
            numbers = [one[key] for one in complete]
            row[f"{key}_error"] = float(np.std(numbers, ddof=1) / np.sqrt(len(numbers)))
    return row


def batches(n: int = 400, states: int = 400, frictions: Sequence[float] = FRICTIONS) -> list[Row]:
    """Rows: states per second of two chains on one thread and on two, with the default relaxation.

    Chains share everything that depends only on the geometry (matrices, the plan of the
    factorisation); `setup` is the time it takes once. Medians of three interleaved runs. `ceiling`
    is the ratio reached by two processes that share only the machine.
    """
    rows = []
    for case, S in cases_of("batches", n, frictions):
        walk(ensemble(S.packing), 1, 0)  # compiles
        setup, _ = timed(walk, S, 1, 0)
        seconds: dict[int, list[float]] = {1: [], 2: []}
        for _ in range(3):
            for workers, times in seconds.items():
                times.append(timed(walk, S, states, 0, chains=2, workers=workers)[0])
        one, two = (states / np.median(times) for times in seconds.values())
        row = case | {"states": states, "setup": setup, "per_second": one, "per_second_2": two}
        rows.append(row | {"ratio": two / one, "ceiling": _ceiling(S, states)})
    return rows


def _ceiling(S: Ensemble, states: int) -> float:
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        alone = pool.submit(_speed, S.packing, states).result()
        together = [pool.submit(_speed, S.packing, states) for _ in range(2)]
        return sum(one.result() for one in together) / alone


def _speed(packing: Packing, states: int) -> float:
    """States per second of one chain in this process."""
    S = ensemble(packing)
    walk(S, 2, 0)
    return states / timed(walk, S, states, 0)[0]


def intervals(
    n: int = 400,
    frictions: Sequence[float] = (0.1, 1.0),
    states: Sequence[int] = (100, 300, 1000),
) -> list[Row]:
    """Rows: η3 and mean ΔF_n seen by walks of growing length, against the exact intervals.

    Exact bounds come with their run time, so that the costs can be compared.
    """
    rows = []
    for case, S in cases_of("intervals", n, frictions):
        exact_intervals(S, S.index[:1])  # compiles
        seconds, exact = timed(exact_intervals, S, workers=2)
        eta3, extent = _extents(S, exact.low, exact.high)
        rows.append(
            {**case, "method": "exact", "states": 0, "seconds": seconds, "eta3": eta3}
            | {"mean_extent": extent, "eta3_part": 1.0, "extent_part": 1.0}
        )
        for name in ("Gauss–Seidel, exact finish", "nearest (PIQP)"):
            note(f"intervals: {name}")
            growing = _growing(S, name, states, eta3, extent)
            rows += [{**case, "method": name, **numbers} for numbers in growing]
    return rows


def _extents(S: Ensemble, lower: Floats, upper: Floats) -> tuple[float, float]:
    """η3 and the mean length of the intervals of f_n, in ⟨f_n⟩."""
    extent = measures.normal_extent(lower, upper).mean() / S.force_scale
    return measures.eta3(lower, upper), float(extent)


def _growing(
    S: Ensemble, name: str, counts: Sequence[int], eta3: float, extent: float
) -> Iterator[dict[str, Any]]:
    walk(S, 1, 1, **WALKS[name])  # compiles
    times, begin = [], time.perf_counter()
    done = walk(
        S,
        max(counts),
        1,
        **WALKS[name],
        progress=lambda count, total: times.append(time.perf_counter() - begin),
    )
    for count in counts:
        low, high = measures.sampled_intervals(done.states[:count])
        seen_eta3, seen_extent = _extents(S, low, high)
        yield {
            "states": count,
            "seconds": times[min(count, len(times)) - 1] if times else 0.0,
            "eta3": seen_eta3,
            "mean_extent": seen_extent,
            "eta3_part": seen_eta3 / eta3 if eta3 else None,
            "extent_part": seen_extent / extent if extent else None,
        }
