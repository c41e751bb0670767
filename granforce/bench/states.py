"""The effect of the solver on the random walk, and walks against exact intervals."""

import contextlib
import multiprocessing
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from granforce import measures
from granforce.bench.report import note
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
# Packings with exact intervals for `granforce.bench.exact`, in a clone of the repository.
REFERENCES = Path("tests/reference")


def walks(
    quick: bool = True,
    *,
    n: int | None = None,
    packings: int | None = None,
    states: int | None = None,
    frictions: Sequence[float] = FRICTIONS,
    ways: Ways = WALKS,
) -> list[dict[str, Any]]:
    """Rows: η1, η2, η3 and distance from the centre, mean ± standard error over packings.

    Every solver walks on the same packings with the same seeds. The distance is ⟨|F − C|⟩/|C|, C
    the mean over the solvers of their mean networks; `original` is that of the packing's own
    network. A walk that needed more than ATTEMPTS per state is left out and counted in `failed`:
    such a row is a mean over fewer packings and cannot be compared with the others. ways: {name of
    a solver: options of `walk`}.
    """
    n = n or (100 if quick else 400)
    packings = packings or (3 if quick else 10)
    states = states or (50 if quick else 60)
    rows = []
    for mu in frictions:
        results: dict[Any, list[Any]] = {name: [] for name in ways}
        for seed in range(1, packings + 1):
            note(f"walks: N = {n}, μ = {mu:g}, packing {seed} of {packings}")
            S = ensemble(pack(n, mu, seed))
            for name, values in _walked(S, states, seed, ways).items():
                results[name].append(values)
        for name, values in results.items():
            row = {"n": n, "mu": mu, "solver": name, "packings": packings, "states": states}
            rows.append(row | _over_packings(values))
    return rows


def _walked(S: Ensemble, states: int, seed: int, ways: Ways) -> dict[str, dict[str, float]]:
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


def _over_packings(values: Sequence[dict[str, float]]) -> dict[str, Any]:
    complete = [one for one in values if one]
    row: dict[str, Any] = {"failed": len(values) - len(complete)}
    for key in complete[0] if complete else ():
        numbers = np.array([one[key] for one in complete])
        row[key] = float(numbers.mean())
        if key.startswith(("eta", "distance")) and len(numbers) > 1:
            row[f"{key}_error"] = float(numbers.std(ddof=1) / np.sqrt(len(numbers)))
    return row


def batches(
    quick: bool = True,
    *,
    n: int | None = None,
    states: int | None = None,
    frictions: Sequence[float] = FRICTIONS,
) -> list[dict[str, Any]]:
    """Rows: states per second of two chains on one thread and on two, with the default relaxation.

    Chains share everything that depends only on the geometry (matrices, the plan of the
    factorisation); `setup` is the time it takes once. Medians of three interleaved runs. `ceiling`
    is the ratio reached by two processes that share only the machine.
    """
    n = n or (100 if quick else 400)
    states = states or (100 if quick else 400)
    rows = []
    for mu in frictions:
        note(f"batches: N = {n}, μ = {mu:g}")
        S = ensemble(pack(n, mu, 1))
        walk(ensemble(S.packing), 1, 0)  # compiles
        setup, _ = timed(walk, S, 1, 0)
        seconds: dict[Any, list[Any]] = {1: [], 2: []}
        for _ in range(3):
            for workers, times in seconds.items():
                times.append(timed(walk, S, states, 0, chains=2, workers=workers)[0])
        one, two = (states / np.median(times) for times in seconds.values())
        row = {"n": n, "mu": mu, "states": states, "setup": setup, "per_second": one}
        ceiling = _ceiling(S, states)
        rows.append({**row, "per_second_2": two, "ratio": two / one, "ceiling": ceiling})
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
    quick: bool = True,
    *,
    n: int | None = None,
    frictions: Sequence[float] | None = None,
    states: Sequence[int] | None = None,
) -> list[dict[str, Any]]:
    """Rows: η3 and mean ΔF_n seen by walks of growing length, against the exact intervals.

    Exact bounds come with their run time, so that the costs can be compared.
    """
    n = n or (100 if quick else 400)
    frictions = frictions or ((0.1,) if quick else (0.1, 1.0))
    states = states or ((30, 100) if quick else (100, 300, 1000))
    rows = []
    for mu in frictions:
        S = ensemble(pack(n, mu, 1))
        note(f"intervals: N = {n}, μ = {mu:g}, exact")
        exact_intervals(S, S.index[:1])  # compiles
        seconds, exact = timed(exact_intervals, S, workers=2)
        row = {"n": n, "mu": mu}
        eta3, extent = _extents(S, exact.low, exact.high)
        measured = {"eta3": eta3, "mean_extent": extent, "eta3_part": 1.0, "extent_part": 1.0}
        rows.append({**row, "method": "exact", "states": 0, "seconds": seconds, **measured})
        for name in ("Gauss–Seidel, exact finish", "nearest (PIQP)"):
            note(f"intervals: N = {n}, μ = {mu:g}, {name}")
            rows += [
                {**row, "method": name, **numbers}
                for numbers in _growing(S, name, states, eta3, extent)
            ]
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


def interval_methods(quick: bool = True, *, folder: Path = REFERENCES) -> list[dict[str, Any]]:
    """Exact intervals against other tools, by `granforce.bench.exact` (needs its packings).

    Rows with time, ratio to a plain loop over programs, and error against the reference bounds in
    ⟨f_n⟩; those of granforce also with the largest duality gap and counts. A single row with a note
    if the reference files are missing.
    """
    if not any(Path(folder).glob("*.npz")):
        return [{"packing": None, "note": f"reference packings not found in {folder}"}]
    from granforce.bench import exact

    note("intervals against other tools")
    return exact.run(quick, folder)
