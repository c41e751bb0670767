"""Prescribed and known quantities: bounds compared with HiGHS, pulls and inference with PIQP.

Both sides of each comparison get the same programs; rows include the error of their results.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import sparse

from granforce.bench.exact import plain_loop
from granforce.bench.inference import ERRORS, contact_program, piqp
from granforce.bench.report import note
from granforce.explore.intervals import intervals
from granforce.explore.pull import pull
from granforce.explore.uniform import sample_uniform
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.forces.knowledge import Known
from granforce.numerics import highs as programs
from granforce.packing.compaction import pack
from granforce.system.clock import timed
from granforce.types import Floats, Integers

# Fraction of contacts with known forces, and the width of their bounds; values of a pull, as
# fractions of its interval.
KNOWN_PART, KNOWN_WITHIN = 0.1, 0.1
VALUES = np.linspace(0.05, 0.95, 8)


def knowledge(
    quick: bool = True,
    *,
    n: int | None = None,
    mu: float = 0.1,
    seed: int = 1,
    every: int | None = None,
    pulled: int = 3,
    repeats: int = 3,
) -> list[dict[str, Any]]:
    """Rows: seconds of the same programs by granforce and by the baseline, and their errors.

    Bounds are those of every n-th contact (`every`). ratio: seconds of the baseline, HiGHS or PIQP,
    over those of the row. gap: largest certified duality gap; off: how far a bound of the baseline
    is outside the certified ones, or the largest difference between forces; residual: largest
    unbalance, all in ⟨f_n⟩; above: largest relative excess of the minimised sum of squares over
    that of the other method.
    """
    n, every = n or (100 if quick else 400), every or (1 if quick else 6)
    packing = pack(n, mu, seed)
    S = ensemble(packing)
    rng = np.random.default_rng(seed)
    cases = {
        "bounds, pressure prescribed": S,
        "bounds, stress prescribed": ensemble(packing, prescribed="stress"),
        "bounds, a tenth of the forces known": ensemble(packing, known=_known(S, rng)),
    }
    rows = []
    for task, one in cases.items():
        rows += _bounds(task, one, one.index[::every])
    contacts = rng.choice(S.index, pulled, replace=False)
    rows += _pulls(S, contacts, repeats)
    rows += _inferences(S, rng, seed, repeats)
    return [{"n": n, "mu": mu, **row} for row in rows]


def _known(S: Ensemble, rng: np.random.Generator) -> Known:
    """Normal forces of some contacts, within a tenth of the packing's own."""
    count = max(1, round(KNOWN_PART * len(S.index)))
    places = np.sort(rng.choice(len(S.index), count, replace=False))
    forces = S.original[places]
    reach = np.full_like(forces, np.inf)
    reach[:, 0] = KNOWN_WITHIN * forces[:, 0]
    return Known(S.index[places], forces - reach, forces + reach)


def _bounds(task: str, S: Ensemble, contacts: Integers) -> list[dict[str, Any]]:
    note(f"knowledge: {task}")
    intervals(S, contacts[:1])  # compiles
    S = replace(S)  # without prepared data
    seconds, exact = timed(intervals, S, contacts)
    loop_seconds, bounds = timed(plain_loop, S, contacts)
    # The optimum is between the value attained and its bound.
    beyond = np.abs([bounds[0] - exact.low, bounds[1] - exact.high]) / S.force_scale
    outside = np.maximum(beyond - np.moveaxis(exact.gap, -1, 0), 0.0)
    common = {"task": task, "programs": exact.low.size + exact.high.size}
    return [
        common | _times("granforce", seconds, loop_seconds) | {"gap": exact.max_gap},
        common | _times("HiGHS", loop_seconds, loop_seconds) | {"off": float(outside.max())},
    ]


def _pulls(S: Ensemble, contacts: Integers, repeats: int) -> list[dict[str, Any]]:
    note("knowledge: pulls")
    exact = intervals(S, contacts)
    ends = zip(contacts, exact.low[:, 0], exact.high[:, 0], strict=True)
    targets = [(int(c), low + VALUES * (high - low)) for c, low, high in ends]

    def by_granforce() -> Floats:
        return np.concatenate([pull(S, c, values, S.original).states for c, values in targets])

    def by_piqp() -> Floats:
        return np.array([_pulled_by_piqp(S, c, v) for c, values in targets for v in values])

    def squares(states: Floats) -> Floats:
        return np.sum((states - S.original) ** 2, axis=(1, 2))

    return _beside("pulls", S, by_granforce, by_piqp, squares, repeats)


def _pulled_by_piqp(S: Ensemble, contact: int, value: float) -> Floats:
    """The network nearest to the original with this f_n."""
    A, b, T = S.scaled_form
    normal = T.tocsr()[S.per_contact * S.positions([contact])]
    solver = programs.quadratic_solver(400)
    solver.setup(
        sparse.csc_matrix(T.T @ T),
        -(T.T @ S.to_vector(S.original)) / S.force_scale,
        sparse.vstack([A, normal], format="csc"),
        np.append(b, value / S.force_scale),
        x_l=np.zeros(A.shape[1]),
    )
    solver.solve()
    return S.to_forces(T @ np.maximum(solver.result.x, 0.0) * S.force_scale)


def _inferences(
    S: Ensemble, rng: np.random.Generator, seed: int, repeats: int
) -> list[dict[str, Any]]:
    note("knowledge: inference")
    sigma = np.array(ERRORS) * S.force_scale
    truth = sample_uniform(S, 8, seed=seed).flat[-1]
    m = truth + sigma * rng.standard_normal(truth.shape)

    def by_granforce() -> Floats:
        return contact_program(S, m, sigma)[None]

    def by_piqp() -> Floats:
        return piqp(S, m, sigma)[None]

    def squares(states: Floats) -> Floats:
        return np.sum(((states - m) / sigma) ** 2, axis=(1, 2))

    return _beside("inference, everything measured", S, by_granforce, by_piqp, squares, repeats)


def _beside(
    task: str,
    S: Ensemble,
    by_granforce: Callable[[], Floats],
    by_piqp: Callable[[], Floats],
    squares: Callable[[Floats], Floats],
    repeats: int,
) -> list[dict[str, Any]]:
    """Rows for two ways to compute the same networks, after one run that compiles."""
    by_granforce()
    taken, results = zip(*(timed(by_granforce) for _ in range(repeats)), strict=True)
    taken_by, reference = zip(*(timed(by_piqp) for _ in range(repeats)), strict=True)
    off = float(np.abs(results[0] - reference[0]).max() / S.force_scale)
    reached = np.array([squares(results[0]), squares(reference[0])])
    above = np.max(reached / reached.min(axis=0) - 1, axis=1)
    rows = []
    for k, (name, times, forces) in enumerate(
        (("granforce", taken, results[0]), ("PIQP", taken_by, reference[0]))
    ):
        row = {"task": task, "programs": len(forces), **_times(name, min(times), min(taken_by))}
        errors = {"off": off, "residual": float(np.max(S.residual(forces)))}
        rows.append(row | errors | {"above": float(above[k])})
    return rows


def _times(method: str, seconds: float, baseline: float) -> dict[str, Any]:
    return {"method": method, "seconds": seconds, "ratio": baseline / seconds}
