"""Relaxation solvers compared: time and result from the same starts, and scaling with N."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from granforce.bench.runner import Row, growth_of, kicked, packings, tilings
from granforce.bench.siconos import ABSENT, TOLERANCES, against_siconos
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import nearest
from granforce.forces.nearest_piqp import nearest_piqp
from granforce.motion.contact_dynamics import StepProblem, add_forces, set_stiffness, sweep
from granforce.motion.contact_groups import grouped, sweep_groups, ungroup
from granforce.motion.gauss_seidel import SideBySide, from_rest, gauss_seidel
from granforce.numerics.lanes import LANES, ONE, allocating
from granforce.packing.compaction import pack
from granforce.records import Relaxation
from granforce.system.clock import timed
from granforce.types import Floats, Rows

BASELINE = "Gauss–Seidel alone"
# Residual (in ⟨f_n⟩) requested from all solvers.
GOAL = 1e-9
# Sweeps after which Gauss–Seidel alone is stopped: 3 to 5 s at N = 400.
LONGEST = 300_000
FRICTIONS = (0.01, 0.1, 0.3, 1.0, 10.0)
# Runs are repeated until they take so many seconds together, but at most so often.
STEADY, REPEATS = 0.2, 20


def solvers(sweeps: int = LONGEST) -> dict[str, tuple[Callable[..., Relaxation], dict[str, Any]]]:
    """Name → (solver, options) of all solvers to compare."""
    return {
        BASELINE: (gauss_seidel, {"rest": None, "tolerance": GOAL, "max_iterations": sweeps}),
        "Gauss–Seidel, exact finish": (gauss_seidel, {"tolerance": GOAL, "max_iterations": sweeps}),
        "nearest (PIQP)": (nearest_piqp, {"tolerance": GOAL}),
        "nearest": (nearest, {"tolerance": GOAL}),
    }


def relaxation(
    n: int = 400, frictions: Sequence[float] = FRICTIONS, repeats: int = 9, sweeps: int = LONGEST
) -> list[Row]:
    """Rows per μ and solver: median time of one relaxation, residual, ratio to BASELINE.

    All solvers get the same starts, the packing's own network kicked as in the random walk. If the
    baseline did not reach GOAL within its sweeps the ratio is a lower bound, which is marked.
    """
    rows = []
    for case, S in packings("relaxation", n, frictions):
        starts = kicked(S, repeats, 0)
        runs = {name: runs_of(S, starts, *solver) for name, solver in solvers(sweeps).items()}
        for name, run in runs.items():
            row = case | {"contacts": len(S.index), "solver": name} | summary(run)
            rows.append(row | _ratio(runs[BASELINE], run))
    return rows


def runs_of(
    S: Ensemble,
    starts: Sequence[Floats],
    solver: Callable[..., Relaxation],
    options: dict[str, Any],
) -> list[Relaxation]:
    """The result of a solver from each start (N_c, 2), without the overhead of its first call."""
    solver(S, starts[0], **{**options, "max_iterations": 2})  # compile and prepare
    return [_undisturbed(solver, S, start, options) for start in starts]


def _undisturbed(
    solver: Callable[..., Relaxation], S: Ensemble, start: Floats, options: dict[str, Any]
) -> Relaxation:
    """The fastest of repeated runs from a start: other programs can stall short ones."""
    runs = [solver(S, start, **options)]
    while len(runs) < REPEATS and sum(run.seconds for run in runs) < STEADY:
        runs.append(solver(S, start, **options))
    return min(runs, key=lambda run: run.seconds)


def summary(run: list[Relaxation]) -> Row:
    """Times, and how many runs reached the GOAL, as a row."""
    reached = [r.residual <= GOAL for r in run]
    return {
        "seconds": float(np.median([r.seconds for r in run])),
        "fastest": float(min(r.seconds for r in run)),
        "slowest": float(max(r.seconds for r in run)),
        "iterations": float(np.median([r.iterations for r in run])),
        "worst_residual": float(max(r.residual for r in run)),
        "runs": len(run),
        "reached": sum(reached),
        "no_equilibrium": sum(r.converged and not ok for r, ok in zip(run, reached, strict=True)),
        "note": _verdict(run, reached),
    }


def _verdict(run: list[Relaxation], reached: list[bool]) -> str:
    short = [r for r, ok in zip(run, reached, strict=True) if not ok and not r.converged]
    moving = [r for r, ok in zip(run, reached, strict=True) if not ok and r.converged]
    parts = []
    if short:
        longest = max(r.seconds for r in short)
        parts.append(f"{len(short)} not converged after {longest:.2g} s")
    if moving:
        parts.append(f"{len(moving)} ended in motion")
    return "; ".join(parts)


def _ratio(baseline: list[Relaxation], run: list[Relaxation]) -> Row:
    ratio = np.median([r.seconds for r in baseline]) / np.median([r.seconds for r in run])
    bound = any(r.residual > GOAL for r in baseline) and all(r.residual <= GOAL for r in run)
    return {"ratio": float(ratio), "ratio_is_lower_bound": bool(bound)}


def contact_updates(n: int = 400, mu: float = 0.1, sweeps: int = 2000) -> list[Row]:
    """Rows: nanoseconds per contact update of granforce's sweep, alone and against Siconos.

    Both start from the same forces in a box of fixed size and do the same number of sweeps.
    """
    ((row, S),) = packings("contact updates", n, [mu])
    options: dict[str, Any] = {"rest": None, "tolerance": 0.0, "max_iterations": sweeps}
    runs = runs_of(S, kicked(S, 5, 0), gauss_seidel, options)
    each = float(np.median([1e9 * r.seconds / (r.iterations * len(S.index)) for r in runs]))
    remark = f"{runs[0].iterations} sweeps, box free to dilate"
    alone = {**row, "solver": "granforce sweep", "ns_per_update": each, "note": remark}
    searches = SideBySide(S, LANES, **options)
    for _ in range(2):  # the first call compiles
        for lane, start in enumerate(kicked(S, LANES, 0)):
            searches.begin(lane, start)
        seconds = timed(searches.ended)[0]
    ns = 1e9 * seconds / (searches.sweeps.sum() * len(S.index))
    remark = f"{LANES} relaxations side by side"
    rows = [alone, {**alone, "ns_per_update": ns, "ratio": each / ns, "note": remark}]
    rows.append(row | _grouped(S, kicked(S, 1, 0)[0], sweeps))
    for tolerance in TOLERANCES:
        comparison = against_siconos(S, kicked(S, 1, 0)[0], tolerance)
        if comparison is None:
            return [*rows, {**row, "solver": "Siconos NSGS", "note": ABSENT}]
        remark = (
            f"{comparison['sweeps']} sweeps, forces differ by {comparison['difference']:.0e} ⟨f_n⟩"
        )
        both = {"granforce sweep": comparison["ns"], "Siconos NSGS": comparison["siconos_ns"]}
        for name, each in both.items():
            ratio = comparison["siconos_ns"] / each
            measured = {"solver": name, "ns_per_update": each, "ratio": ratio}
            rows.append({**row, **measured, "note": remark})
    return rows


def _grouped(S: Ensemble, start: Floats, sweeps: int) -> Row:
    """A row: sweeps over groups of contacts against as many over single contacts."""
    seconds, forces = [], []
    for kernel in (_in_order, _in_groups):
        runs = []
        for _ in range(3):  # the first run compiles
            problem, velocity, _, _ = from_rest(S)
            set_stiffness(problem)
            force = start.copy()
            dilation = add_forces(problem, force, velocity, 0.0)
            runs.append(timed(kernel, problem, S.mu, force, velocity, dilation, sweeps)[0])
        seconds.append(min(runs[1:]))
        forces.append(force)
    difference = np.abs(forces[1] - forces[0]).max()
    return {
        "solver": "granforce sweep, groups",
        "ns_per_update": 1e9 * seconds[1] / (sweeps * len(S.index)),
        "ratio": seconds[0] / seconds[1],
        "note": f"as {sweeps} sweeps over single contacts; forces differ by {difference:.0e} ⟨f_n⟩",
    }


@allocating
def _in_order(
    problem: StepProblem, mu: float, force: Floats, velocity: Floats, dilation: float, sweeps: int
) -> None:
    order = np.arange(force.shape[0])
    for _ in range(sweeps):
        dilation, _, _ = sweep(problem, order, mu, force, velocity, dilation, ONE)


@allocating
def _in_groups(
    problem: StepProblem, mu: float, force: Floats, velocity: Floats, dilation: float, sweeps: int
) -> None:
    groups = grouped(problem, force, velocity)
    for _ in range(sweeps):
        dilation = sweep_groups(groups, mu, dilation)
    ungroup(groups, force, velocity)


def scaling(
    n: int = 100,
    mu: float = 0.1,
    tiles: Sequence[int] = (1, 2, 4, 8, 16),
    repeats: int = 3,
    patience: float = 60.0,
) -> list[Row]:
    """Rows: time per relaxation against N by tiling, and the exponent of time with N per solver.

    A solver is left out at sizes above the one where it first needed `patience` seconds. The
    exponent is the slope of log time over log N, over the sizes at which GOAL was reached.
    """
    rows, tired = [], set()
    for case, S in tilings("scaling", ensemble(pack(n, mu, 1)), tiles):
        starts = kicked(S, repeats if repeats == 1 else 5 * repeats, 0)
        for name, (solver, options) in solvers().items():
            if name in tired:
                continue
            setup, _ = timed(solver, S, starts[0], **{**options, "max_iterations": 1})
            run = [solver(S, starts[0], **options)]
            if run[0].seconds > patience:
                tired.add(name)
            else:
                # Short runs are repeated more often: a few milliseconds are easily disturbed.
                enough = 1 + int(min(len(starts) - 1, max(repeats - 1, 0.5 / run[0].seconds)))
                run += [solver(S, start, **options) for start in starts[1:enough]]
            row = case | {"mu": mu, "contacts": len(S.index), "solver": name}
            rows.append(row | summary(run) | {"first_call": setup})
    return rows + exponents(rows, mu)


def exponents(rows: Rows, mu: float) -> list[Row]:
    """A row for each solver: b of seconds ~ N^b over the sizes at which it reached GOAL."""
    fits = []
    for name in solvers():
        reached = [r for r in rows if r["solver"] == name and r["reached"] == r["runs"]]
        sizes = f"N = {reached[0]['n']} … {reached[-1]['n']}" if reached else "goal never reached"
        slope = growth_of(reached, "seconds")
        fits.append({"n": "fit", "mu": mu, "solver": name, "exponent": slope, "note": sizes})
    return fits
