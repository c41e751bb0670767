"""Compaction: run time against overlap, against μ and N. Kernels are compiled before."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from granforce.bench.runner import Row, growth_of, means, note
from granforce.forces.build import ensemble
from granforce.motion.rest import rest
from granforce.packing.compaction import pack
from granforce.records import NotJammedError
from granforce.system.clock import timed

WARM_UP = 100  # disks of the packing made before, which compiles all kernels
MOST_SEEDS = 10
FRICTIONS = (0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)


def compaction(
    n: int = 400,
    mu: float = 0.1,
    steps: Sequence[float] = (0.02, 0.05, 0.1, 0.2),
    accuracies: Sequence[float] = (0.1, 0.01, 0.001),
    seeds: int = 3,
) -> list[Row]:
    """Rows: run time and mean overlap of the dynamics, and φ, z, h of the resulting packing.

    One row per longest time step Δt and accuracy of a step: the median run time, and means over
    seeds. Mean overlap against run time is the figure of merit of arXiv:0803.3566 (its Fig. 7).
    Every packing is then finished exactly, so that this error affects only where it jams; runs that
    did not jam are left out and counted in `failed`.
    """
    return [
        _row(n, mu, seeds, dt=dt, accuracy=each) | {"dt": dt, "accuracy": each}
        for dt in steps
        for each in accuracies
    ]


def compaction_frictions(
    n: int = 400, frictions: Sequence[float] = FRICTIONS, seeds: int = 5
) -> list[Row]:
    """Rows: time to a certified packing at each μ: median, slowest; mean of its test of rest."""
    return [_row(n, mu, seeds) for mu in frictions]


def compaction_growth(
    mu: float = 0.1, sizes: Sequence[int] = (100, 400, 1600, 6400), seeds: int = 3
) -> list[Row]:
    """Rows: time to a certified packing for growing N, and the exponent of the median with N.

    Small packings take little time, which varies much: there are more of them.
    """
    rows = [_row(n, mu, min(MOST_SEEDS, max(1, seeds * 400 // n))) for n in sizes]
    return [*rows, {"n": "fit", "mu": mu, "exponent": growth_of(rows, "seconds")}]


def _row(n: int, mu: float, seeds: int, **options: Any) -> Row:
    settings = "".join(f", {name} {value:g}" for name, value in options.items())
    note(f"compaction: N = {n}, μ = {mu:g}{settings}")
    _packed(min(n, WARM_UP), mu, 1, **options)
    packings = [_packed(n, mu, seed, **options) for seed in range(1, seeds + 1)]
    seconds = [one["seconds"] for one in packings if one]
    row = {"n": n, "mu": mu, "seeds": seeds, "failed": seeds - len(seconds), **means(packings)}
    if seconds:
        row |= {"seconds": float(np.median(seconds)), "slowest": max(seconds)}
    return row


def _packed(n: int, mu: float, seed: int, **options: Any) -> Row:
    try:
        seconds, packing = timed(pack, n, mu, seed, **options)
    except NotJammedError:
        return {}
    S = ensemble(packing)
    return {
        "seconds": seconds,
        "seconds_rest": timed(rest, packing)[0],
        "systems": packing.info["linear_systems"],
        "steps": packing.info["steps"],
        "contact_updates": packing.info["contact_updates"],
        "networks_tried": packing.info["certificates_tried"],
        "overlap": packing.info["mean_overlap_of_dynamics"],
        "phi": packing.packing_fraction,
        "z": S.coordination,
        "h": S.dimension,
    }
