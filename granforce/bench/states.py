"""Walks against exact intervals."""

import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from granforce import measures
from granforce.bench.runner import Row, note
from granforce.bench.runner import packings as cases_of
from granforce.explore.intervals import intervals as exact_intervals
from granforce.explore.random_walk import walk
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest_piqp import nearest_piqp
from granforce.motion.gauss_seidel import gauss_seidel
from granforce.system.clock import timed
from granforce.types import Floats

WALKS: Mapping[str, dict[str, Any]] = {
    "Gauss–Seidel, exact finish": {"relax": gauss_seidel},
    "nearest (PIQP)": {"relax": nearest_piqp},
}


def intervals(
    n: int = 400, frictions: Sequence[float] = (0.1, 1.0), states: Sequence[int] = (100, 300, 1000)
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
        for name in WALKS:
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
