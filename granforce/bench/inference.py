"""Inference: the likeliest network by the contact program, by PIQP and by HiGHS, in one run."""

from collections.abc import Callable, Sequence
from typing import Any

import highspy
import numpy as np
from scipy import sparse

from granforce.bench.report import note
from granforce.explore.uniform import sample_uniform
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.forces.likeliest import checked, fitted
from granforce.numerics import highs as programs
from granforce.packing.compaction import pack
from granforce.system.clock import timed
from granforce.types import Floats

# Errors of f_n and f_t in ⟨f_n⟩, and the time limit of HiGHS in seconds.
ERRORS, PATIENCE = (0.2, 0.1), 120.0


def inference(
    quick: bool = True,
    *,
    n: int | None = None,
    frictions: Sequence[float] | None = None,
    seed: int = 1,
    repeats: int = 3,
) -> list[dict[str, Any]]:
    """Rows: seconds of one inference (the least of some), and its difference from the first method.

    A uniform state of S is measured completely with ERRORS. ratio: time over that of the contact
    program; chi_square: of the forces reached; off: largest difference of a force, in ⟨f_n⟩.
    """
    n = n or (100 if quick else 400)
    rows = []
    for mu in frictions or ((0.1,) if quick else (0.01, 0.1, 0.5)):
        S = ensemble(pack(n, mu, seed))
        rng = np.random.default_rng(seed)
        sigma = np.array(ERRORS) * S.force_scale
        truth = sample_uniform(S, 8, seed=seed).flat[-1]
        m = truth + sigma * rng.standard_normal(truth.shape)
        first: Any = None
        for name, solve in METHODS.items():
            seconds, forces = _timed(solve, S, m, sigma, repeats)
            first = first or (seconds, forces)
            row = {"n": n, "mu": mu, "unknowns": S.A.shape[1], "method": name}
            row |= {"seconds": seconds, "ratio": seconds / first[0]}
            if forces is None:
                rows.append(row | {"note": f"ended without an optimum (limit {PATIENCE:g} s)"})
                continue
            row["chi_square"] = float(np.sum(((forces - m) / sigma) ** 2))
            off = np.abs(forces - first[1]).max() / S.force_scale
            rows.append(row | {"off": float(off), "residual": S.residual(forces)})
    return rows


def _timed(
    solve: Callable[..., Floats | None], S: Ensemble, m: Floats, sigma: Floats, repeats: int
) -> tuple[float, Floats | None]:
    """The least seconds of some runs, after one that compiles, and the forces; None on time-out."""
    taken: list[float] = []
    forces: Floats | None = None
    for _ in range(repeats + 1):
        seconds, forces = timed(solve, S, m, sigma)
        taken.append(seconds)
        if taken[-1] > 5.0:
            break
    note(f"{solve.__name__}: {min(taken):.3g} s")
    return min(taken), forces


def contact_program(S: Ensemble, m: Floats, sigma: Floats) -> Floats:
    """The forces by `granforce.infer`."""
    return fitted(S, *checked(S, m, sigma))


def _program(S: Ensemble, m: Floats, sigma: Floats) -> tuple[Any, ...]:
    """½ y·Q y + c·y over A y = b, y ≥ 0: (Q, c, A, b, T), scaled to a largest weight of 1."""
    A, b, T = S.scaled_form
    weight = np.tile(sigma.min() / sigma, len(m))[: T.shape[0]] ** 2
    weighted = sparse.diags(weight) @ T
    target = S.to_vector(m) / S.force_scale
    return sparse.csc_matrix(T.T @ weighted), -(weighted.T @ target), A, b, T


def piqp(S: Ensemble, m: Floats, sigma: Floats) -> Floats:
    """The forces by PIQP's sparse interior-point method."""
    Q, c, A, b, T = _program(S, m, sigma)
    solver = programs.quadratic_solver(400)
    solver.setup(Q, c, A, b, x_l=np.zeros(len(c)))
    solver.solve()
    return S.to_forces(T @ np.maximum(solver.result.x, 0.0)) * S.force_scale


def highs(S: Ensemble, m: Floats, sigma: Floats) -> Floats | None:
    """The forces by the active-set method of HiGHS; None on time-out."""
    Q, c, A, b, T = _program(S, m, sigma)
    model = programs.standard_form(A, b)
    programs.set_cost(model, c)
    hessian, lower = highspy.HighsHessian(), sparse.csc_matrix(sparse.tril(Q))
    hessian.dim_ = len(c)
    hessian.format_ = highspy.HessianFormat.kTriangular
    hessian.start_, hessian.index_ = lower.indptr, lower.indices
    hessian.value_ = lower.data
    model.passHessian(hessian)
    model.setOptionValue("time_limit", PATIENCE)
    status, y = programs.solve(model)
    if status != programs.OPTIMAL:
        return None
    return S.to_forces(T @ np.maximum(y, 0.0)) * S.force_scale


METHODS = {"contact program": contact_program, "PIQP": piqp, "HiGHS": highs}
