"""The runner of the benchmark: cases, each computed by several methods, and what is measured.

A part of the benchmark names these three and gets rows, which are dicts of plain numbers and text.
"""

import resource
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.packing.compaction import pack
from granforce.records import Packing, make_contacts, make_packing
from granforce.system.clock import timed
from granforce.types import Floats, Rows

Row = dict[str, Any]
Cases = Iterator[tuple[Row, Ensemble]]  # the columns that name a case, and its ensemble
Methods = Mapping[str, Callable[[], Any]]
LONG = 5.0  # seconds of a run that is not repeated


def note(message: str) -> None:
    """One line of progress on stderr."""
    print(message, file=sys.stderr, flush=True)


def packings(part: str, n: int, frictions: Iterable[float], seed: int = 1) -> Cases:
    """A packing at each friction."""
    for mu in frictions:
        note(f"{part}: N = {n}, μ = {mu:g}")
        yield {"n": n, "mu": mu}, ensemble(pack(n, mu, seed))


def tilings(part: str, base: Ensemble, tiles: Iterable[int]) -> Cases:
    """A packing repeated k × k times, for each k."""
    for k in tiles:
        n = len(base.packing.r) * k * k
        note(f"{part}: N = {n}")
        yield {"n": n}, ensemble(tile(base, k), prune=False)


def compared(
    case: Row,
    methods: Methods,
    measure: Callable[[str, dict[str, Any]], Row],
    baseline: str,
    *,
    repeats: int = 1,
    over_baseline: bool = False,
) -> list[Row]:
    """A row for each method: the least seconds of its runs, and measure(method, all results).

    ratio: seconds of the baseline over those of the method, or, if over_baseline, the inverse.
    """
    seconds, results = {}, {}
    for name, method in methods.items():
        taken: list[float] = []
        while len(taken) < repeats and max(taken, default=0.0) < LONG:
            spent, results[name] = timed(method)
            taken.append(spent)
        seconds[name] = min(taken)
    rows = []
    for name, spent in seconds.items():
        ratio = seconds[baseline] / spent
        row = case | {
            "method": name,
            "seconds": spent,
            "ratio": 1 / ratio if over_baseline else ratio,
        }
        rows.append(row | measure(name, results))
    return rows


def means(samples: Sequence[Row]) -> Row:
    """Means over packings, without NaN; None without any number. Samples may be empty: failed."""
    complete = [one for one in samples if one]
    with warnings.catch_warnings(action="ignore"):  # of no number
        averages = {
            name: float(np.nanmean([float(one[name]) for one in complete]))
            for name in (complete[0] if complete else ())
        }
    return {name: None if np.isnan(mean) else mean for name, mean in averages.items()}


def exponent(points: Sequence[tuple[float, float]]) -> float | None:
    """Slope of log y over log x of points (x, y), or None for fewer than two."""
    if len(points) < 2:
        return None
    x, y = np.log(points).T
    return float(np.polyfit(x, y, 1)[0])


def growth_of(rows: Rows, column: str) -> float | None:
    """The exponent with which a column grows with N, over the rows that have it."""
    return exponent([(row["n"], row[column]) for row in rows if column in row])


def peak_megabytes() -> float:
    """Largest memory of this process until now."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def kicked(S: Ensemble, count: int, seed: int) -> list[Floats]:
    """Starts of the random walk from the original network, a list of (N_c, 2)."""
    rng = np.random.default_rng(seed)
    amplitude = np.mean(S.original[:, 0])
    kicks = rng.uniform(-amplitude, amplitude, (count, *S.original.shape))
    if S.mu == 0:
        kicks[..., 1] = 0.0
    return list(S.original + kicks)


def tile(S: Ensemble, k: int) -> Packing:
    """The packing of an ensemble repeated k × k times: N k² disks, exactly as balanced.

    Only the ensemble's contacts are kept; build the new ensemble with ``prune=False``.
    """
    packing, contacts = S.packing, S.contacts
    i, j, count = contacts.i, contacts.j, len(packing.r)
    # Number of cells between i and the touching image of j.
    reach = packing.x[i] + contacts.length[:, None] * contacts.normal - packing.x[j]
    image = np.rint(packing.cell.parts(reach)).astype(np.int64)
    column, row = (part.ravel() for part in np.meshgrid(np.arange(k), np.arange(k)))
    x = packing.x[None] + (np.column_stack([column, row]) @ packing.cell.vectors)[:, None]
    to = (column[:, None] + image[:, 0]) % k + k * ((row[:, None] + image[:, 1]) % k)
    tiles = k * k
    r = np.tile(packing.r, tiles)
    repeated = make_contacts(
        (np.arange(tiles)[:, None] * count + i).ravel(),
        (to * count + j).ravel(),
        np.tile(contacts.normal, (tiles, 1)),
        np.tile(contacts.length, tiles),
        r,
    )
    arms = {name: np.tile(getattr(contacts, name), tiles) for name in ("gap", "arm_i", "arm_j")}
    return make_packing(
        x.reshape(-1, 2),
        r,
        k * packing.box,
        repeated._replace(**arms),
        np.tile(S.original, (tiles, 1)),
        packing.mu,
        packing.pressure,
        tilt=k * packing.tilt,
    )
