"""Inference beside PIQP and HiGHS, which get the same programs."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import highspy
import numpy as np
from scipy import sparse

from granforce.bench.runner import Row, compared, packings
from granforce.explore.uniform import sample_uniform
from granforce.forces.ensemble import Ensemble
from granforce.forces.likeliest import checked, fitted
from granforce.numerics import highs as programs
from granforce.types import Floats

# Errors of f_n and f_t in ⟨f_n⟩, and the time limit of HiGHS in seconds.
ERRORS, PATIENCE = (0.2, 0.1), 120.0


def _measurement(S: Ensemble, rng: np.random.Generator, seed: int) -> tuple[Floats, Floats]:
    """A uniform state of S measured with ERRORS, and the errors (2,)."""
    sigma = np.array(ERRORS) * S.force_scale
    truth = sample_uniform(S, 8, seed=seed).flat[-1]
    return truth + sigma * rng.standard_normal(truth.shape), sigma


def inference(
    n: int = 400, frictions: Sequence[float] = (0.01, 0.1, 0.5), seed: int = 1, repeats: int = 3
) -> list[Row]:
    """Rows: seconds of one inference (the least of some), and its difference from the first method.

    A uniform state of S is measured completely with ERRORS. ratio: time over that of the contact
    program; chi_square: of the forces reached; off: largest difference of a force, in ⟨f_n⟩.
    """
    rows = []
    for case, S in packings("inference", n, frictions, seed):
        given = (S, *_measurement(S, np.random.default_rng(seed), seed))
        methods = {name: partial(solve, *given) for name, solve in SOLVERS.items()}
        rows += compared(
            case | {"unknowns": S.A.shape[1]},
            methods,
            partial(_errors, *given),
            "contact program",
            repeats=repeats + 1,  # the first run compiles
            over_baseline=True,
        )
    return rows


def _errors(S: Ensemble, m: Floats, sigma: Floats, name: str, results: Row) -> Row:
    forces = results[name]
    if forces is None:
        return {"note": f"ended without an optimum (limit {PATIENCE:g} s)"}
    off = np.abs(forces - results["contact program"]).max() / S.force_scale
    chi_square = float(np.sum(((forces - m) / sigma) ** 2))
    return {"chi_square": chi_square, "off": float(off), "residual": S.residual(forces)}


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


SOLVERS: dict[str, Callable[..., Floats | None]] = {
    "contact program": contact_program,
    "PIQP": piqp,
    "HiGHS": highs,
}
