"""The admissible network nearest to given forces by PIQP: an independent check of `nearest`.

It also takes over if `nearest` or `likeliest` does not converge.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import piqp
from scipy import sparse

from granforce.forces.contact_problem import restored_balance
from granforce.forces.ensemble import Ensemble
from granforce.forces.grain_pressures import Rows, no_rows
from granforce.numerics import highs as programs
from granforce.records import Relaxation, positive, takes, whole
from granforce.system import cancelling
from granforce.tolerances import BALANCED
from granforce.types import Floats

# Coordinates y (in ⟨f_n⟩) far below this hardly change when balance is restored.
_FLOOR = 1e-6


@takes(Ensemble)
def nearest_piqp(
    ensemble: Ensemble, start: Floats, *, tolerance: float = BALANCED, max_iterations: int = 200
) -> Relaxation:
    """The point of S with the least Σ |F_c − F_start,c|², by PIQP.

    Solved in cone coordinates y ≥ 0 (p = f_n + f_t/μ, q = f_n − f_t/μ), in units of ⟨f_n⟩. Every
    call sets up its own solver. A cached solver, updated with each start, would save a tenth to a
    fifth of the time, but its rounding (1e-9 ⟨f_n⟩) depends on earlier calls, and the same start
    would no longer give the same forces.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    start : (N_c, 2) array
        Force.
    tolerance : float, default 10⁻¹⁰
        Of the solver's residuals and its duality gap, relative.
    max_iterations : int, default 200
        Of interior points.

    Returns
    -------
    Relaxation
        ``converged`` is False where S is empty.
    """
    begin = time.perf_counter()
    tolerance = positive(tolerance, "tolerance", or_zero=True)
    max_iterations = whole(max_iterations, "max_iterations", 1)
    start = ensemble.network(start, "start")
    T = ensemble.scaled_form[2]
    y, status, steps = _least(ensemble, T, ensemble.to_vector(start), max_iterations)
    forces = ensemble.to_forces(T @ y * ensemble.force_scale)
    residual = ensemble.residual(forces)
    return Relaxation(
        forces=forces,
        iterations=steps,
        residual=residual,
        violation=ensemble.violation(forces),
        converged=bool(status == piqp.PIQP_SOLVED and residual <= tolerance),
        seconds=time.perf_counter() - begin,
    )


def likeliest_piqp(
    ensemble: Ensemble, weights: Floats, target: Floats, rows: Rows | None = None
) -> Floats:
    """The forces (N_c, 2) of S with the least Σ (weights (f − target))² + Σ of `rows` likewise.

    They are admitted, or balance to rounding, which the caller checks. weights (N_c, 2), 1/force;
    target (N_c, 2), force, NaN counts as 0.
    """
    rows = rows or no_rows(ensemble)
    target, unit = ensemble.to_vector(np.nan_to_num(target)), ensemble.force_scale
    forces = sparse.diags(ensemble.to_vector(weights)), rows.unknowns(ensemble)
    W = sparse.vstack([forces[0], sparse.diags(1 / rows.sigma) @ forces[1]])
    right = np.append(forces[0] @ target, rows.values / rows.sigma) * unit
    scale = unit * np.abs(W).max() if W.nnz else 1.0
    W = sparse.csc_matrix(unit / scale * W @ ensemble.scaled_form[2])
    y, _, _ = _least(ensemble, W, right / scale, 200)
    forces = ensemble.pin(ensemble.to_forces(ensemble.scaled_form[2] @ y * unit))
    return forces if ensemble.admits(forces) else restored(ensemble, y)


def restored(ensemble: Ensemble, y: Floats) -> Floats:
    """Forces (N_c, 2) of y ≥ 0 (n,) of `Ensemble.scaled_form`, balanced to rounding.

    A program ends at its tolerance; the remaining residual is removed by the least relative change.
    """
    A, b, T = ensemble.scaled_form
    y = np.maximum(restored_balance(A, b, y, _FLOOR), 0.0)
    return ensemble.pin(ensemble.to_forces(T @ y * ensemble.force_scale))


def _least(
    ensemble: Ensemble, W: sparse.csc_matrix, target: Floats, max_iterations: int
) -> tuple[Floats, Any, int]:
    """y ≥ 0 (n,) of S with the least |W y − target/⟨f_n⟩|², PIQP's verdict and its iterations.

    The interior-point iterate may be negative by its tolerance: y ≥ 0 is set exactly, so that only
    the residual remains to be checked.
    """
    A, b, _ = ensemble.scaled_form
    solver = programs.quadratic_solver(max_iterations)
    slope = -(W.T @ (target / ensemble.force_scale))
    solver.setup(sparse.csc_matrix(W.T @ W), slope, A, b, x_l=np.zeros(A.shape[1]))
    status = cancelling.apart(solver.solve)
    return np.maximum(solver.result.x, 0.0), status, int(solver.result.info.iter)
