"""Benchmark of the exact bounds against a plain loop over linear programs, and other tools."""

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linprog

from granforce.bench.report import table
from granforce.explore.intervals import intervals
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.numerics import highs as programs
from granforce.packing.importers import load_packing
from granforce.system.clock import timed
from granforce.types import Floats


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


def cobra_loop(ensemble: Ensemble) -> tuple[Floats, ...]:
    """All bounds by cobra's flux variability analysis, contacts as reactions on grains."""
    from cobra import Metabolite, Model, Reaction
    from cobra.flux_analysis import flux_variability_analysis

    A, T = ensemble.cone_form
    A, b = A.tocsc(), ensemble.b / ensemble.force_scale
    model = Model("packing")
    balances = [Metabolite(f"row{k}") for k in range(A.shape[0])]
    generators = []
    for k in range(A.shape[1]):
        reaction = Reaction(f"y{k}", lower_bound=0.0, upper_bound=1e6)
        column = A[:, [k]]
        entries = zip(column.indices, column.data, strict=True)
        reaction.add_metabolites({balances[row]: float(value) for row, value in entries})
        generators.append(reaction)
    model.add_reactions(generators)
    for k, balance in enumerate(balances):
        model.constraints[balance.id].ub = float(b[k])
        model.constraints[balance.id].lb = float(b[k])
    forces = [Reaction(f"x{k}", lower_bound=-1e6, upper_bound=1e6) for k in range(A.shape[1])]
    links = [Metabolite(f"link{k}") for k in range(A.shape[1])]
    for k, (force, row) in enumerate(zip(forces, T.toarray(), strict=True)):
        force.add_metabolites({links[k]: -1.0})
        for g in np.flatnonzero(row):
            generators[g].add_metabolites({links[k]: float(row[g])})
    model.add_reactions(forces)
    ranges = flux_variability_analysis(model, forces, fraction_of_optimum=0.0, processes=1)
    value = np.stack([ranges["minimum"].to_numpy(), ranges["maximum"].to_numpy()])
    return tuple(ensemble.to_forces(value * ensemble.force_scale))


def run(quick: bool = True, folder: Path = Path("tests/reference")) -> list[dict[str, Any]]:
    """Rows: times (s), their ratios to the plain loop's, and errors (⟨f_n⟩), by file and method.

    quick: only the 100-disk files; otherwise 400 disks at μ = 0.1 as well (two minutes).
    """
    names = ["n100_mu0.1_s11", "n100_mu1_s12"] + ([] if quick else ["n400_mu0.1_s13"])
    compared: list[dict[str, Any]] = []
    for name in names:
        system, data = read_reference(Path(folder) / f"{name}.npz")
        intervals(system, system.index[:1])  # compiles
        rows = {"plain loop": _timed(plain_loop, system, data)}
        for workers in (1, 2):
            threads = f"{workers} thread{'s' if workers > 1 else ''}"
            rows[f"granforce, {threads}"] = _ours(system, data, workers)
        if name.startswith("n100"):
            rows["scipy linprog"] = _timed(linprog_loop, system, data)
            if importlib.util.find_spec("cobra"):
                rows["cobra FVA"] = _timed(cobra_loop, system, data)
        plain = rows["plain loop"]["seconds"]
        for method, row in rows.items():
            timing = {"packing": name, "method": method, "seconds": row["seconds"]}
            compared.append(timing | {"ratio": plain / row["seconds"]} | row)
    return compared


def _ours(system: Ensemble, data: Any, workers: int) -> dict[str, Any]:
    seconds, exact = timed(intervals, system, workers=workers)
    error = _error(system, data, exact.low, exact.high)
    return {"seconds": seconds, "error": error, "gap": exact.max_gap, "counts": str(exact.counts)}


def _timed(method: Callable[..., Any], system: Ensemble, data: Any) -> dict[str, Any]:
    seconds, (lower, upper) = timed(method, system)
    return {"seconds": seconds, "error": _error(system, data, lower, upper)}


def _error(system: Ensemble, data: Any, lower: Floats, upper: Floats) -> float:
    off = np.abs(lower - data["lo"][system.index]), np.abs(upper - data["hi"][system.index])
    return float(np.max(off) / system.force_scale)


if __name__ == "__main__":
    import sys

    print(table("Exact intervals against other tools", run(quick="--full" not in sys.argv)))
