"""Benchmark of the exact bounds against a plain loop over linear programs, and other tools."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linprog

from granforce.bench.runner import Row, compared, note
from granforce.explore.intervals import Intervals, intervals
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.numerics import highs as programs
from granforce.packing.importers import load_packing
from granforce.types import Floats

# Packings with exact intervals, in a clone of the repository.
FOLDER = Path("tests/reference")
REFERENCES = ("n100_mu0.1_s11", "n100_mu1_s12", "n400_mu0.1_s13")


def read_reference(path: str | Path) -> tuple[Ensemble, Any]:
    """The Ensemble of a reference file (NPZ) and its arrays."""
    return ensemble(load_packing(path)), np.load(path)


def plain_loop(ensemble: Ensemble, contacts: Any = None) -> tuple[Floats, ...]:
    """Bounds (k, 2), (k, 2) by one HiGHS model, each program starting from the last basis.

    contacts: numbers in the packing, default all. One thread, primal simplex, nothing skipped;
    first all minima, then all maxima.
    """
    A, b, T = ensemble.scaled_form
    model = programs.going_on(A, b)
    places = ensemble.positions(ensemble.index if contacts is None else contacts)
    parts = ensemble.per_contact
    rows = T.tocsr()[(parts * places[:, None] + np.arange(parts)).ravel()].toarray()
    value = np.zeros((2, len(rows)))
    for side, sign in enumerate((1.0, -1.0)):
        for k, row in enumerate(rows):
            programs.set_cost(model, sign * row)
            _, y = programs.solve(model)
            value[side, k] = row @ y
    forces = np.zeros((2, len(places), 2))
    forces[..., :parts] = ensemble.force_scale * value.reshape(2, len(places), parts)
    return tuple(forces)


def linprog_loop(ensemble: Ensemble) -> tuple[Floats, ...]:
    """All bounds by scipy's linprog, one call per bound; shapes as in `plain_loop`."""
    A, T = ensemble.cone_form
    b = ensemble.b / ensemble.force_scale
    value = [
        [sign * linprog(sign * row, A_eq=A, b_eq=b, method="highs").fun for row in T.toarray()]
        for sign in (1.0, -1.0)
    ]
    return tuple(ensemble.to_forces(np.array(value) * ensemble.force_scale))


def interval_methods(names: Sequence[str] = REFERENCES, folder: str | Path = FOLDER) -> list[Row]:
    """Rows: times (s), their ratios to the plain loop's, and errors (⟨f_n⟩), by file and method.

    Errors are against the reference bounds; rows of granforce also have the largest duality gap and
    counts. Two minutes for 400 disks. A single row with a note if the files are missing.
    """
    if not any(Path(folder).glob("*.npz")):
        return [{"packing": None, "note": f"reference packings not found in {folder}"}]
    rows: list[Row] = []
    for name in names:
        note(f"intervals against other tools: {name}")
        S, data = read_reference(Path(folder) / f"{name}.npz")
        intervals(S, S.index[:1])  # compiles
        methods: dict[str, Callable[[], Any]] = {
            "plain loop": partial(plain_loop, S),
            "granforce, 1 thread": partial(intervals, S, workers=1),
            "granforce, 2 threads": partial(intervals, S, workers=2),
        }
        if name.startswith("n100"):
            methods["scipy linprog"] = partial(linprog_loop, S)

        rows += compared({"packing": name}, methods, partial(_errors, S, data), "plain loop")
    return rows


def _errors(S: Ensemble, data: Any, method: str, results: Row) -> Row:
    found = results[method]
    ours = isinstance(found, Intervals)
    low, high = (found.low, found.high) if ours else found
    off = np.abs(low - data["lo"][S.index]), np.abs(high - data["hi"][S.index])
    counts = {"gap": found.max_gap, "counts": str(found.counts)} if ours else {}
    return {"error": float(np.max(off) / S.force_scale)} | counts
