"""Compaction: run time against overlap, against μ and N. Kernels are compiled before."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from granforce.bench.report import exponent, note
from granforce.forces.build import ensemble
from granforce.packing.compaction import pack
from granforce.records import NotJammedError
from granforce.system.clock import timed

WARM_UP = 100  # disks of the packing made before, which compiles all kernels
MOST_SEEDS = 10
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
    """Rows: run time and mean overlap of the dynamics, and φ, z, h of the resulting packing.

    One row per longest time step Δt and accuracy of a step: the median run time, and means over
    seeds. Mean overlap against run time is the figure of merit of arXiv:0803.3566 (its Fig. 7).
    Every packing is then finished exactly, so that this error affects only where it jams; runs that
    did not jam are left out and counted in `failed`.
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
    """Rows: time to a certified packing at each μ: median and slowest of the seeds."""
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
    """Rows: time to a certified packing for growing N, and the exponent of the median with N.

    Small packings take little time, which varies much: there are more of them.
    """
    sizes = sizes or ((50, 100, 200) if quick else (100, 400, 1600, 6400))
    seeds = seeds or (2 if quick else 3)
    counts = [min(MOST_SEEDS, max(1, seeds * 400 // n)) for n in sizes]
    rows = [_row(n, mu, count) for n, count in zip(sizes, counts, strict=True)]
    jammed = [(row["n"], row["seconds"]) for row in rows if "seconds" in row]
    return [*rows, {"n": "fit", "mu": mu, "exponent": exponent(jammed)}]


def _row(n: int, mu: float, seeds: int, **options: Any) -> dict[str, Any]:
    settings = "".join(f", {name} {value:g}" for name, value in options.items())
    note(f"compaction: N = {n}, μ = {mu:g}{settings}")
    _packed(min(n, WARM_UP), mu, 1, **options)
    packings = [_packed(n, mu, seed, **options) for seed in range(1, seeds + 1)]
    jammed = [one for one in packings if one]
    row = {"n": n, "mu": mu, "seeds": seeds, "failed": len(packings) - len(jammed)}
    for key in jammed[0] if jammed else ():
        row[key] = float(np.mean([one[key] for one in jammed]))
    if jammed:
        row["seconds"] = float(np.median([one["seconds"] for one in jammed]))
        row["slowest"] = max(one["seconds"] for one in jammed)
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
