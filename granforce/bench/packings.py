"""Compaction: run time against overlap, against μ and N; and whether settings change packings."""

import time
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from granforce import measures
from granforce.bench.report import exponent, note
from granforce.explore.intervals import intervals
from granforce.explore.random_walk import walk
from granforce.forces.ensemble import ensemble
from granforce.packing.compaction import pack
from granforce.records import NotJammedError
from granforce.system.clock import timed

FRICTIONS = (0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)


def compaction(
    quick: bool = True,
    *,
    n: int | None = None,
    mu: float = 0.1,
    steps: Sequence[float] | None = None,
    accuracies: Sequence[float] | None = None,
    seeds: int | None = None,
) -> list[dict[str, Any]]:
    """Rows: run time and mean overlap of the dynamics, and φ, z, h of the packing it gave.

    One row per longest time step Δt and accuracy of a step; means over seeds. Mean overlap against
    run time is the figure of merit of arXiv:0803.3566 (its Fig. 7). Every packing is then
    finished exactly, so that of this error only the place where it jams is left; runs that did
    not jam are left out of the means and counted in `failed`.
    """
    n = n or (100 if quick else 400)
    steps = steps or ((0.05, 0.1) if quick else (0.02, 0.05, 0.1, 0.2))
    accuracies = accuracies or ((0.1, 0.01) if quick else (0.1, 0.01, 0.001))
    seeds = seeds or (2 if quick else 3)
    return [
        _row(n, mu, seeds, dt=dt, accuracy=each) | {"dt": dt, "accuracy": each}
        for dt in steps
        for each in accuracies
    ]


def compaction_frictions(
    quick: bool = True,
    *,
    n: int | None = None,
    frictions: Sequence[float] | None = None,
    seeds: int | None = None,
) -> list[dict[str, Any]]:
    """Rows: time to a certified packing at each μ; means, and the slowest of the seeds."""
    n = n or (100 if quick else 400)
    frictions = frictions or (FRICTIONS[::3] if quick else FRICTIONS)
    return [_row(n, mu, seeds or (2 if quick else 5)) for mu in frictions]


def compaction_growth(
    quick: bool = True,
    *,
    mu: float = 0.1,
    sizes: Sequence[int] | None = None,
    seeds: int | None = None,
) -> list[dict[str, Any]]:
    """Rows: time to a certified packing at growing N, and the exponent of time with N."""
    sizes = sizes or ((50, 100, 200) if quick else (100, 400, 1600, 6400))
    seeds = seeds or (2 if quick else 3)
    # Large packings vary less, and take long.
    rows = [_row(n, mu, seeds if n <= 400 else 1) for n in sizes]
    jammed = [(row["n"], row["seconds"]) for row in rows if "seconds" in row]
    return [*rows, {"n": "fit", "mu": mu, "exponent": exponent(jammed)}]


# How packings may be made otherwise: none of it may change what they are in the mean.
SETTINGS: dict[str, dict[str, Any]] = {
    "default": {},
    "Δt to 0.05": {"dt": 0.05},
    "accuracy 0.003": {"accuracy": 0.003, "sweeps": 2400},
    "box mass 30": {"box_mass": 30.0},
}
LIMIT_STATES = 200  # of the walk for η2
# Longest time steps and most sweeps. In still shorter steps, gaps that have just opened lie within
# TOUCHING: such pairs then count as contacts.
STEPS = ((0.1, 600), (0.1, 150), (0.03, 600), (0.03, 150), (0.01, 600), (0.003, 600))


def compaction_limit(
    quick: bool = True,
    *,
    n: int | None = None,
    frictions: Sequence[float] = (0.1, 0.5, 1.0, 10.0),
    seeds: int | None = None,
) -> list[dict[str, Any]]:
    """Rows: φ, z, h, exact η3 and η2 of packings, and what they took, by μ and by SETTINGS.

    Means over seeds with their standard errors, "18.1 ± 0.9": packings have a limit where they
    agree.
    """
    return _limit(n or (60 if quick else 400), frictions, seeds or (3 if quick else 10), SETTINGS)


def compaction_time_steps(
    quick: bool = True,
    *,
    n: int | None = None,
    frictions: Sequence[float] = (0.1, 0.3, 0.5, 1.0, 3.0, 10.0),
    seeds: int | None = None,
) -> list[dict[str, Any]]:
    """Rows as of `compaction_limit`, by μ and by the longest time step and its sweeps (STEPS)."""
    settings = {
        f"Δt to {dt:g}, {sweeps} sweeps": {"dt": dt, "sweeps": sweeps, "max_steps": 1_000_000}
        for dt, sweeps in STEPS[: 2 if quick else None]
    }
    return _limit(n or (40 if quick else 100), frictions, seeds or (3 if quick else 20), settings)


def _limit(
    n: int, frictions: Sequence[float], seeds: int, settings: dict[str, dict[str, Any]]
) -> list[dict[str, Any]]:
    rows = []
    for mu in frictions:
        for name, options in settings.items():
            note(f"limit: N = {n}, μ = {mu:g}, {name}")
            made = [_extent(n, mu, seed, options) for seed in range(1, seeds + 1)]
            kept = [one for one in made if one]
            row: dict[str, Any] = {"n": n, "mu": mu, "settings": name}
            row["failed"] = seeds - len(kept)
            rows.append(row | {key: _told([one[key] for one in kept]) for key in _keys(kept)})
    return rows


def _keys(kept: Sequence[dict[str, float]]) -> Iterable[str]:
    return kept[0] if kept else ()


def _extent(n: int, mu: float, seed: int, options: dict[str, Any]) -> dict[str, float]:
    try:
        seconds, packing = timed(pack, n, mu, seed, clock=time.process_time, **options)
    except NotJammedError:
        return {}
    S = ensemble(packing)
    bounds = intervals(S)
    return {
        "phi": packing.packing_fraction,
        "z": S.coordination,
        "h": S.dimension,
        "exact_eta3": measures.eta3(bounds.lower, bounds.upper),
        "eta2": measures.eta2(walk(S, LIMIT_STATES, seed=seed).states),
        "unfinished": packing.info["unfinished_steps"] / packing.info["steps"],
        "cpu_seconds": seconds,
    }


def _told(values: list[float]) -> str:
    """Mean ± standard error, to two digits of the error."""
    mean, error = np.mean(values), np.std(values, ddof=1) / np.sqrt(len(values))
    digits = max(0, 1 - int(np.floor(np.log10(error)))) if error > 0 else 3
    return f"{mean:.{digits}f} ± {error:.{digits}f}"


def _row(n: int, mu: float, seeds: int, **options: Any) -> dict[str, Any]:
    told = "".join(f", {name} {value:g}" for name, value in options.items())
    note(f"compaction: N = {n}, μ = {mu:g}{told}")
    made = [_packed(n, mu, seed, **options) for seed in range(1, seeds + 1)]
    kept = [one for one in made if one]
    row = {"n": n, "mu": mu, "seeds": seeds, "failed": len(made) - len(kept)}
    for key in _keys(kept):
        row[key] = float(np.mean([one[key] for one in kept]))
    if kept:
        row["slowest"] = max(one["seconds"] for one in kept)
    return row


def _packed(n: int, mu: float, seed: int, **options: Any) -> dict[str, Any]:
    try:
        seconds, packing = timed(pack, n, mu, seed, **options)
    except NotJammedError:
        return {}
    S = ensemble(packing)
    return {
        "seconds": seconds,
        "steps": packing.info["steps"],
        "contact_updates": packing.info["contact_updates"],
        "networks_tried": packing.info["certificates_tried"],
        "overlap": packing.info["mean_overlap_of_dynamics"],
        "phi": packing.packing_fraction,
        "z": S.coordination,
        "h": S.dimension,
    }
